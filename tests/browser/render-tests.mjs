// `texmesh render` beside three.js: the same files, the same light, the same camera, pixel by pixel.
import {PNG, check, common, env, fs, lab, labRoots, launch, listen, packages, path, pictures, run, serve} from './browser.mjs';
import {test} from './harness.mjs';
import {sheetGlb} from './sheet.mjs';
import {spheresGlb} from './spheres.mjs';
import {tilesGlb} from './tiles.mjs';

const kSizePx = 512;
const kMostApart = 3; // of 255, in the mean over covered pixels
const kEnvironmentPx = 1024;
const data = env.data || path.join(env.source, '../shared/data');

/** Models that are made here, and scans of the data folder. */
const kScenes = {
  spheres: spheresGlb, 'blended sheet': () => sheetGlb({alphaMode: 'BLEND', metal: true}), 'sheet with holes': () => sheetGlb({alphaMode: 'MASK', metal: true}),
  tiles: tilesGlb, 'sea turtle': 'sea_turtle/sea_turtle.glb', saxophone: 'saxophone/saxophone.glb', 'flight helmet': 'flight_helmet/FlightHelmet.gltf',
};

/** Mean difference over the covered pixels, and a picture of it, eight times as strong. */
function compare(ours, theirs, coveredPx) {
  const shown = new PNG({width: ours.width, height: ours.height});
  let sum = 0;
  for (let i = 0; i < ours.data.length; i++) {
    if (i % 4 === 3) { shown.data[i] = 255; continue; }
    const d = Math.abs(ours.data[i] - theirs.data[i]);
    sum += d;
    shown.data[i] = Math.min(255, 8 * d);
  }
  return {mean: sum / 3 / coveredPx, shown};
}

/** A page under the renderer's light. */
let lit;
function litPage() {
  return (lit ??= (async () => {
    const {browser} = await common();
    fs.mkdirSync(packages, {recursive: true});
    const key = JSON.parse(run(env.exportEnvironment, path.join(packages, 'studio.f32'), String(kEnvironmentPx)));
    const server = await serve({'/data/': data, ...labRoots});
    const page = await browser.newPage({viewport: {width: kSizePx + 40, height: kSizePx + 40}});
    listen(page);
    await page.goto(`${server.url}/lit.html`);
    await page.waitForFunction('window.ready', null, {timeout: 20000});
    const works = await lab(page, ([k, s]) => window.lit.light(k, s), [{...key, url: `${server.url}/packages/studio.f32`}, kSizePx]);
    check(works, 'the browser does not filter textures of floats');
    return {page, url: server.url};
  })());
}

for (const [name, source] of Object.entries(kScenes))
  test(`texmesh render shows what three.js shows: ${name}`, async ({skip}) => {
    const made = typeof source === 'function';
    const model = path.join(made ? packages : data, made ? `render-${name}.glb` : source);
    if (!made && !fs.existsSync(model)) skip(`${model} is not there`);
    const {page, url} = await litPage();
    if (made) fs.writeFileSync(model, source());
    const modelUrl = encodeURI(`${url}/${made ? 'packages' : 'data'}/${made ? path.basename(model) : source}`);
    const file = (kind) => path.join(pictures, `render-${name.replaceAll(' ', '-')}-${kind}.png`);
    const told = JSON.parse(run(env.texmesh, 'render', model, '-o', file('texmesh'), '--size', String(kSizePx), '--json'));
    const ours = PNG.sync.read(fs.readFileSync(file('texmesh')));
    const background = [...ours.data.subarray(0, 3)];
    const base64 = await lab(page, ([u, v, b]) => window.lit.picture(u, v, b), [modelUrl, told.views[0], background]);
    const theirs = new PNG({width: kSizePx, height: kSizePx});
    theirs.data = Buffer.from(base64, 'base64');
    const {mean, shown} = compare(ours, theirs, told.views[0].covered_px);
    fs.writeFileSync(file('three'), PNG.sync.write(theirs));
    fs.writeFileSync(file('difference'), PNG.sync.write(shown));
    console.log(`  ${name}: ${mean.toFixed(2)} of 255 over ${told.views[0].covered_px} pixels`);
    check(page.said.length === 0, page.said.join('\n'));
    check(told.views[0].covered_px > 0.05 * kSizePx * kSizePx, `${told.views[0].covered_px} pixels are covered`);
    check(mean <= kMostApart, `differs by ${mean.toFixed(2)} of 255 in the mean, at most ${kMostApart} are allowed`);
  });
