// Twenty scans in a grid behind 4 Mbit/s and 40 ms: <texmesh-viewer> beside <model-viewer> with GLBs of the same scans. Prints a table and
// leaves screenshots at .5, 1 and 3 s. TEXMESH_DATA names the folder with the scans (without it, owls and rocks of make_scan stand for them);
// what is compiled of them is kept in TEXMESH_FIGURE_PACKAGES.
// A grid of fewer scans repeats them under other addresses: nothing is fetched once for two elements. Words: the number of
// runs (default 3), and `texmesh`, `model-viewer` or `memory` (what limits and blocks make of it) for one of them alone, or `readme`
// for the first two.
import {check, env, fs, here, launch, listen, path, pictures, run, serve} from './browser.mjs';
import {countStorage, onlyFormats} from './gpu-storage.mjs';
import {startLink} from './link.mjs';
import {starvation} from './starved.mjs';

const kScans = {
  fuze_bottle: 'fuze_bottle/fuze.obj', fran_cyberware: 'fran_cyberware/fran_cut.obj', lee_perry_smith_head: 'lee_perry_smith_head/LeePerrySmith.gltf',
  apple_4k: 'apple_4k/food_apple_01_4k.gltf', asteroid_eros: 'asteroid_eros/eros.obj', yurt: 'yurt/yurt.glb',
  marble_bust_4k: 'marble_bust_4k/marble_bust_01_4k.obj', ycb_banana_4k: 'ycb_banana_4k/textured_simple_reoriented.obj',
};
const kElements = 20;
const kLink = {bytesPerSecond: 500000, rttMs: 40};
const kLimitS = 5;
const runs = Number(process.argv[2] ?? 3);
const kShown = ['texmesh', 'memory', 'model-viewer'];
const shown = !process.argv[3] ? kShown : process.argv[3] === 'readme' ? ['texmesh', 'model-viewer'] : [process.argv[3]];
const figures = process.env.TEXMESH_FIGURE_PACKAGES ?? path.join(env.work, 'figures');
fs.mkdirSync(figures, {recursive: true});

if (env.data === '')
  for (const name of Object.keys(kScans)) delete kScans[name];
for (let seed = 1; env.data === '' && seed <= 4; ++seed)
  for (const shape of ['owl', 'rock']) kScans[`${shape}-${seed}`] = `${shape}-${seed}.glb`;

/** Package and GLB of a scan, made where they are missing; false where there is no scan. */
function made(name) {
  const [file, folder, scan] = [path.join(figures, `${name}.texmesh`), path.join(figures, `mv-${name}`), path.join(env.data || figures, kScans[name])];
  if (!fs.existsSync(file)) {
    const [shape, seed] = name.split('-');
    if (env.data === '') run(env.makeScan, '-o', scan, '--shape', shape, '--seed', seed);
    if (!fs.existsSync(scan)) return false;
    run(env.texmesh, 'compile', scan, '-o', file, '--quiet', '--quality.views', '1');
  }
  if (!fs.existsSync(folder)) run(env.texmesh, 'export', file, '--to', 'model-viewer', '--plain', '--script', 'x.js', '-o', folder);
  return true;
}
const names = Object.keys(kScans).filter(made);
check(names.length > 0, `${env.data}: none of the scans of the grid is there`);

const html = (script, element) => `<!doctype html><html lang="en"><title>grid</title><link rel="icon" href="data:,">
<style>body{margin:0}.grid{display:grid;grid-template-columns:repeat(5,1fr);gap:4px}${element}{width:100%;height:200px}</style>
<script type="module" src="${script}"></script><div class="grid">${Array.from({length: kElements}, (_, i) => {
  const name = names[i % names.length];
  return element === 'texmesh-viewer' ? `<texmesh-viewer src="/figures/${name}.texmesh?${i}" alt="${name}"></texmesh-viewer>` :
    `<model-viewer src="/figures/mv-${name}/model.glb?${i}" alt="${name}"></model-viewer>`;
}).join('')}</div></html>`;
const pages = path.join(env.work, 'grid');
fs.mkdirSync(pages, {recursive: true});
fs.writeFileSync(path.join(pages, 'texmesh.html'), html('/viewer/texmesh-viewer.js', 'texmesh-viewer'));
fs.writeFileSync(path.join(pages, 'model-viewer.html'), html('/model-viewer/model-viewer.min.js', 'model-viewer'));

const browser = await launch();
const server = await serve({
  '/figures/': figures, '/viewer/': path.join(env.work, 'work/delivery/web/dist/viewer'), '/model-viewer/': path.join(here, 'node_modules/@google/model-viewer/dist'), '/': pages,
}, {gzip: true});
const link = await startLink({target: server.port, ...kLink});

/** Runs in the page before anything else: when each element shows its first picture, and when each is done. */
function watch() {
  window.firsts = [];
  window.loads = [];
  const note = (list) => ({target}) => /-viewer$/i.test(target.localName ?? '') && list.push(performance.now() / 1000);
  document.addEventListener('poster-dismissed', note(window.firsts), true);
  // The time that the page has promised, and when it ended.
  document.addEventListener('poster-dismissed', async () => {
    const {texmeshPage} = await import('/viewer/texmesh-viewer.js');
    texmeshPage().on('deadline', (event) => (window.deadline ??= event));
  }, {capture: true, once: true});
  document.addEventListener('load', note(window.loads), true);
  document.addEventListener('error', ({target}) => console.error(`error of ${target.src ?? target}`), true);
}

/** One visit: seconds until all first pictures, until all is loaded; bytes on the GPU; the page's own deadline. */
async function visit(context, which, {shots = false} = {}) {
  const page = await context.newPage();
  listen(page);
  await page.addInitScript(countStorage);
  await page.addInitScript(watch);
  const starved = starvation();
  const sent = server.requests.length;
  await page.goto(`${link.url}/${which}.html`, {waitUntil: 'commit'});
  const began = performance.now();
  if (shots)
    for (const s of [0.5, 1, 3]) {
      await new Promise((go) => setTimeout(go, Math.max(0, 1000 * s - (performance.now() - began))));
      await page.screenshot({path: path.join(pictures, `grid-${which}-${s}.png`), timeout: 60000});
    }
  const done = which === 'texmesh' ? 'firsts' : 'loads'; // model-viewer's poster goes when the model is there
  await page.waitForFunction(([list, n]) => window[list].length >= n, [done, kElements], {timeout: 300000});
  const waited = starved();
  if (which === 'texmesh') await page.waitForFunction((n) => window.loads.length >= n, kElements, {timeout: 300000});
  const r = await page.evaluate(async ([list, texmesh]) => {
    const [first, loaded] = [Math.max(...window[list]), Math.max(...window.loads)];
    const said = texmesh ? (await import('/viewer/texmesh-viewer.js')).texmeshPage().gpuBytes : 0;
    return {first, loaded, deadline: window.deadline, stored: window.storedBytes(), said, heap: performance.memory?.usedJSHeapSize ?? 0};
  }, [done, which === 'texmesh']);
  if (shots) await page.screenshot({path: path.join(pictures, `grid-${which}-all.png`), timeout: 60000});
  check(!page.said.some((s) => /^error of/.test(s)), page.said.join('\n'));
  await page.close();
  return {...r, waited, bytes: server.requests.slice(sent).reduce((sum, q) => sum + q.bytes, 0)};
}

console.log(`${kElements} elements of ${names.length} scans, 4 Mbit/s, 40 ms\n`);
console.log('| page | scripts | first pictures, s | all in time, s | late by, s | starved, s | GPU, MB | heap, MB | sent, MB |\n|---|---|--:|--:|--:|--:|--:|--:|--:|');
const late = [];
for (const which of shown.filter((name) => name !== 'memory'))
  for (let k = 0; k < (which === 'texmesh' ? runs : 1); ++k) { // a minute and more each
    const context = await browser.newContext({viewport: {width: 1280, height: 900}});
    for (const scripts of ['cold', 'cached']) {
      const v = await visit(context, which);
      const lateS = v.deadline ? v.deadline.actual - v.deadline.limit : NaN;
      const row = [v.first, v.loaded, lateS, v.waited].map((s) => (Number.isNaN(s) ? '' : s.toFixed(2))).concat([v.stored, v.heap, v.bytes].map((b) => (b / 1e6).toFixed(1)));
      console.log(`| ${which} | ${scripts} | ${row.join(' | ')} |`);
      if (which === 'texmesh') late.push(lateS);
      if (which === 'texmesh') check(v.stored <= 256e6, `${v.stored} bytes on the GPU`);
    }
    await context.close();
  }
/** All that a screen of twice the density can show of twenty scans, within the default limit of a device; the link does not count. */
async function memory(gb, blocks) {
  const context = await browser.newContext({viewport: {width: 1280, height: 900}, deviceScaleFactor: 2});
  const page = await context.newPage();
  await page.addInitScript(countStorage);
  await page.addInitScript((memory) => Object.defineProperty(navigator, 'deviceMemory', {get: () => memory}), gb);
  if (!blocks) await page.addInitScript(onlyFormats, []);
  await page.goto(`${server.url}/texmesh.html`, {waitUntil: 'commit'});
  const all = () => [...document.querySelectorAll('texmesh-viewer')];
  await page.waitForFunction(`(${all})().every((e) => e.model?.phase === 'shown' && e.model.complete)`, null, {timeout: 300000});
  const r = await page.evaluate(async () => {
    const {texmeshPage} = await import('/viewer/texmesh-viewer.js');
    const {gpuBytes, memoryBytes, models} = texmeshPage();
    const planes = models.flatMap((m) => m.load.state.planes);
    return {gpuBytes, memoryBytes, stored: window.storedBytes(), texels: planes.reduce((sum, p) => sum + p.widthPx * p.heightPx, 0), formats: [...new Set(planes.map((p) => p.texels))].sort()};
  });
  await page.screenshot({path: path.join(pictures, `grid-memory-${gb}-${blocks ? 'blocks' : 'rgba'}.png`), timeout: 60000});
  await context.close();
  check(Math.abs(r.gpuBytes - r.stored) <= 0.02 * r.stored + 70000 && r.gpuBytes <= r.memoryBytes, JSON.stringify(r));
  return r;
}
if (shown.includes('memory')) {
  console.log('\nall that 512 x 400 px can show of each of them\n\n| limit, MB | formats of the GPU | counted, MB | stored, MB | textures, Mpixel | as |\n|--:|---|--:|--:|--:|---|');
  for (const gb of [4, 0.5])
    for (const blocks of [false, true]) {
      const r = await memory(gb, blocks);
      console.log(`| ${[r.memoryBytes / 1e6, blocks ? 'BC' : 'RGBA alone', (r.gpuBytes / 1e6).toFixed(1), (r.stored / 1e6).toFixed(1), (r.texels / 1e6).toFixed(1), r.formats.join(', ')].join(' | ')} |`);
    }
}
for (const which of shown.filter((name) => name !== 'memory')) {
  const context = await browser.newContext({viewport: {width: 1280, height: 900}});
  await visit(context, which, {shots: true});
  await context.close();
}
if (late.length > 0) {
  const off = late.map((s) => (100 * Math.abs(s)) / kLimitS).sort((a, b) => a - b);
  const p95 = off[Math.ceil(0.95 * off.length) - 1];
  console.log(`\nfrom the first model on, ${late.length} loads end within ${p95.toFixed(1)} % (p95) of their ${kLimitS} s, the latest ${Math.max(...late).toFixed(2)} s behind them`);
}
console.log(`screenshots in ${pictures}`);
await browser.close();
link.close();
await server.close();
