// What the client does not do: too much at once, the same again and again, ask elsewhere, need what a page may lack.
import {check, common, lab, labPage, labRoots, serve} from './browser.mjs';
import {test} from './harness.mjs';
import {comparePlane, kEverything, kTopQuality, loaded, rightFrom, throttled} from './loads.mjs';

const first = (q) => Number(/^bytes=(\d+)-/.exec(q.range ?? '')?.[1] ?? -1);
const errorsOf = (r) => r.events.filter((e) => e.name === 'error').map((e) => e.message);

/** Runs in the page before the library: counts images that workers are asked for at once, and pictures that nobody has closed. */
function counting() {
  window.counted = {now: 0, most: 0, asked: 0, open: new Set()};
  const {counted} = window;
  const own = (pictures) => { for (const p of pictures) if (p instanceof ImageBitmap) counted.open.add(p); };
  // Hears of answers before the library does, which then asks for the next.
  window.Worker = class extends Worker {
    asked = new Set();
    constructor(...all) {
      super(...all);
      this.addEventListener('message', ({data}) => {
        if (this.asked.delete(data?.id)) counted.now--;
        if (Array.isArray(data?.result)) own(data.result);
      });
    }
    postMessage(message, ...rest) {
      if (['decode', 'enlarge'].includes(message?.op)) {
        this.asked.add(message.id);
        counted.asked++;
        counted.most = Math.max(counted.most, ++counted.now);
      }
      super.postMessage(message, ...rest);
    }
  };
  const make = window.createImageBitmap;
  window.createImageBitmap = async (...all) => { const p = await make(...all); own([p]); return p; };
  const close = ImageBitmap.prototype.close;
  ImageBitmap.prototype.close = function () { counted.open.delete(this); close.call(this); };
}

test('at most eight images are decoded and six requests made at once; every picture is closed', async () => {
  const b = await common();
  const server = await serve(labRoots, {fault: (q) => (q.path.endsWith('.texmesh') ? {delay: 30} : undefined)});
  const page = await labPage(b.browser, server.url, counting);
  try {
    await lab(page, () => window.lab.start({size: 256}));
    const ids = [];
    for (const name of ['large', 'maps']) {
      const r = await loaded(null, page, `${server.url}/packages/${name}.texmesh`, {load: {...kEverything, workers: 6}});
      check(!r.error, JSON.stringify(r.error));
      ids.push(r.id);
      const asked = r.requests.filter((q) => q.url.endsWith('.texmesh'));
      const atOnce = Math.max(...asked.map((q) => asked.filter((o) => o.started <= q.started && o.ended > q.started).length));
      check(atOnce <= 6 && (name !== 'large' || atOnce >= 3), `${name}: ${atOnce} requests at once`);
    }
    const {most, asked} = await lab(page, () => window.counted);
    check(most <= 8 && most >= 3 && asked > 20, `${most} of ${asked} images at once`);
    for (const id of ids) await lab(page, (i) => window.lab.dispose(i), id);
    await page.waitForTimeout(200);
    const open = await lab(page, () => [...window.counted.open].map((p) => `${p.width} x ${p.height}`));
    check(open.length === 0, `pictures that nobody closed: ${open}`);
  } finally {
    await page.close();
    await server.close();
  }
}, {seconds: 90});

test('at most eight images are decoded at once by three loads of a page', async () => {
  const b = await common();
  const page = await labPage(b.browser, b.url, counting);
  await lab(page, () => window.lab.start({size: 256}));
  const ids = await lab(page, ([u, o]) => [0, 1, 2].map(() => window.lab.load(u, {load: o})), [`${b.url}/packages/large.texmesh`, kEverything]);
  const rungs = [];
  for (const id of ids) {
    const r = await lab(page, (i) => window.lab.finished(i), id);
    check(!r.error, JSON.stringify(r.error));
    rungs.push(r.state.planes.map((p) => p.rungs.join()).join(';'));
  }
  check(new Set(rungs).size === 1 && /[1-9]/.test(rungs[0]), `not all have all: ${rungs.join('\n')}`);
  const {most, now, asked} = await lab(page, () => window.counted);
  check(most <= 8 && most >= 6 && now === 0 && asked > 60, `${most} of ${asked} images at once, ${now} left`);
  await page.close();
}, {seconds: 90});

test('meshes of meshopt', async () => {
  const b = await common();
  const r = await rightFrom(b, b.url, 'meshopt.texmesh', {options: {load: {...kEverything, meshes: 'glb'}}});
  const d = await lab(r.page, ([i, u]) => window.lab.compareMesh(i, u), [r.id, `${b.url}/packages/meshopt/mesh/s00.glb`]);
  check(d.unmatched === 0 && d.triangles[0] > 1000, JSON.stringify(d));
  await r.page.close();
});

test('a page whose policy forbids workers: with `decode` it works, without it says so and fetches nothing for it', async () => {
  const b = await common();
  const server = await serve(labRoots, {policy: "worker-src 'none'"});
  try {
    const r = await rightFrom({browser: b.browser}, server.url, 'meshopt.texmesh', {options: {here: true, load: kEverything}});
    check(r.page.workers().length === 0, `${r.page.workers().length} workers`);
    await r.page.close();
    const without = await loaded({browser: b.browser, url: server.url}, null, `${server.url}/packages/meshopt.texmesh`, {load: {time: 3, autoRefine: false}});
    check(errorsOf(without).length === 1 && /texmesh\/worker/.test(errorsOf(without)[0]), JSON.stringify(errorsOf(without)));
    check(without.state.scale >= 0 && !without.requests.some((q) => q.kind === 'texture'), 'fragments were fetched for nothing');
    await without.page.close();
  } finally { await server.close(); }
}, {seconds: 90});

test('plain http: digests without WebCrypto', async () => {
  const b = await common();
  const server = await serve(labRoots);
  const origin = `http://plain.test:${server.port}`;
  try {
    const r = await rightFrom({browser: b.browser}, origin, 'maps.texmesh');
    check(await lab(r.page, () => !window.isSecureContext && window.crypto.subtle === undefined), 'the page has WebCrypto');
    await r.page.close();
    // In the first range behind the manifest, and wherever the client asks again.
    server.setFault((q) => (q.path.endsWith('.texmesh') ? {flip: first(q) > 0 ? 5 : 9000} : undefined));
    const bad = await loaded({browser: b.browser, url: origin}, null, `${origin}/packages/maps.texmesh`, {load: kEverything});
    check(bad.error?.name === 'FormatError', JSON.stringify(bad.error));
    await bad.page.close();
  } finally { await server.close(); }
}, {seconds: 90});

test('two loads from one package', async () => {
  const b = await common();
  const server = await serve(labRoots);
  try {
    const r = await rightFrom({browser: b.browser}, server.url, 'maps.texmesh');
    const asked = server.requests.length;
    const second = await lab(r.page, async (i) => {
      const {lab} = window;
      const model = lab.loads[i].pkg.load(lab.stage().scene, {
        renderer: lab.stage().renderer, gltfLoader: lab.gltfLoader, time: 1e9, scale: 0, rung: 99, fullSize: true, autoRefine: false,
      });
      lab.loads.push({...lab.loads[i], model});
      await model.done;
      lab.loads[i].model.dispose();
      lab.draw();
      return lab.loads.length - 1;
    }, r.id);
    const d = await comparePlane(r.page, second, 0, 'maps', kTopQuality);
    check(d.most <= 3, `texture differs by ${d.most}`);
    check(await lab(r.page, () => window.lab.stage().scene.children.filter((o) => o.isGroup).length) === 1, 'the first load is still there');
    const again = server.requests.slice(asked).filter((q) => q.path.endsWith('.texmesh'));
    check(!again.some((q) => first(q) === 0), 'the manifest was asked for again');
    check(r.page.said.length === 0, r.page.said.join('\n'));
    await r.page.close();
  } finally { await server.close(); }
}, {seconds: 60});

test('what has failed is not asked for again and again', async () => {
  const b = await common();
  const starts = []; // of ranges, in the order in which they are asked for: the first is missing, and every third from there
  const missing = (q) => {
    if (!q.path.endsWith('large.texmesh') || first(q) <= 200000) return false;
    if (!starts.includes(first(q))) starts.push(first(q));
    return starts.indexOf(first(q)) % 3 === 0;
  };
  const server = await serve(labRoots, {fault: (q) => (missing(q) ? {status: 404} : undefined)});
  try {
    const r = await loaded({browser: b.browser, url: server.url}, null, `${server.url}/packages/large.texmesh`, {load: {time: 4, scale: 19, meshes: 'glb', display: 1500, autoRefine: false}});
    check(!r.error, JSON.stringify(r.error));
    const lost = server.requests.filter((q) => q.status === 404);
    const times = new Map();
    for (const q of lost) times.set(q.range, (times.get(q.range) ?? 0) + 1);
    check(lost.length > 0, 'nothing was lost');
    check(Math.max(...times.values()) <= 2 && lost.length <= 80, `${lost.length} requests of ${times.size} ranges`);
    await r.page.close();
  } finally { await server.close(); }
}, {seconds: 60});

test('a scale that was not there for a moment comes later, whoever looks', async () => {
  const b = await common();
  let asked = 0;
  const server = await serve(labRoots, {ranges: false, fault: (q) => (q.path.endsWith('mesh/s00.glb') && asked++ < 1 ? {status: 404} : undefined)});
  try {
    const r = await loaded({browser: b.browser, url: server.url}, null, `${server.url}/packages/maps.texmesh`, {load: {time: 1, scale: 0, meshes: 'glb'}});
    check(r.state.scale > 0, `S_${r.state.scale}`);
    await r.page.waitForFunction((i) => window.lab.loads[i].model.state.scale === 0, r.id, {timeout: 8000});
    check(asked === 2, `asked for ${asked} times`);
    await r.page.close();
  } finally { await server.close(); }
}, {seconds: 60});

test('who hears that all is done may ask for more', async () => {
  const b = await common();
  const r = await loaded(b, null, `${b.url}/packages/maps.texmesh`, {load: {time: 3, rung: 0}});
  const told = await lab(r.page, (i) => new Promise((end) => {
    const {model} = window.lab.loads[i];
    let n = 0;
    model.on('done', () => {
      if (++n > 1) return;
      model.setOverride({rung: 2});
      model.refine().then(() => end({n, rungs: model.state.planes.map((p) => Math.min(...p.rungs.filter((k) => k >= 0)))}));
    });
    model.refine();
  }), r.id);
  check(told.rungs.length > 0 && told.rungs.every((k) => k === 2), JSON.stringify(told));
  // Lower than what is there, too; asked for once.
  const bytes = () => lab(r.page, (i) => window.lab.loads[i].model.state.bytes, r.id);
  await lab(r.page, (i) => { window.lab.loads[i].model.setOverride({rung: 0}); return window.lab.loads[i].model.refine(); }, r.id);
  const lower = await lab(r.page, (i) => window.lab.loads[i].model.state.planes.flatMap((p) => [...p.rungs]), r.id);
  check(Math.max(...lower) === 0, `rungs ${lower}`);
  const before = await bytes();
  await lab(r.page, (i) => window.lab.loads[i].model.refine(), r.id);
  check(await bytes() === before, `${await bytes() - before} bytes more`);
  await r.page.close();
}, {seconds: 60});

test('changes of mind fetch a mesh once', () => throttled({bytesPerSecond: 60000}, async (page, link, url) => {
  await link.set({bytesPerSecond: 1e12, rttMs: 0});
  const id = await lab(page, (u) => window.lab.load(u, {load: {time: 2, scale: 19, meshes: 'glb', rung: 0, autoRefine: false}}), url);
  await lab(page, (i) => window.lab.finished(i), id);
  const before = (await lab(page, (i) => window.lab.report(i), id)).requests.length;
  await link.set({bytesPerSecond: 60000, rttMs: 40});
  for (const scale of [0, 19, 0, 19, 0]) {
    await lab(page, ([i, s]) => window.lab.loads[i].model.setOverride({scale: s, rung: 0}), [id, scale]);
    await page.waitForTimeout(200);
  }
  await page.waitForFunction((i) => window.lab.loads[i].model.state.scale === 0, id, {timeout: 20000});
  await page.waitForTimeout(500);
  const meshes = (await lab(page, (i) => window.lab.report(i), id)).requests.slice(before).filter((q) => q.kind === 'mesh');
  check(meshes.length === 1, `${meshes.length} requests`);
}), {seconds: 60});

test('fragments of a tree come from the mirror where the first server has none, or others', async () => {
  const b = await common();
  for (const wrong of [{status: 503}, {flip: 700}]) {
    const bad = await serve(labRoots, {ranges: false, fault: (q) => (/texture\/\d+\/r\d+\//.test(q.path) ? wrong : undefined)});
    const good = await serve(labRoots, {ranges: false});
    try {
      const r = await rightFrom({browser: b.browser}, b.url.replace(/:\d+$/, `:${bad.port}`), 'files/maps.texmesh',
        {options: {open: {mirrors: [`${good.url}/packages/files/maps.texmesh`], retries: 0}, load: kEverything}});
      check(r.state.planes.every((p) => [...p.rungs].some((k) => k > 0)), JSON.stringify(r.state.planes.map((p) => p.rungs)));
      check(good.requests.some((q) => /texture\/\d+\/r\d+\//.test(q.path)), 'the mirror was not asked');
      await r.page.close();
    } finally { await Promise.all([bad.close(), good.close()]); }
  }
}, {seconds: 60});
