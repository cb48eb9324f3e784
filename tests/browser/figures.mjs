// The figures of the browser client, measured here and printed as a table. Sections by name: first proxies ssim deadline compose start
// blocked viewer shots; all without one. Wants TEXMESH_DATA, the folder with the real scans, and keeps what it compiles of them in
// TEXMESH_FIGURE_PACKAGES. The machine should have nothing else to do.
import {execFileSync} from 'node:child_process';
import {check, env, fs, lab, labPage, labRoots, launch, listen, path, pictures, run, serve, waitedFor} from './browser.mjs';
import {startLink} from './link.mjs';

const kScans = {sea_turtle: 'sea_turtle/sea_turtle.glb', marble_bust_4k: 'marble_bust_4k/marble_bust_01_4k.obj', yurt: 'yurt/yurt.glb'};
const kProxyScans = {sea_turtle: kScans.sea_turtle, saxophone: 'saxophone/saxophone.glb', realitycapture_site: 'realitycapture_site/site.glb', yurt: kScans.yurt};
const kLink = {bytesPerSecond: 250000, rttMs: 40};
const figures = process.env.TEXMESH_FIGURE_PACKAGES ?? path.join(env.work, 'figures');
fs.mkdirSync(figures, {recursive: true});
const sections = process.argv.slice(2);
const wants = (name) => sections.length === 0 || sections.includes(name);
const rows = [];
const row = (what, value, wanted, good) => {
  rows.push([what, value, wanted, good ? 'yes' : 'NO']);
  console.log(`${what.padEnd(64)} ${String(value).padStart(16)}   ${String(wanted).padStart(12)}   ${good ? 'yes' : 'NO'}`);
};

/** Compiles the scan's package if there is none. */
function makePackage(name) {
  const file = path.join(figures, `${name}.texmesh`);
  if (fs.existsSync(file)) return;
  const scan = {...kScans, ...kProxyScans}[name];
  check(env.data !== '' && scan, `no package ${name}, and TEXMESH_DATA names no folder with its scan`);
  run(env.texmesh, 'compile', path.join(env.data, scan), '-o', file, '--quiet');
}

/** The plain GLB, in a folder with packages of its own: sharp and Draco's encoder are large. */
function plainGlb() {
  const file = path.join(figures, 'sea_turtle-plain.glb');
  if (fs.existsSync(file)) return file;
  const folder = path.join(env.work, 'plain-glb');
  fs.cpSync(path.join(path.dirname(new URL(import.meta.url).pathname), 'figures'), folder, {recursive: true});
  execFileSync('npm', ['ci', '--no-audit', '--no-fund', '--loglevel=error'], {cwd: folder, stdio: 'inherit'});
  execFileSync('node', ['plain_glb.mjs', path.join(env.data, kScans.sea_turtle), file], {cwd: folder, stdio: 'inherit'});
  return file;
}

const browser = await launch();
const roots = {'/figures/': figures, ...(env.data ? {'/data/': env.data} : {}), ...labRoots};
const server = await serve(roots);
const link = await startLink({target: server.port});

/** A page behind the link, with decoders, whose camera sees the package's object; the link is slow from then on. */
async function readyPage(name, {size = 512, slow = kLink, warm = true, background = 0x808080} = {}) {
  makePackage(name);
  await link.set({bytesPerSecond: 1e12, rttMs: 0, changes: 0});
  const page = await labPage(browser, link.url);
  await lab(page, async ([u, options, load]) => {
    await window.lab.draco.preload().decoderPending;
    const pkg = await window.lab.open(u);
    const {boundsMin: min, boundsMax: max} = pkg.manifest;
    pkg.dispose();
    window.lab.start({min, max, ...options});
    window.lab.draw();
    window.lab.pixels(); // the first time takes longer
    // Parts of the library that load when they are first needed belong to the page, as decoders do.
    if (load) {
      const id = window.lab.load(u, {load: {time: 0.5, autoRefine: false}});
      await window.lab.finished(id);
      window.lab.dispose(id);
    }
  }, [`${link.url}/figures/${name}.texmesh`, {size, background}, warm]);
  await page.waitForTimeout(300);
  await link.set(slow);
  return page;
}
const load = (page, name, options) => lab(page, ([u, o]) => window.lab.load(u, o), [`${link.url}/figures/${name}.texmesh`, options]);
const finished = (page, id) => lab(page, (i) => window.lab.finished(i), id);

async function firstPictures() {
  for (const name of Object.keys(kScans)) {
    const page = await readyPage(name);
    const id = await load(page, name, {load: {time: 4, autoRefine: false}});
    const r = await finished(page, id);
    const shown = r.events.find((e) => e.name === 'first-picture');
    const {roundTrips, bytes} = waitedFor(r.requests, shown.at);
    row(`first picture, ${name}: round trips`, roundTrips, '<= 2', roundTrips <= 2);
    row(`first picture, ${name}: package bytes`, Math.round(bytes), '<= 60 000', bytes <= 60000);
    row(`first picture, ${name}: seconds at 2 Mbit/s, 40 ms`, shown.at.toFixed(2), '', true);
    await page.close();
  }
}

/** The picture that a load showed at a time, a PNG; nothing before the first one. */
const pictureAt = (page, id, at) => lab(page, ([i, seconds]) => {
  const frame = window.lab.loads[i].frames.filter((f) => f.at <= seconds).at(-1);
  if (!frame) return null;
  const side = Math.sqrt(frame.data.length / 4);
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = side;
  canvas.getContext('2d').putImageData(new ImageData(new Uint8ClampedArray(frame.data), side, side), 0, 0);
  return canvas.toDataURL('image/png').split(',')[1];
}, [id, at]);

/** The first picture of packages with proxies, and what was shown when. TEXMESH_FIGURE_PROXIES names others, by commas. */
async function proxiesFirst() {
  for (const name of process.env.TEXMESH_FIGURE_PROXIES?.split(',') ?? Object.keys(kProxyScans)) {
    const page = await readyPage(name, {background: 0xffffff});
    const id = await load(page, name, {frames: 1, load: {time: 4, autoRefine: false}});
    const r = await finished(page, id);
    const shown = r.events.find((e) => e.name === 'first-picture');
    const {roundTrips, bytes} = waitedFor(r.requests, shown.at);
    const {px, flip} = await lab(page, (i) => {
      const {proxies, proxySizesPx} = window.lab.loads[i].pkg.manifest;
      return {px: proxySizesPx?.at(-1), flip: proxies?.[0]?.flip.at(-1)};
    }, id);
    row(`proxy first, ${name}: round trips`, roundTrips, '<= 1', roundTrips <= 1 && shown.proxy === 0);
    row(`proxy first, ${name}: package bytes`, Math.round(bytes), '<= 45 056', bytes <= 45056);
    row(`proxy first, ${name}: seconds at 2 Mbit/s, 40 ms`, shown.at.toFixed(2), '', true);
    row(`proxy first, ${name}: lit FLIP beside S_0 at ${px} px`, flip?.toFixed(3), '', true);
    for (const {proxy, at} of r.events.filter((e) => e.name === 'proxy' && e.proxy > 0)) row(`proxy first, ${name}: seconds to proxy ${proxy}`, at.toFixed(2), '', true);
    const {proxy: enough, displayedPx} = r.state;
    if (enough >= 0) row(`proxy first, ${name}: shown at the end, for ${displayedPx.toFixed(0)} px`, `proxy ${enough}`, '', true);
    const scale = r.events.find((e) => e.name === 'scale');
    if (scale) row(`proxy first, ${name}: seconds to S_${scale.scale} in its place`, scale.at.toFixed(2), '', true);
    for (const at of [0.1, 0.3, 0.5, 1, 2, 4]) {
      const picture = await pictureAt(page, id, at);
      if (picture) fs.writeFileSync(path.join(pictures, `${name}-${at}s.png`), Buffer.from(picture, 'base64'));
    }
    await page.close();
  }
}

async function timeToQuality() {
  const plain = path.basename(plainGlb());
  const page = await readyPage('sea_turtle', {slow: {bytesPerSecond: 1e12, rttMs: 0}});
  const source = await lab(page, (u) => window.lab.loadGlb(u), `${link.url}/data/${kScans.sea_turtle}`);
  await lab(page, async (i) => { await window.lab.loads[i].promise; window.lab.keepReference(); window.lab.clear(i); }, source);
  await link.set(kLink);
  const glb = await lab(page, (u) => window.lab.loadGlb(u, {frames: 1}), `${link.url}/figures/${plain}`);
  await lab(page, (i) => window.lab.loads[i].promise, glb);
  const [[plainS, plainSsim]] = await lab(page, (i) => window.lab.qualityOverTime(i), glb);
  await lab(page, (i) => window.lab.clear(i), glb);
  console.log(`turtle, 512 px, 2 Mbit/s, 40 ms: plain GLB (Draco, WebP) ${plainS.toFixed(2)} s, SSIM ${plainSsim.toFixed(4)} against the source`);
  // As the display asks for, and with the scale of a display of twice the pixels, which errs by half a pixel, not by one.
  let finer;
  for (const twice of [false, true]) {
    await link.set(kLink);
    const id = await load(page, 'sea_turtle', {frames: 60, load: {time: 4, ...(twice ? {scale: finer} : {})}});
    const r = await finished(page, id);
    finer = await lab(page, ([i, px]) => window.lab.loads[i].pkg.manifest.steps.find((s) => 2 * px <= s.upToPx).scale, [id, r.state.displayedPx]);
    const curve = await lab(page, (i) => window.lab.qualityOverTime(i), id);
    console.log(`  S_${r.state.scale} for ${r.state.displayedPx.toFixed(0)} px: ${curve.map(([s, q]) => `${s.toFixed(2)} s ${q.toFixed(3)}`).join(', ')}`);
    const reached = curve.find(([, q]) => q >= 0.95)?.[0] ?? Infinity;
    const what = `time to SSIM 0.95, turtle${twice ? ', scale for twice the px' : ''}`;
    row(`${what}: seconds`, reached.toFixed(2), '', true);
    row(`${what}: of the plain GLB's time`, (reached / plainS).toFixed(2), '<= 0.25', reached <= 0.25 * plainS);
    await lab(page, (i) => window.lab.dispose(i), id);
  }
  await page.close();
}

/** For a display of 1000 px, which can show more than comes in the time: who has everything is ready before. */
async function deadlines() {
  const limit = 4;
  const [off, early] = [[], []];
  const loads = Number(process.env.TEXMESH_FIGURE_LOADS ?? 20);
  const page = await readyPage('sea_turtle');
  for (let seed = 1; seed <= loads; seed++) {
    await link.set({...kLink, changes: 0.5, seed});
    const id = await load(page, 'sea_turtle', {load: {time: limit, display: 1000, autoRefine: false}});
    const {events} = await finished(page, id);
    const d = events.find((e) => e.name === 'deadline');
    // A proxy that looks better than all that scales could show until the limit ends the timed part.
    (events.some((e) => e.name === 'decision') ? off : early).push(d ? d.actual / limit - 1 : Infinity);
    await lab(page, (i) => window.lab.dispose(i), id);
    await page.waitForTimeout(100);
  }
  const percent = (all) => all.map((d) => (100 * d).toFixed(1)).join(' ');
  console.log(`deviations, %: ${percent(off)}; ended by a proxy: ${percent(early)}`);
  const sorted = off.map(Math.abs).sort((a, b) => a - b);
  const p95 = sorted[Math.min(sorted.length - 1, Math.ceil(0.95 * sorted.length) - 1)] ?? Infinity;
  const latest = Math.max(...off, ...early);
  row(`deadline 4 s, +-50 % changes, ${off.length} of ${loads} loads: p95 deviation, %`, (100 * p95).toFixed(1), '<= 1.5', p95 <= 0.015);
  row('deadline: latest of all, %', (100 * latest).toFixed(1), '<= 5', latest <= 0.05);
  await page.close();
}

/** The image that a GLB holds first, as a file of its own. */
function firstImage(glb, out) {
  const bytes = fs.readFileSync(glb);
  const jsonBytes = bytes.readUInt32LE(12);
  const json = JSON.parse(bytes.subarray(20, 20 + jsonBytes).toString());
  const view = json.bufferViews[json.images[0].bufferView];
  const at = 20 + jsonBytes + 8 + (view.byteOffset ?? 0);
  fs.writeFileSync(out, bytes.subarray(at, at + view.byteLength));
}

/** All fragments of a 4096 px texture from memory into the GPU, against one JPEG of the whole; the best of some runs each. */
async function composing() {
  firstImage(path.join(env.data, kScans.yurt), path.join(figures, 'yurt.jpg'));
  const page = await readyPage('yurt', {slow: {bytesPerSecond: 1e12, rttMs: 0}});
  const [own, whole] = [[], []];
  let fragments = 0;
  for (let i = 0; i < 5; i++) {
    const id = await load(page, 'yurt', {memory: true, still: true, load: {time: 1e9, scale: 20, rung: 8, fullSize: true, autoRefine: false}});
    const r = await finished(page, id);
    check(!r.error, JSON.stringify(r.error));
    const fetched = r.events.find((e) => e.name === 'progress' && e.phase === 'textures');
    fragments = r.events.filter((e) => e.name === 'fragment').length;
    own.push((r.endedAt - fetched.at) * 1000);
    await lab(page, (n) => window.lab.dispose(n), id);
    whole.push(await lab(page, (u) => window.lab.wholeJpeg(u), `${link.url}/figures/yurt.jpg`));
  }
  console.log(`compose ${fragments} fragments, ms: ${own.map((v) => v.toFixed(0)).join(' ')}; whole JPEG: ${whole.map((v) => v.toFixed(0)).join(' ')}`);
  const ratio = Math.min(...own) / Math.min(...whole);
  row(`${fragments} fragments of 4096 px over one whole JPEG`, ratio.toFixed(2), '<= 0.4', ratio <= 0.4);
  await page.close();
}

/** Compiling and running a script's top level, as the trace names it. What is called later has names of its own. */
const kScripts = /^(EvaluateScript|v8\.compile|v8\.compileModule|v8\.evaluateModule|V8\.CompileModule)$/;

/** Ms that a page's scripts take of the main thread for parsing and starting, in a browser that has never seen them: on the processor, by the clock. */
async function startOf(url) {
  const context = await browser.newContext();
  const page = await context.newPage();
  const session = await browser.newBrowserCDPSession();
  const events = [];
  session.on('Tracing.dataCollected', ({value}) => events.push(...value));
  await session.send('Tracing.start', {traceConfig: {includedCategories: ['devtools.timeline', 'v8', 'disabled-by-default-v8.compile', 'blink.user_timing', '__metadata']}, transferMode: 'ReportEvents'});
  await page.goto(url, {waitUntil: 'networkidle'});
  await page.waitForTimeout(300);
  await page.evaluate(() => performance.mark('here'));
  const complete = new Promise((go) => session.once('Tracing.tracingComplete', go));
  await session.send('Tracing.end');
  await complete;
  await context.close();
  const {pid, tid} = events.find((e) => e.name === 'here');
  const own = events.filter((e) => e.ph === 'X' && e.pid === pid && e.tid === tid && kScripts.test(e.name)).sort((a, b) => a.ts - b.ts || b.dur - a.dur);
  let [until, cpu, clock] = [0, 0, 0];
  for (const {ts, dur, tdur} of own) {
    if (ts < until) continue; // inside another
    cpu += tdur / 1000;
    clock += dur / 1000;
    until = ts + dur;
  }
  return {cpu, clock};
}
/** Scripts alone: the pages name no package. */
async function starting() {
  const folder = path.join(env.work, 'start');
  fs.mkdirSync(folder, {recursive: true});
  const pages = {
    'three.js alone': '<script type="module">import * as three from "three"; import "three/addons/loaders/GLTFLoader.js"; import "three/addons/loaders/DRACOLoader.js"; window.three = three;</script>',
    'texmesh/open beside three.js': '<script type="module">import * as three from "three"; import "three/addons/loaders/GLTFLoader.js"; import "three/addons/loaders/DRACOLoader.js"; import {open} from "/texmesh/open.js"; Object.assign(window, {three, open});</script>',
    'the element': '<script type="module" src="/texmesh/viewer/texmesh-viewer.js"></script><texmesh-viewer alt="none"></texmesh-viewer>',
  };
  const imports = '<script type="importmap">{"imports": {"three": "/three/build/three.module.js", "three/addons/": "/three/examples/jsm/"}}</script>';
  Object.values(pages).forEach((script, i) => fs.writeFileSync(path.join(folder, `${i}.html`), `<!doctype html><html lang="en"><title>start</title><link rel="icon" href="data:,">${imports}${script}</html>`));
  const own = await serve({'/start/': folder, '/viewer/': env.viewer, ...labRoots}, {gzip: true});
  const loads = 5;
  for (const [name, address] of [...Object.keys(pages).map((n, i) => [n, `start/${i}.html`]), ['the viewer', 'viewer/index.html']]) {
    const all = [];
    for (let i = 0; i < loads; i++) all.push(await startOf(`${own.url}/${address}`));
    const median = (of) => all.map(of).sort((a, b) => a - b)[loads >> 1];
    const [cpu, clock] = [median((t) => t.cpu), median((t) => t.clock)];
    console.log(`${name}: ${all.map((t) => `${t.cpu.toFixed(1)} (${t.clock.toFixed(1)})`).join(' ')}`);
    row(`parse and start, ${name}: main thread, median of ${loads}, ms (by the clock)`, `${cpu.toFixed(1)} (${clock.toFixed(1)})`, '<= 60', cpu <= 60);
  }
  await own.close();
}

async function blocked() {
  for (const name of Object.keys(kScans)) {
    const page = await readyPage(name, {warm: false});
    const id = await load(page, name, {load: {time: 4}});
    const r = await finished(page, id);
    await page.waitForTimeout(500);
    const most = Math.max(0, ...r.longTasks.map((t) => t.ms));
    row(`main thread, ${name}: longest task, ms`, most.toFixed(0), '<= 50', most <= 50);
    if (most > 50) console.log('  ', r.longTasks.map((t) => `${t.start.toFixed(2)} s: ${t.ms.toFixed(0)} ms`).join(', '));
    await page.close();
  }
}

/** What the page shows as time goes by: [{at, jpeg}], seconds of performance.timeOrigin's clock. A screenshot would wait for the GPU. */
async function screencast(page) {
  const session = await page.context().newCDPSession(page);
  const frames = [];
  session.on('Page.screencastFrame', ({data, metadata, sessionId}) => {
    frames.push({at: metadata.timestamp, jpeg: data});
    session.send('Page.screencastFrameAck', {sessionId}).catch(() => {});
  });
  await session.send('Page.startScreencast', {format: 'jpeg', quality: 92, everyNthFrame: 1});
  return {frames, stop: () => session.send('Page.stopScreencast')};
}

/** The viewer on the slow link, page and decoders in the browser's cache. */
async function viewerPage(slow, size = {width: 1280, height: 800}) {
  for (const name of ['yurt', 'sea_turtle']) makePackage(name);
  await slow.set({bytesPerSecond: 1e12, rttMs: 0, changes: 0});
  const page = await browser.newPage({viewport: size});
  listen(page);
  await page.goto(`${slow.url}/index.html?pkg=packages/yurt.texmesh&time=1`);
  await page.waitForFunction(() => Number.isFinite(window.texmeshViewer?.session.live.doneS), null, {timeout: 30000});
  await slow.set(kLink);
  return page;
}
const loadTurtle = async (page, slow) => {
  await page.goto(`${slow.url}/index.html?pkg=packages/sea_turtle.texmesh&time=4`, {waitUntil: 'commit'});
  await page.waitForFunction(() => window.texmeshViewer?.session.live.startedAt > 0);
};
/** The viewer with the turtle at 0.2, 1 and 4 s on the slow link. */
async function shots() {
  const viewer = await serve({'/packages/': figures, '/': env.viewer});
  const slow = await startLink({target: viewer.port});
  const page = await viewerPage(slow, {width: 960, height: 600});
  const cast = await screencast(page);
  await loadTurtle(page, slow);
  await page.waitForFunction(() => Number.isFinite(window.texmeshViewer.session.live.doneS), null, {timeout: 30000});
  await page.waitForTimeout(3000);
  await cast.stop();
  const started = await page.evaluate(() => (performance.timeOrigin + window.texmeshViewer.session.live.startedAt) / 1000);
  for (const at of [0.2, 1, 4.1, 7]) {
    const shown = cast.frames.filter((f) => f.at <= started + at).at(-1);
    if (!shown) continue;
    fs.writeFileSync(path.join(pictures, `turtle-${at}s.jpg`), Buffer.from(shown.jpeg, 'base64'));
    console.log(`at ${at} s the page showed what it drew at ${(shown.at - started).toFixed(2)} s`);
  }
  await page.close();
  slow.close();
  await viewer.close();
}

/**
 * Calls that wait for the browser's GPU process, which without a graphics card is 40 to 120 ms in drawing a frame of the page; and the
 * browser's end of the page before, a second after it.
 */
const kWaits = /LayerTreeHost::~|WaitForCmd|WaitForGetOffset|WaitForToken|CreateViewCommandBuffer|SharedContextRateLimiter|CommandBufferHelper::Finish/;

/** Tasks of a page's main thread from a mark of performance.mark on: ms since then, in all, on the processor and waiting. */
function tasksSince(events, mark) {
  const begun = events.find((e) => e.name === mark);
  const own = events.filter((e) => e.ph === 'X' && e.pid === begun.pid && e.tid === begun.tid && e.ts + e.dur > begun.ts).sort((a, b) => a.ts - b.ts || b.dur - a.dur);
  const tasks = [];
  let waited = 0;
  for (const e of own) {
    const end = e.ts + e.dur;
    const inside = tasks.at(-1);
    if (/RunTask$/.test(e.name) && !(inside && end <= inside.end)) tasks.push({at: (e.ts - begun.ts) / 1000, ms: e.dur / 1000, cpu: (e.tdur ?? NaN) / 1000, waits: 0, end});
    else if (kWaits.test(e.name) && inside && end <= inside.end && e.ts >= waited) {
      inside.waits += e.dur / 1000;
      waited = end;
    }
  }
  return tasks;
}

/** The longest task of the viewer from the load's start on, and without what this machine's GPU, which is its processor, makes it wait. */
async function viewerTasks() {
  const viewer = await serve({'/packages/': figures, '/': env.viewer});
  const slow = await startLink({target: viewer.port});
  const [whole, own] = [[], []];
  const loads = 5;
  const page = await viewerPage(slow);
  const session = await browser.newBrowserCDPSession();
  for (let i = 0; i < loads; i++) {
    const events = [];
    session.on('Tracing.dataCollected', ({value}) => events.push(...value));
    await session.send('Tracing.start', {traceConfig: {includedCategories: ['toplevel', 'cc', 'gpu', 'blink.user_timing']}, transferMode: 'ReportEvents'});
    await loadTurtle(page, slow);
    await page.waitForFunction(() => Number.isFinite(window.texmeshViewer.session.live.doneS), null, {timeout: 30000});
    await page.waitForTimeout(500);
    // A mark may be set for a time that has passed.
    await page.evaluate(() => performance.mark('load begun', {startTime: window.texmeshViewer.session.live.startedAt}));
    const complete = new Promise((go) => session.once('Tracing.tracingComplete', go));
    await session.send('Tracing.end');
    await complete;
    session.removeAllListeners('Tracing.dataCollected');
    const tasks = tasksSince(events, 'load begun');
    whole.push(Math.max(...tasks.map((t) => t.ms)));
    own.push(Math.max(...tasks.map((t) => t.ms - t.waits)));
    for (const t of tasks.filter((x) => x.ms > 50)) console.log(`  load ${i}, ${(t.at / 1000).toFixed(2)} s: ${t.ms.toFixed(0)} ms, of which ${t.waits.toFixed(0)} of waiting, ${t.cpu.toFixed(0)} of the processor`);
  }
  console.log(`viewer, longest tasks of ${loads} loads, ms: ${whole.map((v) => v.toFixed(0)).join(' ')}; without waiting: ${own.map((v) => v.toFixed(0)).join(' ')}`);
  row(`viewer, turtle, ${loads} loads: longest task of its own, ms`, Math.max(...own).toFixed(0), '<= 50', Math.max(...own) <= 50);
  row('viewer: longest task with waits for the GPU process, median, ms', whole.sort((a, b) => a - b)[loads >> 1].toFixed(0), '', true);
  await page.close();
  slow.close();
  await viewer.close();
}

try {
  for (const [name, body] of Object.entries({first: firstPictures, proxies: proxiesFirst, ssim: timeToQuality, deadline: deadlines, compose: composing, start: starting, blocked, viewer: viewerTasks, shots}))
    if (wants(name)) await body();
} finally {
  await browser.close();
  link.close();
  await server.close();
}
process.exit(rows.every((r) => r[3] === 'yes') ? 0 : 1);
