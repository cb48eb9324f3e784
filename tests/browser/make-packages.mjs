// Small packages for the tests, made by make_scan and texmesh; kept while both programs are older than they are.
import {fileURLToPath} from 'node:url';
import {env, fs, packages, path, run} from './browser.mjs';
import {sheetGlb} from './sheet.mjs';

const kQuick = ['--no-cache', '--quiet', '--quality.views', '1', '--quality.largest_px', '512'];

/** Names and what they are made of. */
const kPackages = {
  // Three materials' maps, every fragment small.
  maps: {scan: ['--triangles', '3000', '--texture', '256', '--charts', '8', '--textures'], options: ['--rungs', '20,50,85']},
  // Enough bytes for a link of 2 Mbit/s to have something to do. Larger proxies would stand for scales up to some hundred pixels.
  large: {scan: ['--triangles', '30000', '--texture', '2048', '--charts', '30'],
    options: ['--rungs', '10,20,35,50,70,85,95', '--proxies.sizes', '36000,50000']},
  progressive: {scan: ['--triangles', '2000', '--texture', '512', '--charts', '8'], options: ['--ladder', 'progressive']},
  // Sources stay in the package, too.
  kept: {scan: ['--triangles', '1500', '--texture', '256', '--charts', '6', '--textures'], options: ['--rungs', '20,85', '--keep-source']},
  webp: {scan: ['--triangles', '2000', '--texture', '512', '--charts', '8'], options: ['--ladder', 'webp', '--rungs', '20,60']},
  // Meshes that three.js decodes without a worker.
  meshopt: {scan: ['--triangles', '3000', '--texture', '512', '--charts', '8'], options: ['--rungs', '20,60,85', '--mesh-codec', 'meshopt']},
  // Coverage, two sides, a texture of a material extension; the source stays beside them.
  blend: {sheet: {alphaMode: 'BLEND'}, options: ['--rungs', '20,60,90']},
  mask: {sheet: {alphaMode: 'MASK'}, options: ['--rungs', '20,60,90']},
  // What shows little but its surroundings.
  metal: {sheet: {alphaMode: 'OPAQUE', metal: true}, options: ['--rungs', '20,60,90']},
  // Two proxies: scales of its own with a small texture, as meshopt codes meshes.
  proxied: {scan: ['--triangles', '30000', '--texture', '1024', '--charts', '30'], options: ['--rungs', '20,50,85'], proxies: [[300, 64], [600, 128]]},
  // The thesis as printed.
  printed: {scan: ['--triangles', '4000', '--texture', '1024', '--charts', '12'], options: ['--profile', 'thesis', '--rungs', '10,30,60,90']},
  // All of the thesis's scales, a GLB each.
  chain: {scan: ['--triangles', '4000', '--texture', '256', '--charts', '8'], options: ['--profile', 'thesis', '--jnd', '0.02', '--rungs', '20,85']},
  // Whose it is, in words that a page must not take for markup.
  told: {
    scan: ['--triangles', '1500', '--texture', '256', '--charts', '6'], options: ['--rungs', '20,85'],
    meta: {attribution: '<img src=x onerror=alert(1)> Museum of Casts', licence: 'CC-BY-4.0'},
  },
  // Notes: one in two languages with a camera, one behind the object, with a script in its text.
  noted: {
    scan: ['--triangles', '3000', '--texture', '256', '--charts', '8', '--textures'], options: ['--rungs', '20,85'],
    notes: {annotations: [
      {position: [0, 0, 0.16], normal: [0, 0, 1], camera: {position: [0, 0, 0.8], target: [0, 0, 0], fovDegrees: 40},
        texts: [{language: 'en', title: 'The front', text: 'Mended in 1820.'}, {language: 'de', title: 'Die Vorderseite'}]},
      {position: [0, 0, -0.11], normal: [0, 0, -1], texts: [{language: 'en', title: '<img src=x onerror=alert(1)>', text: '<script>alert(1)</script>'}],
        images: [{url: 'https://example.org/a.jpg'}]}]},
  },
  // No texture at all: colours of vertices.
  colours: {scan: ['--triangles', '1500', '--texture', '0', '--charts', '4'], ending: 'ply', options: []},
};

/** Every scale as a file of its own, scales/NAME-sNN.glb, wherever the package has the scale. */
function extractScales(file, name) {
  fs.mkdirSync(path.join(packages, 'scales'), {recursive: true});
  const {scales} = JSON.parse(fs.readFileSync(path.join(packages, name, 'manifest.json')));
  for (const scale of scales.scale)
    run(env.texmesh, 'extract', file, '--scale', `${scale}`, '--recentre', '-o', path.join(packages, 'scales', `${name}-s${scale}.glb`));
}

/** A package with proxies, from the same scan compiled with another mesh codec. */
function addProxies(file, scan, proxies) {
  const [coded, plain] = ['coded', 'plain'].map((what) => file.replace('.texmesh', `-${what}.texmesh`));
  run(env.texmesh, 'compile', scan, '-o', coded, ...kQuick, '--rungs', '50', '--mesh-codec', 'meshopt');
  const {scales} = JSON.parse(run(env.texmesh, 'dump', coded, 'scales', '--json'));
  const glbs = proxies.map(([triangles, px], k) => {
    const {scale} = scales.findLast((s) => s.triangles >= triangles) ?? scales[0];
    run(env.texmesh, 'extract', coded, '--scale', `${scale}`, '--display', `${px}`, '--recentre', '-o', `${file}.${k}.glb`);
    return `${file}.${k}.glb`;
  });
  fs.renameSync(file, plain);
  run('python3', path.join(env.source, 'tests/golden/add_proxies'), plain, file, '0', ...glbs);
  for (const used of [coded, plain, ...glbs]) fs.rmSync(used);
}

export function makePackages() {
  fs.mkdirSync(packages, {recursive: true});
  const newest = fs.statSync(env.texmesh).mtimeMs;
  for (const [name, p] of Object.entries(kPackages)) {
    const file = path.join(packages, `${name}.texmesh`);
    if (fs.existsSync(file) && fs.statSync(file).mtimeMs > newest) continue;
    const scan = path.join(packages, `${name}.${p.ending ?? 'glb'}`);
    if (p.sheet) fs.writeFileSync(scan, sheetGlb(p.sheet));
    else run(env.makeScan, '-o', scan, ...p.scan);
    const meta = p.meta ? ['--meta', path.join(packages, `${name}.json`)] : [];
    if (p.meta) fs.writeFileSync(meta[1], JSON.stringify(p.meta));
    const notes = p.notes ? ['--annotations', path.join(packages, `${name}-notes.json`)] : [];
    if (p.notes) fs.writeFileSync(notes[1], JSON.stringify(p.notes));
    run(env.texmesh, 'compile', scan, '-o', file, ...kQuick, ...p.options, ...meta, ...notes);
    if (p.proxies) addProxies(file, scan, p.proxies);
    if (!p.sheet) fs.rmSync(scan);
    run(env.texmesh, 'unpack', file, '-o', path.join(packages, name), '--force');
    if (name === 'maps') extractScales(file, name);
    // Elsewhere, so that a server without ranges finds each kind of tree alone.
    fs.mkdirSync(path.join(packages, 'files'), {recursive: true});
    fs.copyFileSync(file, path.join(packages, 'files', `${name}.texmesh`));
    run(env.texmesh, 'unpack', file, '-o', path.join(packages, 'files', name), '--fragments', 'files', '--force');
    fs.mkdirSync(path.join(packages, 'alone'), {recursive: true});
    fs.copyFileSync(file, path.join(packages, 'alone', `${name}.texmesh`));
  }
}

if (process.argv[1] === fileURLToPath(import.meta.url)) makePackages();
