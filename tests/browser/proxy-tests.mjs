// Packages with proxies: one request shows the object, a small display needs nothing else, a large one gets scales without a flash.
import {check, common, lab, labPage, near} from './browser.mjs';
import {test} from './harness.mjs';
import {loaded, throttled} from './loads.mjs';

const kFirstRange = 45056;
const proxied = (origin) => `${origin}/packages/proxied.texmesh`;
const first = (r) => r.events.find((e) => e.name === 'first-picture');

test('a proxy that is enough for the display is shown after one request', async () => {
  const b = await common();
  const r = await loaded(b, null, proxied(b.url), {px: 100, load: {time: 5}});
  check(!r.error, JSON.stringify(r.error));
  check(!r.events.some((e) => e.name === 'error'), JSON.stringify(r.events.filter((e) => e.name === 'error')));
  check(r.requests.length === 1 && r.requests[0].received === kFirstRange, JSON.stringify(r.requests));
  check(first(r)?.proxy === 0 && first(r).scale === -1, JSON.stringify(first(r)));
  check(r.state.proxy === 0 && r.state.scale === -1 && r.state.phase === 'done', JSON.stringify(r.state));
  const drawn = await lab(r.page, (i) => {
    let n = 0;
    window.lab.loads[i].model.object.traverse((o) => { if (o.isMesh) n += o.geometry.index.count / 3; });
    return {n, expected: window.lab.loads[i].pkg.manifest.proxies[0].triangles};
  }, r.id);
  check(drawn.n === drawn.expected, `${drawn.n} of ${drawn.expected} triangles`);
  // Nearer: scales, as the larger proxy takes more than a first request.
  const last = await lab(r.page, async ([i]) => {
    const run = window.lab.loads[i];
    run.px = 180;
    for (let t = 0; !(run.model.state.proxy < 0 && run.model.state.phase === 'done') && t < 800; t++) {
      run.model.update();
      await new Promise((go) => setTimeout(go, 25));
    }
    return {...run.model.state, planes: run.model.state.planes.length};
  }, [r.id]);
  check(last.proxy === -1 && last.scale >= 0 && last.planes > 0, JSON.stringify(last));
  check(r.page.said.length === 0, r.page.said.join('\n'));
  await r.page.close();
}, {seconds: 120});

/**
 * Every frame of a load since its first picture: pixels covered and their middle, how far the frame is from the last one (mean difference of
 * 8-bit values where one of both shows the object), and the worst flash: how much farther a frame is from one before it and one behind
 * it, at most 300 ms each, than these two are from each other.
 */
const framesOf = (page, id, from) => lab(page, ([i, first]) => {
  const frames = window.lab.loads[i].frames.filter((f) => f.at >= first);
  const shows = (data, p) => Math.max(...[0, 1, 2].map((c) => Math.abs(data[4 * p + c] - data[c]))) >= 12;
  const pictures = frames.map(({at, data}) => {
    const covered = new Uint8Array(data.length / 4);
    const side = Math.sqrt(covered.length);
    let [n, x, y] = [0, 0, 0];
    for (let p = 0; p < covered.length; p++) {
      if (!shows(data, p)) continue;
      covered[p] = 1;
      n++;
      x += p % side;
      y += Math.floor(p / side);
    }
    return {at, data, covered, n, x: x / n, y: y / n};
  });
  const known = new Map();
  const apart = (a, b) => {
    const key = `${a} ${b}`;
    if (known.has(key)) return known.get(key);
    const [{data: d, covered: u}, {data: e, covered: v}] = [pictures[a], pictures[b]];
    let [sum, n] = [0, 0];
    for (let p = 0; p < u.length; p++) {
      if (!u[p] && !v[p]) continue;
      n++;
      for (let c = 0; c < 3; c++) sum += Math.abs(d[4 * p + c] - e[4 * p + c]) / 3;
    }
    known.set(key, n ? sum / n : 0);
    return known.get(key);
  };
  // Frames that changed nothing say nothing new: the first and the last of each such run stand for it.
  const changes = pictures.flatMap((_, k) => (k > 0 && k < pictures.length - 1 && apart(k - 1, k) === 0 && apart(k, k + 1) === 0 ? [] : [k]));
  let flash = 0;
  for (const b of changes)
    for (const a of changes.filter((k) => k < b && pictures[b].at - pictures[k].at <= 0.3))
      for (const c of changes.filter((k) => k > b && pictures[k].at - pictures[b].at <= 0.3))
        flash = Math.max(flash, Math.min(apart(a, b), apart(b, c)) - apart(a, c));
  return {flash, frames: pictures.map(({at, n, x, y}, k) => ({at, n, x, y, fromLast: apart(k, pictures.length - 1)}))};
}, [id, from]);

test('a proxy gives way to scales in one frame: nothing flashes, nothing moves, nothing gets worse', async () => {
  await throttled({}, async (page, link, large) => {
    await lab(page, () => window.lab.start({size: 256}));
    const r = await loaded(null, page, large.replace('large', 'proxied'), {frames: 1, always: true, px: 400, load: {time: 5}});
    check(!r.error, JSON.stringify(r.error));
    check(first(r)?.proxy === 0, JSON.stringify(first(r)));
    const scale = r.events.find((e) => e.name === 'scale');
    check(scale && scale.at > first(r).at, `no scale behind the proxy: ${JSON.stringify(r.events.map(({name, at, scale: s}) => [name, at, s]))}`);
    check(r.state.proxy === -1 && r.state.scale >= 0, JSON.stringify(r.state));
    const {flash, frames} = await framesOf(page, r.id, first(r).at);
    const before = frames.findLast((f) => f.at < scale.at);
    const after = frames.find((f) => f.at >= scale.at);
    const last = frames.at(-1);
    check(before && after, `no frame before or behind the change: ${JSON.stringify(frames.map((f) => f.at))}, ${scale.at}`);
    for (const f of frames) {
      near(f.n / last.n, 1, 0.1, `pixels covered at ${f.at.toFixed(2)} s`);
      near(f.x, last.x, 1.5, `middle at ${f.at.toFixed(2)} s`);
      near(f.y, last.y, 1.5, `middle at ${f.at.toFixed(2)} s`);
    }
    check(flash < 1, `a flash of ${flash.toFixed(2)} levels`);
    check(after.fromLast <= before.fromLast + 0.5, `the scale is ${after.fromLast.toFixed(2)} levels from the end, the proxy was ${before.fromLast.toFixed(2)}`);
    check(page.said.length === 0, page.said.join('\n'));
  });
}, {seconds: 120, timed: true});

test('a proxy that cannot be decoded leaves the load to scales', async () => {
  const b = await common();
  const page = await labPage(b.browser, b.url);
  await lab(page, () => window.lab.start({size: 256}));
  await page.route('**/proxied.texmesh', async (route) => {
    const answer = await route.fetch();
    const body = await answer.body();
    if (route.request().headers().range === 'bytes=0-45055') body[body.length - 20000] ^= 255; // within the proxy, or behind: digests tell
    await route.fulfill({response: answer, body});
  });
  const r = await loaded(null, page, proxied(b.url), {px: 300, load: {time: 5}});
  check(!r.error, JSON.stringify(r.error));
  check(r.state.scale >= 0 && r.state.proxy === -1, JSON.stringify(r.state));
  await page.close();
}, {seconds: 120});

test('behind a link of 2 Mbit/s the proxy is the first picture, after one request of 44 KiB', async () => {
  await throttled({}, async (page, link, large) => {
    const r = await loaded(null, page, large.replace('large', 'proxied'), {load: {time: 3}});
    check(!r.error, JSON.stringify(r.error));
    const [start, ...later] = r.requests;
    check(first(r)?.proxy === 0 && start.received === kFirstRange, JSON.stringify([first(r), start]));
    check(later.every((q) => q.started >= start.ended), 'something shares the link with the first picture');
    check(r.state.proxy === -1 && r.state.scale >= 0, JSON.stringify({...r.state, planes: 0}));
  });
}, {seconds: 120});
