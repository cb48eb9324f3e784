// The client library in a real browser: what it shows is what the compiler stored, whatever the server does.
import {
  check, closeCommon, common, lab, labPage, labRoots, near, packages, path, pictures, serve, startView, waitedFor,
} from './browser.mjs';
import {runAll, test} from './harness.mjs';
import {startLink} from './link.mjs';
import {makePackages} from './make-packages.mjs';
import {nginxMissing, startNginx} from './nginx.mjs';
import {comparePlane, kEverything, kTop, kTopQuality, loaded, rightFrom, throttled} from './loads.mjs';
import {starvation} from './starved.mjs';
import './block-tests.mjs';
import './display-tests.mjs';
import './element-tests.mjs';
import './hosts-tests.mjs';
import './limits-tests.mjs';
import './materials-tests.mjs';
import './memory-tests.mjs';
import './notes-tests.mjs';
import './page-tests.mjs';
import './proxy-tests.mjs';
import './thesis-tests.mjs';
import './render-tests.mjs';
import './size-tests.mjs';
import './viewer-tests.mjs';
import './viewer-use-tests.mjs';
import './versions-tests.mjs';
import './worker-tests.mjs';

/** Of the limit, besides the time without a processor: figures.mjs measures what a quiet machine keeps. */
const kLate = 1.06;
for (const [name, form] of [['maps', 'highest'], ['maps', 'lowest'], ['progressive', 'highest'], ['webp', 'highest'], ['kept', 'highest']]) {
  test(`composed textures equal the C++ reconstruction: ${name}, ${form} rungs`, async () => {
    const b = await common();
    const rung = form === 'highest' ? kTop : 0;
    const r = await loaded(b, null, `${b.url}/packages/${name}.texmesh`, {load: {...kEverything, rung}});
    check(!r.error, JSON.stringify(r.error));
    check(r.state.planes.length > 0, 'no plane');
    for (const p of r.state.planes) {
      const d = await comparePlane(r.page, r.id, p.base, name, rung ? kTopQuality : 0);
      check(d.n > 0 && d.most <= 3 && d.mean <= 0.4, `${p.role}: differs by ${d.most} at most, ${d.mean.toFixed(3)} in the mean`);
    }
    check(r.page.said.length === 0, r.page.said.join('\n'));
    await r.page.close();
  });
}

test('a mip that is shown equals the C++ reconstruction, uploaded by fragments into one texture', async () => {
  const b = await common();
  const page = await labPage(b.browser, b.url, () => {
    window.uploads = {storage: [], images: [], parts: []};
    const wrap = (name, note) => {
      const own = WebGL2RenderingContext.prototype[name];
      WebGL2RenderingContext.prototype[name] = function (...all) { note(all); return own.apply(this, all); };
    };
    wrap('texStorage2D', ([, , , w, h]) => window.uploads.storage.push(`${w} x ${h}`));
    wrap('texImage2D', (all) => { if (all.length > 6) window.uploads.images.push(Math.max(all[3], all[4])); });
    wrap('texSubImage2D', (all) => {
      const picture = all.at(-1);
      if (all[1] === 0 && picture?.width) window.uploads.parts.push([picture.width, picture.height]);
    });
  });
  await lab(page, () => window.lab.start({size: 256}));
  const r = await loaded(null, page, `${b.url}/packages/large.texmesh`, {px: 150, load: {time: 1e9, rung: kTop, autoRefine: false}});
  check(!r.error, JSON.stringify(r.error));
  const [shown] = r.state.planes;
  check(shown.plane !== shown.base && shown.widthPx < 2048, `plane ${shown.plane} of ${shown.base}`);
  const d = await comparePlane(page, r.id, shown.base, 'large', kTopQuality);
  check(d.n > 0 && d.most <= 3, `differs by ${d.most}`);
  const {storage, images, parts} = await lab(page, () => window.uploads);
  const size = `${shown.widthPx} x ${shown.heightPx}`;
  check(storage.filter((s) => s === size).length === 1, `made: ${storage}`);
  check(!images.some((px) => px >= shown.widthPx), `whole pictures of ${images} px`);
  check(parts.length > 3 && !parts.some(([w, h]) => w >= shown.widthPx && h >= shown.heightPx), `uploads: ${JSON.stringify(parts.slice(0, 20))}`);
  await page.close();
});

for (const meshes of ['glb', 'stream'])
  test(`meshes equal the C++ scales: ${meshes}`, async () => {
    const b = await common();
    const r = await loaded(b, null, `${b.url}/packages/maps.texmesh`, {load: {time: 5, meshes, scale: 99, autoRefine: false}});
    check(!r.error, JSON.stringify(r.error));
    const scales = await lab(r.page, (i) => window.lab.loads[i].pkg.manifest.scales.map((s) => [s.scale, s.triangles, s.glb.path.endsWith('.glb')]), r.id);
    check(scales.length > 3, `${scales.length} scales`);
    // From coarse to fine, so that the stream stands at a prefix each time.
    for (const [scale] of [scales.at(-2), scales[Math.floor(scales.length / 2)], scales[0]]) {
      // Without the stream a scale that the stream alone has is the next finer file.
      const [there, triangles] = scales.filter(([s, , file]) => s === scale ? file || meshes === 'stream' : s < scale && file).at(-1);
      const shown = await lab(r.page, async ([i, s]) => {
        const {model} = window.lab.loads[i];
        model.setOverride({scale: s});
        for (let t = 0; model.state.scale !== s && t < 400; t++) await new Promise((go) => setTimeout(go, 25));
        return model.state.scale;
      }, [r.id, scale]);
      check(shown === scale, `S_${shown} instead of S_${scale}`);
      const d = await lab(r.page, ([i, u]) => window.lab.compareMesh(i, u), [r.id, `${b.url}/packages/scales/maps-s${there}.glb`]);
      check(d.triangles[0] === triangles && d.triangles[1] === triangles, `S_${scale}: ${d.triangles} triangles instead of ${triangles}`);
      check(d.unmatched === 0, `S_${scale}: ${d.unmatched} triangles are elsewhere (of ${triangles}; farthest corner ${d.farthest} of the extent)`);
    }
    if (meshes === 'stream') check((await lab(r.page, (i) => window.lab.report(i), r.id)).requests.some((q) => q.kind === 'stream'), 'no stream was read');
    await r.page.close();
  });

/** Requests under way at once when a load's package is asked for many pieces. */
async function mostAtOnce({page, id}) {
  const before = (await lab(page, (i) => window.lab.report(i), id)).requests.length;
  await lab(page, async (i) => {
    const {client} = window.lab.loads[i].pkg;
    const url = `${location.origin}/packages/maps.texmesh`;
    await Promise.all(Array.from({length: 80}, (_, k) => client.get(url, {range: {offset: 64 * k, bytes: 64}, maxBytes: 64, kind: 'other'})));
  }, id);
  const asked = (await lab(page, (i) => window.lab.report(i), id)).requests.slice(before);
  check(asked.length === 80 && asked.every((q) => q.ok), `${asked.filter((q) => q.ok).length} of ${asked.length} answers`);
  return Math.max(...asked.map((q) => asked.filter((o) => o.started <= q.started && o.ended > q.started).length));
}

test('nginx with ranges, HTTP/1.1', async ({skip}) => {
  if (nginxMissing(false)) skip(nginxMissing(false));
  const [b, nginx] = [await common(), await startNginx()];
  try {
    const r = await rightFrom(b, nginx.url, 'maps.texmesh');
    check(/GET \/packages\/maps.texmesh HTTP\/1.1" 206/.test(nginx.log()), 'no range was asked for');
    check(await mostAtOnce(r) === 6, 'another window than six connections');
    await r.page.close();
  } finally { nginx.close(); }
});

test('nginx, HTTP/2', async ({skip}) => {
  if (nginxMissing(true)) skip(nginxMissing(true));
  const [b, nginx] = [await common(), await startNginx({http2: true})];
  try {
    const r = await rightFrom(b, nginx.url, 'maps.texmesh');
    check(/GET \/packages\/maps.texmesh HTTP\/2.0" 206/.test(nginx.log()), nginx.log().slice(0, 2000));
    check(await mostAtOnce(r) === 32, 'another window than 32 streams');
    await r.page.close();
  } finally { nginx.close(); }
});

for (const [what, file, wants] of [
  ['the tree beside the package', 'maps.texmesh', /\/packages\/maps\/manifest.json/],
  ['fragment files', 'files/maps.texmesh', /\/packages\/files\/maps\/texture\/\d+\/r\d+\/\d+\.jpg/],
  ['the whole package', 'alone/maps.texmesh', /\/packages\/alone\/maps.texmesh/],
  ['a tree named by its folder', 'maps/', /\/packages\/maps\/texture/],
]) {
  test(`a server without ranges: ${what}`, async () => {
    const [b, server] = [await common(), await serve(labRoots, {ranges: false})];
    try {
      const r = await rightFrom(b, server.url, file);
      check(server.requests.some((q) => wants.test(q.path)), server.requests.map((q) => q.path).join('\n'));
      await r.page.close();
    } finally { await server.close(); }
  });
}

test('nothing is fetched twice', async () => {
  const [b, server] = [await common(), await serve(labRoots)];
  const r = await rightFrom(b, server.url, 'large.texmesh');
  const ranges = server.requests.filter((q) => q.path.endsWith('large.texmesh') && q.range)
    .map((q) => q.range.slice(6).split('-').map(Number)).sort((x, y) => x[0] - y[0]);
  let [twice, end] = [0, -1];
  for (const [first, last] of ranges) {
    twice += Math.max(0, Math.min(end, last) - first + 1);
    end = Math.max(end, last);
  }
  check(twice <= 64, `${twice} bytes came twice`);
  await r.page.close();
  await server.close();
});

test('the first picture takes one round trip', () => throttled({}, async (page, link, url) => {
  const r = await loaded(null, page, url, {load: {time: 3, autoRefine: false}});
  check(!r.error, JSON.stringify(r.error));
  const shown = r.events.find((e) => e.name === 'first-picture');
  check(shown, 'no first picture');
  const {roundTrips, bytes} = waitedFor(r.requests, shown.at);
  check(roundTrips <= 1, `${roundTrips} round trips`);
  check(bytes <= 65536, `${bytes} bytes`);
}), {timed: true});

test('a deadline is kept on a slow link', () => throttled({}, async (page, link, url) => {
  const starved = starvation();
  const r = await loaded(null, page, url, {load: {time: 4, autoRefine: false}});
  check(!r.error, JSON.stringify(r.error));
  const deadline = r.events.find((e) => e.name === 'deadline');
  check(deadline, 'no deadline');
  check(deadline.actual <= 4 * kLate + starved(), `${deadline.actual} s of 4, ${starved()} s without a processor`);
  check(deadline.actual >= 4 * 0.85, `${deadline.actual} s of 4 were used`);
}), {seconds: 90, timed: true});

test('the link changes by half, the deadline stays', () => throttled({changes: 0.5, seed: 7}, async (page, link, url) => {
  const starved = starvation();
  const r = await loaded(null, page, url, {load: {time: 4, autoRefine: false}});
  check(!r.error, JSON.stringify(r.error));
  const deadline = r.events.find((e) => e.name === 'deadline');
  check(deadline.actual <= 4 * kLate + starved(), `${deadline.actual} s of 4, ${starved()} s without a processor`);
}), {seconds: 90, timed: true});

test('the server dies in the middle: what is there stays, and the error says so', () => throttled({}, async (page, link, url) => {
  const id = await lab(page, (u) => window.lab.load(u, {open: {retries: 1, retryDelayS: 0.05, stallTimeoutS: 2}, load: {time: 20, autoRefine: false}}), url);
  await page.waitForFunction((i) => window.lab.report(i).events.some((e) => e.name === 'fragment'), id, {timeout: 30000});
  await link.die();
  const r = await lab(page, (i) => window.lab.finished(i), id);
  const said = [r.error?.message, ...r.events.filter((e) => e.name === 'error').map((e) => e.message)].filter(Boolean);
  check(said.some((m) => /127\.0\.0\.1/.test(m)), `no word of it: ${said}`);
  check(r.state.scale >= 0 && r.state.planes.some((p) => p.rungs.some((v) => v >= 0)), 'the picture is gone');
  const grey = await lab(page, () => { window.lab.draw(); const p = window.lab.pixels(); let n = 0; for (let i = 0; i < p.length; i += 4) n += Math.abs(p[i] - 128) > 8; return n; });
  check(grey > 2000, 'nothing is drawn');
}), {seconds: 90});

test('a fragment that is not there (404) costs that fragment alone', async () => {
  const b = await common();
  const server = await serve(labRoots, {ranges: false, fault: (q) => (/files\/maps\/texture\/0\/r\d+\/0003\.jpg/.test(q.path) ? {status: 404} : undefined)});
  try {
    const r = await loaded({browser: b.browser, url: server.url}, null, `${server.url}/packages/files/maps.texmesh`, {load: kEverything});
    check(!r.error, JSON.stringify(r.error));
    const plane = r.state.planes.find((p) => p.base === 0);
    const missing = plane.rungs.map((v, f) => (v < 0 ? f : -1)).filter((f) => f >= 0);
    const d = await comparePlane(r.page, r.id, 0, 'maps', kTopQuality);
    check(r.events.some((e) => e.name === 'error' && !e.fatal), 'no word of it');
    check(String(missing) === '3' && d.most > 3, `missing: ${missing}; it alone may be`);
    await r.page.close();
  } finally { await server.close(); }
});

test('corrupt bytes are fetched again', async () => {
  const b = await common();
  let spoilt = 0;
  const server = await serve(labRoots, {fault: (q) => {
    if (!q.path.endsWith('large.texmesh') || !q.range) return undefined;
    const first = Number(/bytes=(\d+)-/.exec(q.range)[1]);
    return first > 200000 && spoilt < 3 && ++spoilt ? {flip: 1234} : undefined;
  }});
  try {
    await rightFrom(b, server.url, 'large.texmesh', {options: {load: {...kEverything, scale: 19}}}).then((r) => r.page.close());
    check(spoilt === 3, 'nothing was spoilt');
  } finally { await server.close(); }
});

test('bytes that are corrupt for ever are not shown', async () => {
  const b = await common();
  const server = await serve(labRoots, {ranges: false, fault: (q) => (/files\/maps\/texture\/0\/r\d+\/0001\.jpg/.test(q.path) ? {flip: 700} : undefined)});
  try {
    const r = await loaded({browser: b.browser, url: server.url}, null, `${server.url}/packages/files/maps.texmesh`, {load: kEverything});
    check(!r.error, JSON.stringify(r.error));
    check(r.state.planes.find((p) => p.base === 0).rungs[1] < 0, 'a damaged fragment is shown');
    check(r.events.some((e) => e.name === 'error' && !e.fatal), 'no word of it');
    await r.page.close();
  } finally { await server.close(); }
});

test('a mirror takes over from a server that dies', async () => {
  const b = await common();
  const [first, second, pages] = [await serve(labRoots), await serve(labRoots), await serve(labRoots)];
  const slow = await startLink({target: first.port, bytesPerSecond: 400000, rttMs: 20});
  try {
    const page = await labPage(b.browser, pages.url);
    await lab(page, () => window.lab.start({size: 256}));
    const id = await lab(page, ([u, m]) => window.lab.load(u, {open: {mirrors: [m], retries: 2, retryDelayS: 0.05}, load: {time: 1e9, scale: 0, rung: 99, fullSize: true, autoRefine: false}}),
      [`${slow.url}/packages/large.texmesh`, `${second.url}/packages/large.texmesh`]);
    await page.waitForFunction((i) => window.lab.report(i).events.some((e) => e.name === 'fragment'), id, {timeout: 30000});
    await slow.die();
    const r = await lab(page, (i) => window.lab.finished(i), id);
    check(!r.error, JSON.stringify(r.error));
    const d = await comparePlane(page, id, 0, 'large', kTopQuality);
    check(d.most <= 3, `texture differs by ${d.most}`);
    check(second.requests.length > 0, 'the mirror was not asked');
    await page.close();
  } finally {
    slow.close();
    await Promise.all([first, second, pages].map((s) => s.close()));
  }
}, {seconds: 90});

test('twenty opens and closes leave nothing behind', async () => {
  const b = await common();
  const page = await labPage(b.browser, b.url);
  await lab(page, () => window.lab.start({size: 256}));
  const cycle = async () => {
    const id = await lab(page, ([u, o]) => window.lab.load(u, {load: o}), [`${b.url}/packages/maps.texmesh`, kEverything]);
    const r = await lab(page, (i) => window.lab.finished(i), id);
    check(!r.error, JSON.stringify(r.error));
    await lab(page, (i) => window.lab.dispose(i), id);
    return lab(page, async () => { for (let i = 0; i < 3; i++) { window.gc(); await new Promise((f) => setTimeout(f, 20)); } return window.lab.memory(); });
  };
  await cycle();
  await cycle(); // pools and compiled code have settled
  const before = await cycle();
  let after;
  for (let i = 0; i < 20; i++) after = await cycle();
  for (const what of ['geometries', 'textures', 'programs']) check(after[what] <= before[what], `${what}: ${before[what]} -> ${after[what]}`);
  check(after.heap - before.heap < 4e6, `heap: ${before.heap} -> ${after.heap}`);
  check(page.workers().length <= 12, `${page.workers().length} workers`);
  await page.close();
}, {seconds: 120});

test('cancelling ends it at once', () => throttled({bytesPerSecond: 100000}, async (page, link, url) => {
  const id = await lab(page, (u) => window.lab.load(u, {load: {time: 60}}), url);
  await page.waitForFunction((i) => window.lab.report(i).events.some((e) => e.name === 'first-picture'), id, {timeout: 30000});
  const start = Date.now();
  await lab(page, (i) => window.lab.loads[i].model.cancel(), id);
  const r = await lab(page, (i) => window.lab.finished(i), id);
  check(Date.now() - start < 1500, `${Date.now() - start} ms`);
  check(r.error?.name === 'AbortError' || r.state.phase === 'cancelled', JSON.stringify([r.error, r.state.phase]));
  const sent = await link.sent();
  await new Promise((f) => setTimeout(f, 700));
  check(await link.sent() - sent < 30000, 'bytes still flow');
}), {seconds: 60, timed: true});

test('scale and texture follow the display', async () => {
  const b = await common();
  const page = await labPage(b.browser, b.url);
  await lab(page, () => window.lab.start({size: 512, zoom: 0.2}));
  const id = await lab(page, (u) => window.lab.load(u, {load: {time: 2}}), `${b.url}/packages/large.texmesh`);
  const far = await lab(page, (i) => window.lab.finished(i), id);
  const bytes = far.state.bytes;
  // Nearer: a finer scale, finer planes.
  await lab(page, (i) => {
    const {camera, centre, radius} = window.lab.stage();
    camera.position.sub(centre).setLength(radius * 0.9).add(centre);
    camera.updateMatrixWorld();
    window.lab.loads[i].model.update(camera);
  }, id);
  await page.waitForFunction(([i, s]) => {
    window.lab.loads[i].model.update(window.lab.stage().camera);
    return window.lab.loads[i].model.state.scale < s;
  }, [id, far.state.scale], {timeout: 20000});
  await lab(page, (i) => window.lab.loads[i].model.refine(), id);
  const near_ = await lab(page, (i) => window.lab.report(i), id);
  check(near_.state.scale < far.state.scale, `S_${far.state.scale} -> S_${near_.state.scale}`);
  check(near_.state.bytes > bytes, 'nothing more was fetched');
  const [before, after] = [far, near_].map((r) => r.state.planes[0].widthPx);
  check(before < 2048 && after > before, `plane of ${before} px from afar, of ${after} px near by`);
  await page.close();
}, {seconds: 90});

test('no frame is empty while scales and textures arrive', () => throttled({bytesPerSecond: 400000}, async (page, link, url) => {
  const id = await lab(page, (u) => window.lab.load(u, {frames: 1, load: {time: 5, autoRefine: false}}), url);
  const r = await lab(page, (i) => window.lab.finished(i), id);
  check(!r.error, JSON.stringify(r.error));
  const [covered, light] = await lab(page, (i) => {
    const seen = window.lab.loads[i].frames.map((f) => {
      let [n, sum] = [0, 0];
      for (let k = 0; k < f.data.length; k += 4) {
        if (Math.abs(f.data[k] - 128) + Math.abs(f.data[k + 1] - 128) + Math.abs(f.data[k + 2] - 128) <= 12) continue;
        ++n;
        sum += 0.2126 * f.data[k] + 0.7152 * f.data[k + 1] + 0.0722 * f.data[k + 2];
      }
      return [n, sum / Math.max(n, 1)];
    });
    return [seen.map(([n]) => n), seen.map(([, mean]) => mean)];
  }, id);
  const last = covered[covered.length - 1];
  const first = covered.findIndex((n) => n > last / 2);
  check(first >= 0 && covered.length > 5, `${covered.length} frames`);
  // The coarsest scale's outline differs by a tenth.
  for (const n of covered.slice(first)) near(n, last, last * 0.15, 'covered pixels of a frame');
  // A frame without its texture would be lighter or darker.
  for (const mean of light.slice(first)) near(mean, light.at(-1), 0.03 * light.at(-1), 'mean light of a frame');
}), {seconds: 60, timed: true});

test('a model without textures', async () => {
  const b = await common();
  const r = await loaded(b, null, `${b.url}/packages/colours.texmesh`, {load: {time: 3}});
  check(!r.error && r.state.planes.length === 0, JSON.stringify(r.error));
  await r.page.close();
});

test('texmesh view serves a package that the client reads', async () => {
  const b = await common();
  const view = await startView(path.join(packages, 'maps.texmesh'));
  try {
    const r = await loaded(b, null, new URL('packages/maps.texmesh', view.url).href, {load: kEverything});
    check(!r.error, JSON.stringify(r.error));
    await r.page.close();
  } finally { view.stop(); }
});

test('a finer mesh that is not there ends nothing: picture and fragments stand', async () => {
  const {browser} = await common();
  const server = await serve({...labRoots}, {ranges: false, fault: (q) => (q.path.endsWith('mesh/s00.glb') ? {status: 404} : undefined)});
  try {
    const r = await loaded({browser, url: server.url}, null, `${server.url}/packages/maps.texmesh`,
      {load: {time: 5, scale: 0, meshes: 'glb', rung: kTop, autoRefine: false}});
    check(!r.error, JSON.stringify(r.error));
    check(server.requests.some((q) => q.path.endsWith('mesh/s00.glb')), 'the mesh was not asked for');
    check(r.state.scale > 0, `S_${r.state.scale}`);
    check(r.state.planes.length > 0 && r.state.planes.every((p) => [...p.rungs].some((k) => k >= 0)), 'no fragments');
    await r.page.close();
  } finally { await server.close(); }
});

test('a load may be disposed of at any moment', async () => {
  const b = await common();
  const page = await labPage(b.browser, b.url);
  await lab(page, () => window.lab.start({size: 256}));
  let scales = 0;
  // The last load is let run until it shows something, however slow the machine is: otherwise all might have ended too early.
  for (const ms of [0, 15, 40, 80, 150, 300, 'shown']) {
    const id = await lab(page, ([u, o]) => window.lab.load(u, o), [`${b.url}/packages/maps.texmesh`, {load: {time: 2}}]);
    if (ms === 'shown') await page.waitForFunction((i) => (window.lab.loads[i].model?.state.scale ?? -1) >= 0, id);
    else await page.waitForTimeout(ms);
    scales += await lab(page, (i) => (window.lab.loads[i].model?.state.scale ?? -1) >= 0, id);
    await lab(page, (i) => window.lab.loads[i].model?.dispose(), id);
  }
  check(scales > 0, 'nothing was ever shown');
  await page.waitForTimeout(300);
  check(page.said.length === 0, page.said.join('\n'));
  await page.close();
});

for (const [what, file] of [['no such package', 'none.texmesh'], ['something else', '../page/lab.mjs']]) {
  test(`an error that says what is wrong: ${what}`, async () => {
    const b = await common();
    const r = await loaded(b, null, file.startsWith('..') ? `${b.url}/lab.mjs` : `${b.url}/packages/${file}`, {});
    check(r.error && r.error.message.length > 10 && r.error.message.length < 400, JSON.stringify(r.error));
    await r.page.close();
  });
}

makePackages();
// `timed`: the cases that are held to times, `untimed`: the others, which other tests may run beside; neither word: all.
const timed = {timed: true, untimed: false}[process.argv[2]];
const code = await runAll(timed ? 'web_browser_timed' : 'web_browser', timed);
console.log(`pictures in ${pictures}`);
await closeCommon();
process.exit(code);
