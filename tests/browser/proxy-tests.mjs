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
  // Nearer: the larger proxy, then scales.
  const grown = await lab(r.page, async ([i]) => {
    const run = window.lab.loads[i];
    const until = async (good) => { for (let t = 0; !good() && t < 800; t++) { run.model.update(); await new Promise((go) => setTimeout(go, 25)); } };
    run.px = 180;
    await until(() => run.model.state.proxy === 1);
    const larger = {...run.model.state, planes: 0};
    run.px = 1500;
    await until(() => run.model.state.proxy < 0 && run.model.state.phase === 'done');
    return {larger, last: {...run.model.state, planes: run.model.state.planes.length}};
  }, [r.id]);
  check(grown.larger.proxy === 1 && grown.larger.scale === -1, JSON.stringify(grown));
  check(grown.last.proxy === -1 && grown.last.scale >= 0 && grown.last.planes > 0, JSON.stringify(grown));
  check(r.page.said.length === 0, r.page.said.join('\n'));
  await r.page.close();
}, {seconds: 120});

test('a proxy gives way to scales without an empty frame, and in the same place', async () => {
  const b = await common();
  const r = await loaded(b, null, proxied(b.url), {frames: 1, px: 400, load: {time: 4}});
  check(!r.error, JSON.stringify(r.error));
  check(first(r)?.proxy === 0, JSON.stringify(first(r)));
  const scale = r.events.find((e) => e.name === 'scale');
  check(scale && scale.at > first(r).at, `no scale behind the proxy: ${JSON.stringify(r.events.map(({name, at, scale: s}) => [name, at, s]))}`);
  check(r.state.proxy === -1 && r.state.scale >= 0, JSON.stringify(r.state));
  // Every frame since the first picture covers the object: as many pixels, around the same middle.
  const seen = await lab(r.page, (i) => {
    const {frames} = window.lab.loads[i];
    return frames.map(({at, data}) => {
      let [n, x, y] = [0, 0, 0];
      const side = Math.sqrt(data.length / 4);
      for (let p = 0; p < data.length / 4; p++) {
        if (Math.max(...[0, 1, 2].map((c) => Math.abs(data[4 * p + c] - data[c]))) < 12) continue;
        n++;
        x += p % side;
        y += Math.floor(p / side);
      }
      return {at, n, x: x / n, y: y / n};
    });
  }, r.id);
  const shown = seen.filter((f) => f.at >= first(r).at && f.n > 0);
  const last = shown.at(-1);
  check(seen.filter((f) => f.at > first(r).at + 0.05).every((f) => f.n > 0), 'an empty frame');
  for (const f of shown) {
    near(f.n / last.n, 1, 0.15, 'pixels covered');
    near(f.x, last.x, 4, 'middle');
    near(f.y, last.y, 4, 'middle');
  }
  check(r.page.said.length === 0, r.page.said.join('\n'));
  await r.page.close();
}, {seconds: 120});

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
    check(first(r)?.proxy === 0 && first(r).bytes === kFirstRange, JSON.stringify(first(r)));
    check(r.state.proxy === -1 && r.state.scale >= 0, JSON.stringify({...r.state, planes: 0}));
  });
}, {seconds: 120});
