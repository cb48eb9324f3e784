// What textures lose as blocks of 4 x 4 texels: PSNR and angles of scans' own textures against decoders that are none of the encoder's, and
// lit FLIP of loads. TEXMESH_DATA names the folder with the scans; packages are kept as those of page-figures.mjs. Words: names of the scans
// whose FLIP is measured (head, apple, turtle and saxophone).
import {createRequire} from 'node:module';
import {PNG, check, env, fs, lab, labPage, labRoots, launch, path, pictures, run, serve} from './browser.mjs';
import {countStorage, onlyFormats} from './gpu-storage.mjs';
import {loaded} from './loads.mjs';

const kColours = {
  head: 'lee_perry_smith_head/color.jpg', bust: 'marble_bust_4k/marble_bust_01_diff_4k.jpg', site: 'realitycapture_site/site_tex0.jpg', turtle: 'sea_turtle/sea_turtle.glb',
  saxophone: 'saxophone/saxophone.glb',
};
const kData = {leather: 'flight_helmet/FlightHelmet_Materials_LeatherPartsMat_OcclusionRoughMetal.png'};
const kNormals = {head: 'lee_perry_smith_head/normal.jpg', bust: 'marble_bust_4k/marble_bust_01_nor_gl_4k.jpg', apple: 'apple_4k/textures/food_apple_01_nor_gl_4k.jpg'};
const kDecoders = {bc1: 'decodeBc1', 'bc3-normal': 'decodeBc3Normal', bc5: 'decodeBc5', bc7: 'decodeBc7', etc2: 'decodeEtc2', astc: 'decodeAstc', 'astc-normal': 'decodeAstcNormal'};
const kTwoChannels = ['bc3-normal', 'bc5', 'astc-normal'];
const kScans = {head: 'lee_perry_smith_head/LeePerrySmith.gltf', apple: 'apple_4k/food_apple_01_4k.gltf', turtle: 'sea_turtle/sea_turtle.glb', saxophone: 'saxophone/saxophone.glb'};
const kWays = {
  'BC7, BC5': ['texture_compression_bptc', 'texture_compression_rgtc'], ASTC: ['texture_astc'], 'BC1, BC3': ['texture_s3tc', 'texture_s3tc_srgb'], 'ETC2, normals RGBA': ['texture_etc'],
};
const figures = process.env.TEXMESH_FIGURE_PACKAGES ?? path.join(env.work, 'figures');
if (!env.data || !Object.values({...kColours, ...kData, ...kNormals}).every((file) => fs.existsSync(path.join(env.data, file)))) {
  console.log('skipped: TEXMESH_DATA names no folder with these scans');
  process.exit(77);
}

const packageOf = (name) => path.join(figures, `${path.dirname(kScans[name])}.texmesh`);

/** The image file, or the base colour of a GLB's first material. */
function imageOf(file) {
  const bytes = fs.readFileSync(path.join(env.data, file));
  if (!file.endsWith('.glb')) return bytes;
  const size = bytes.readUInt32LE(12);
  const {materials, textures, images, bufferViews} = JSON.parse(bytes.subarray(20, 20 + size));
  const {source, extensions} = textures[materials[0].pbrMetallicRoughness.baseColorTexture.index];
  const {byteOffset = 0, byteLength} = bufferViews[images[source ?? Object.values(extensions)[0].source].bufferView];
  return bytes.subarray(28 + size + byteOffset, 28 + size + byteOffset + byteLength);
}

const folder = path.join(env.work, 'block-figures');
fs.mkdirSync(folder, {recursive: true});
const {transformSync} = createRequire(path.join(env.work, 'work/delivery/web/package.json'))('esbuild');
fs.writeFileSync(path.join(folder, 'decoders.js'), transformSync(fs.readFileSync(path.join(env.source, 'delivery/web/tests/support/block_decoders.ts')), {loader: 'ts'}).code);
for (const [kind, files] of Object.entries({colour: kColours, data: kData, normal: kNormals}))
  for (const [name, file] of Object.entries(files)) fs.writeFileSync(path.join(folder, `${kind}-${name}`), imageOf(file));

/** In the page: for each format, PSNR in dB of the middle 1024 x 1024 texels, or the root mean square of degrees. */
async function losses([url, decoders, isNormal]) {
  const [{toBlocks}, decode] = await Promise.all([import('/texmesh/blocks.js'), import('/block-figures/decoders.js')]);
  const picture = await createImageBitmap(await (await fetch(url)).blob(), {colorSpaceConversion: 'none', premultiplyAlpha: 'none'});
  const side = Math.min(1024, picture.width, picture.height) & ~3;
  const context = new OffscreenCanvas(side, side).getContext('2d', {alpha: false, willReadFrequently: true});
  context.drawImage(picture, (side - picture.width) >> 1, (side - picture.height) >> 1);
  const {data} = context.getImageData(0, 0, side, side);
  const unit = (v) => { const length = Math.hypot(...v) || 1; return v.map((x) => x / length); };
  const two = (x, y) => [x, y, Math.sqrt(Math.max(0, 1 - x * x - y * y))];
  const out = {};
  for (const [format, [name, twoChannels]] of Object.entries(decoders)) {
    const [{data: blocks}] = await toBlocks({pixels: new Uint8Array(data), width: side, height: side}, {format, own: 1, size: [side, side]});
    const bytes = (16 * blocks.length) / (side * side);
    let sum = 0;
    for (let k = 0; k * bytes < blocks.length; ++k)
      decode[name](blocks.slice(k * bytes, (k + 1) * bytes)).forEach((texel, i) => {
        const at = 4 * (((k % (side / 4)) * 4 + (i & 3)) + side * (Math.floor(k / (side / 4)) * 4 + (i >> 2)));
        if (isNormal) {
          const [a, z] = [data.slice(at, at + 3), texel].map((t) => Array.from(t).slice(0, 3).map((v) => (v - 127.5) / 127.5));
          const [u, v] = [unit(a), unit(twoChannels ? two(z[0], z[1]) : z)];
          sum += ((Math.acos(Math.min(1, u[0] * v[0] + u[1] * v[1] + u[2] * v[2])) * 180) / Math.PI) ** 2;
        } else for (let c = 0; c < 3; ++c) sum += (data[at + c] - texel[c]) ** 2 / 3;
      });
    const mean = sum / (side * side);
    out[format] = isNormal ? Math.sqrt(mean) : 10 * Math.log10((255 * 255) / mean);
  }
  return out;
}

const browser = await launch();
const server = await serve({'/figures/': figures, '/block-figures/': folder, ...labRoots});
const page = await labPage(browser, server.url);
const row = (...cells) => console.log(`| ${cells.join(' | ')} |`);
row('', ...Object.keys(kDecoders));
row('---', ...Object.keys(kDecoders).map(() => '--:'));
for (const [kind, files, digits] of [['colour', kColours, 1], ['data', kData, 1], ['normal', kNormals, 2]]) {
  const isNormal = kind === 'normal';
  const decoders = Object.fromEntries(Object.entries(kDecoders).map(([f, name]) => [f, [name, kTwoChannels.includes(f)]]).filter(([, [, two]]) => isNormal || !two));
  const all = [];
  for (const name of Object.keys(files)) all.push(await page.evaluate(losses, [`/block-figures/${kind}-${name}`, decoders, isNormal]));
  row(`${kind}, ${isNormal ? 'degrees' : 'dB'}: ${Object.keys(files).join(', ')}`, ...Object.keys(kDecoders).map((f) => (decoders[f] ? all.map((r) => r[f].toFixed(digits)).join(', ') : '')));
}
row('Mpixel/s in one worker', ...Object.values(await lab(page, () => window.lab.blockSpeeds())).map((v) => v.toFixed(0)));
await page.close();

/** A picture of 700 px of a load within the time that it takes; what is background is transparent. */
async function shown(name, formats, load) {
  const url = `${server.url}/figures/${path.basename(packageOf(name))}`;
  const shot = await labPage(browser, server.url, `(${countStorage})();(${onlyFormats})(${JSON.stringify(formats)});`);
  await lab(shot, async (u) => {
    const {manifest} = await window.lab.open(u);
    window.lab.start({size: 700, min: manifest.boundsMin, max: manifest.boundsMax});
  }, url);
  const r = await loaded(null, shot, url, {load: {time: 1e9, display: 700, autoRefine: false, ...load}});
  check(!r.error, JSON.stringify(r.error));
  const data = Buffer.from(await lab(shot, () => { window.lab.draw(); return [...window.lab.pixels()]; }));
  for (let i = 0; i < data.length; i += 4) data[i + 3] = data.subarray(i, i + 3).equals(data.subarray(0, 3)) ? 0 : 255; // the corner is background
  await shot.close();
  return {data, gpuBytes: r.state.gpuBytes, widths: Math.max(...r.state.planes.map((p) => p.widthPx))};
}
function flip(pngs) {
  const files = pngs.map(([name, data]) => {
    const png = new PNG({width: 700, height: 700});
    data.copy(png.data);
    const file = path.join(pictures, `blocks-${name}.png`);
    fs.writeFileSync(file, PNG.sync.write(png));
    return file;
  });
  return run(path.join(path.dirname(env.compose), 'flip_pictures'), ...files).trim().split('\n').map(Number);
}
console.log('\nlit FLIP of 700 px against RGBA; MB on the GPU\n');
row('', 'RGBA', ...Object.keys(kWays), 'RGBA mips within the memory of BC7');
row('---', '--:', ...Object.keys(kWays).map(() => '--:'), '--:');
for (const name of process.argv[2]?.split(',') ?? Object.keys(kScans)) {
  if (!fs.existsSync(packageOf(name))) run(env.texmesh, 'compile', path.join(env.data, kScans[name]), '-o', packageOf(name), '--quiet', '--quality.views', '1');
  const reference = await shown(name, [], {compress: 'never'});
  const ways = [];
  for (const formats of Object.values(kWays)) ways.push(await shown(name, formats, {compress: 'always'}));
  ways.push(await shown(name, [], {compress: 'never', memoryBytes: ways[0].gpuBytes}));
  const flips = flip([[`${name}-rgba`, reference.data], ...ways.map((w, i) => [`${name}-${i}`, w.data])]);
  row(`${name}, ${reference.widths} px`, '0', ...flips.map((f) => f.toFixed(4)));
  row('MB', ...[reference, ...ways].map((w) => (w.gpuBytes / 1e6).toFixed(1)));
}
await browser.close();
await server.close();
