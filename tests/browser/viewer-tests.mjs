// The viewer as people use it: its build in a folder of its own, the package somewhere beneath, a screenshot of every state.
import {axe, check, common, env, fs, kDesktop, kPhone, listen, path, pictures, serve, startView, viewerRoots, packages} from './browser.mjs';
import {test} from './harness.mjs';
import {startLink} from './link.mjs';

/** Opens the viewer on a package; `body` gets the page. Nothing may be said on the console, nothing asked of elsewhere. */
export async function withViewer(query, body, {viewport = kDesktop, dark = false, touch = false, quiet = true, fault, through} = {}) {
  const {browser} = await common();
  const server = await serve(viewerRoots, {fault});
  const link = through ? await startLink({target: server.port, ...through}) : null;
  const context = await browser.newContext({viewport, colorScheme: dark ? 'dark' : 'light', hasTouch: touch, deviceScaleFactor: touch ? 2 : 1});
  const page = await context.newPage();
  listen(page);
  try {
    const origin = link?.url ?? server.url;
    await page.goto(`${origin}/some/where/index.html${query}`);
    await body(page, server, link);
    if (quiet) check(page.said.length === 0, page.said.join('\n'));
    const elsewhere = page.wentTo.filter((u) => !u.startsWith(origin) && !/^(blob|data):/.test(u));
    check(elsewhere.length === 0, `asked elsewhere: ${elsewhere.join(' ')}`);
  } finally {
    await context.close();
    link?.close();
    await server.close();
  }
}

export const shot = (page, name) => page.screenshot({path: path.join(pictures, `${name}.png`)});
export const phase = (page, name, timeout = 60000) => page.waitForFunction((p) => window.texmeshViewer?.session.live.phase === p, name, {timeout});
export const live = (page, f) => page.evaluate(`(${f})(window.texmeshViewer.session.live)`);
export const settled = (page) => page.waitForTimeout(400); // the panel draws a few times a second

async function drawnShare(page) {
  const png = await page.locator('#view').screenshot();
  return png.length; // an empty picture is a few hundred bytes of PNG
}

for (const [name, options] of [
  ['desktop', {}], ['desktop-dark', {dark: true}], ['phone', {viewport: kPhone, touch: true}], ['phone-dark', {viewport: kPhone, touch: true, dark: true}],
]) {
  test(`viewer: a package is shown (${name})`, () => withViewer('?pkg=packages/large.texmesh&time=3', async (page) => {
    await phase(page, 'done');
    await settled(page);
    await shot(page, `viewer-${name}`);
    const l = await live(page, (x) => ({scale: x.scale, bytes: x.bytes, first: x.firstPictureS, planes: x.tables.length}));
    check(l.scale !== null && l.bytes > 10000 && l.first > 0 && l.planes > 0, JSON.stringify(l));
    check(await drawnShare(page) > 8000, 'the picture is empty');
    check(!(await page.evaluate(() => document.documentElement.scrollWidth > innerWidth)), 'wider than the screen');
    check((await page.locator('#figure-scale').textContent()).startsWith('S'), 'no scale in the panel');
    // Every plot with all sections open.
    await page.evaluate(() => { for (const d of document.querySelectorAll('details')) d.open = true; });
    await settled(page);
    await page.locator('.plot canvas').nth(4).waitFor({state: 'attached', timeout: 60000});
    await page.evaluate(() => { const p = document.getElementById('panel'); p.scrollTop = p.scrollHeight; });
    await settled(page);
    await shot(page, `viewer-${name}-plots`);
  }, options), {seconds: 120});
}

test('viewer: fragments by importance, rung, bytes and skipped', () => withViewer('?pkg=packages/large.texmesh&time=2', async (page) => {
  await phase(page, 'done');
  const painted = () => page.evaluate(() => {
    const c = document.querySelector('.map canvas');
    const {data} = c.getContext('2d').getImageData(0, 0, c.width, c.height);
    const colours = new Set();
    for (let i = 0; i < data.length; i += 4) if (data[i + 3] === 255) colours.add((data[i] << 16) | (data[i + 1] << 8) | data[i + 2]);
    return {colours: colours.size, all: [...data].reduce((sum, v, i) => (sum * 31 + v * (i % 7 + 1)) % 1000003, 0)};
  });
  const seen = {};
  for (const by of ['rung', 'η', 'bytes', 'skipped']) {
    await page.getByRole('button', {name: by, exact: true}).click();
    await settled(page);
    await page.locator('.map').scrollIntoViewIfNeeded();
    await page.locator('.map').screenshot({path: path.join(pictures, `map-${by === 'η' ? 'eta' : by}.png`)});
    seen[by] = await painted();
  }
  // Importance and bytes are shades, one for nearly every fragment; the others a few colours.
  check(seen['η'].colours > 20 && seen.bytes.colours > 20, JSON.stringify(seen));
  check([seen.rung, seen.skipped].every(({colours}) => colours >= 1 && colours <= 12), JSON.stringify(seen));
  check(new Set(Object.values(seen).map(({all}) => all)).size === 4, `maps that are the same: ${JSON.stringify(seen)}`);
  const box = await page.locator('.map canvas').boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  check(/fragment \d+/.test(await page.locator('.hint').textContent()), 'no word under the pointer');
}));

test('viewer: original and current side by side', () => withViewer('?pkg=packages/large.texmesh&time=1&scale=20', async (page) => {
  await phase(page, 'done');
  await page.locator('#split').click();
  await page.waitForFunction(() => ['refining', 'done'].includes(window.texmeshViewer.session.original?.model.state.phase), null, {timeout: 60000});
  await settled(page);
  await shot(page, 'viewer-split');
  await page.locator('#divider').focus();
  await page.keyboard.press('ArrowLeft');
  check(Number(await page.locator('#divider').getAttribute('aria-valuenow')) < 50, 'the border did not move');
  await page.keyboard.press('s');
  check(await page.locator('#divider').isHidden(), 'the border stays');
}), {seconds: 90});

test('viewer: all of it is in view at home; panel and plot have the height that decides', () => withViewer('?pkg=packages/large.texmesh&time=1', async (page) => {
  await phase(page, 'done');
  const seen = async () => {
    await settled(page);
    return page.evaluate(() => {
      const {session: {live, inner}, stage} = window.texmeshViewer;
      const {boundsMin: min, boundsMax: max, objectHeight} = live.manifest;
      const centre = stage.camera.position.clone().fromArray(min.map((v, k) => (v + max[k]) / 2));
      const px = (distance) => (objectHeight / distance / 2 / Math.tan((stage.camera.fov * Math.PI) / 360)) * stage.renderer.domElement.height;
      return {
        panel: document.getElementById('figure-size').textContent, live: live.displayedPx, decides: inner.model.state.displayedPx,
        middle: px(stage.camera.position.distanceTo(centre)), bound: px(objectHeight / 50),
      };
    });
  };
  const home = await seen();
  for (let i = 0; i < 10; i++) await page.locator('#view').press('+');
  await page.waitForFunction((px) => window.texmeshViewer.session.live.displayedPx > 2 * px, home.decides, {timeout: 20000});
  await page.waitForTimeout(1500); // frames of finer textures take their time
  const near = await seen();
  for (const s of [home, near])
    check(s.live === s.decides && Number(s.panel.replace(/[^0-9.]/g, '')) === Math.round(s.decides), JSON.stringify(s));
  check(Math.abs(home.decides / home.middle - 1) < 1e-3, `at home ${JSON.stringify(home)}`);
  check(near.decides > 2 * home.decides && near.decides < 0.5 * near.bound, `near ${JSON.stringify(near)}`);
}));

test('viewer: cap, policy, rung and time by hand, then loaded again', () => withViewer('?pkg=packages/large.texmesh&time=2', async (page) => {
  await phase(page, 'done');
  const free = await live(page, (x) => x.bytes);
  await page.locator('#cap').selectOption({value: '62500'});
  await page.locator('#experts > summary').click();
  await page.locator('#policy').selectOption('guard');
  await page.locator('#reload').click();
  await page.waitForFunction(() => Number.isFinite(window.texmeshViewer.session.live.doneS), null, {timeout: 30000});
  const capped = await live(page, (x) => ({bytes: x.bytes, s: x.doneS}));
  check(capped.bytes < 62500 * capped.s * 1.1 + 16384 && capped.bytes < free, JSON.stringify([free, capped]));
  await page.locator('#cap').selectOption({index: 0});
  await page.locator('#rung').selectOption('0');
  await page.locator('#reload').click();
  await phase(page, 'done');
  const rungs = await live(page, (x) => [...x.rungs.values()].flatMap((r) => [...r]));
  check(rungs.includes(0) && Math.max(...rungs) === 0, `rungs ${rungs}`);
}), {seconds: 90});

test('viewer: keyboard and mouse turn it, overrides change it', () => withViewer('?pkg=packages/large.texmesh&time=2', async (page) => {
  await phase(page, 'done');
  const eye = () => page.evaluate(() => window.texmeshViewer.stage.camera.position.toArray());
  const differs = (a, b) => Math.hypot(...a.map((v, i) => v - b[i])) > 1e-4;
  // The camera glides on after a key: only what moves it from rest was the key's doing.
  const atRest = async () => {
    for (let [last, now] = [null, await eye()]; ; [last, now] = [now, await eye()]) {
      if (last && Math.hypot(...now.map((v, i) => v - last[i])) < 1e-9) return now;
      await page.waitForTimeout(150);
    }
  };
  for (const key of ['ArrowLeft', 'ArrowUp', '+', '-', 'ArrowRight']) {
    const before = await atRest();
    await page.locator('#view').press(key);
    check(differs(before, await eye()), `${key} does nothing`);
  }
  const before = await atRest();
  const box = await page.locator('#view').boundingBox();
  await page.mouse.move(box.x + 300, box.y + 300);
  await page.mouse.down();
  await page.mouse.move(box.x + 420, box.y + 340, {steps: 4});
  await page.mouse.up();
  check(differs(before, await eye()), 'dragging does nothing');
  await page.locator('#experts > summary').click();
  await page.locator('#scale').selectOption({index: 1});
  await page.waitForFunction(() => window.texmeshViewer.session.live.scale === 0, null, {timeout: 20000});
  await page.keyboard.press('t');
  check(await page.evaluate(() => document.documentElement.dataset.theme) !== undefined, 'no theme');
  await page.locator('#toggle').click();
  check(await page.locator('#panel').isHidden(), 'the panel stays');
}), {seconds: 90});

test('viewer: a rung beyond the ladder equals its highest, and the time is said in words', () => withViewer('?pkg=packages/maps.texmesh&time=2&rung=99', async (page) => {
  await phase(page, 'done');
  await settled(page);
  const rungs = await page.locator('#rung option').count() - 1;
  check(rungs >= 3 && await page.locator('#rung').inputValue() === String(rungs - 1), `"${await page.locator('#rung').inputValue()}" of ${rungs}`);
  check(await page.locator('#time').getAttribute('aria-valuetext') === '2.00 s', `${await page.locator('#time').getAttribute('aria-valuetext')}`);
}));

test('viewer: two fingers zoom', () => withViewer('?pkg=packages/maps.texmesh&time=2', async (page) => {
  await phase(page, 'done');
  const distance = () => page.evaluate(() => window.texmeshViewer.stage.camera.position.length());
  const before = await distance();
  const session = await page.context().newCDPSession(page);
  const touch = (type, spread) => session.send('Input.dispatchTouchEvent', {type, touchPoints: spread === null ? [] : [{x: 195 - spread, y: 240, id: 0}, {x: 195 + spread, y: 240, id: 1}]});
  await touch('touchStart', 30);
  for (let s = 40; s <= 120; s += 20) await touch('touchMove', s);
  await touch('touchEnd', null);
  await page.waitForTimeout(300);
  check(Math.abs(await distance() - before) > 1e-3, 'two fingers do nothing');
}, {viewport: kPhone, touch: true}));

test('viewer: a slow link shows progress, then the picture', () => withViewer('?pkg=packages/large.texmesh&time=4', async (page) => {
  await page.waitForFunction(() => Number.isFinite(window.texmeshViewer?.session.live.scale), null, {timeout: 60000});
  check(await page.locator('#progress').isVisible(), 'no progress bar');
  await shot(page, 'viewer-loading');
  await phase(page, 'done');
  await shot(page, 'viewer-loaded');
}, {through: {bytesPerSecond: 400000, rttMs: 40}}), {seconds: 120});

test('viewer: errors can be read', async () => {
  for (const [name, query, text, options] of [
    ['404', '?pkg=packages/none.texmesh', /no package here.*Look at the address/i, {}],
    ['no-package', '?pkg=index.html', /not a package/i, {}],
    ['visitor-404', '?pkg=packages/none.texmesh&panel=none', /^This object is not here any more\.Try again$/, {}],
    ['visitor-page', '?pkg=index.html&panel=none', /^This object cannot be shown\.Try again$/, {}],
    ['server-error', '?pkg=packages/maps.texmesh', /could not be loaded.*The server does not give/i, {fault: (q) => (q.path.endsWith('.texmesh') ? {status: 500} : undefined)}],
  ]) {
    await withViewer(query, async (page) => {
      await page.locator('#message').waitFor({state: 'visible', timeout: 20000});
      await shot(page, `viewer-error-${name}`);
      const said = await page.locator('#message').textContent();
      check(text.test(said), `${name}: ${said}`);
    }, {quiet: false, ...options});
  }
}, {seconds: 90});

test('viewer: a poster stands there until the object does, in the grey that goes on', () => withViewer('?pkg=packages/maps.texmesh&time=1&panel=none&poster=packages/maps/poster.jpg', async (page) => {
  const poster = page.locator('#poster');
  await poster.waitFor({state: 'visible', timeout: 20000});
  check(await poster.evaluate((e) => e.complete && e.naturalWidth > 0 || new Promise((go) => { e.onload = () => go(true); e.onerror = () => go(false); })), 'no poster');
  await phase(page, 'done');
  check(await poster.evaluate((e) => e.classList.contains('gone')), 'the poster stays');
  check(await page.locator('#stage').evaluate((e) => getComputedStyle(e).backgroundColor) === 'rgb(124, 124, 124)', 'another grey');
  await shot(page, 'viewer-posed');
}));

test('viewer: what goes wrong beside the picture can be read', async () => {
  let lost = 0;
  const fault = (q) => {
    const from = Number(/^bytes=(\d+)/.exec(q.range ?? '')?.[1] ?? 0);
    return q.path.endsWith('large.texmesh') && from > 400000 && ++lost ? {status: 404} : undefined;
  };
  await withViewer('?pkg=packages/large.texmesh&time=3&scale=0', async (page) => {
    await page.waitForFunction(() => window.texmeshViewer?.session.live.phase === 'done', null, {timeout: 60000});
    await settled(page);
    check(lost > 0, 'nothing was lost');
    check(await page.locator('#problem').isVisible(), 'no word of it');
    check(/404/.test(await page.locator('#problem').textContent()), await page.locator('#problem').textContent());
    check(await page.locator('#message').isHidden(), 'a message before the picture');
    await shot(page, 'viewer-problem');
  }, {quiet: false, fault});
}, {seconds: 90});

test('viewer: the server dies midway: the picture stays, and a line says why', () => withViewer('?pkg=packages/large.texmesh&time=20&scale=0', async (page, server, link) => {
  await page.waitForFunction(() => [...window.texmeshViewer?.session.live.rungs.values() ?? []].some((r) => r.some((k) => k >= 0)), null, {timeout: 60000});
  const before = await drawnShare(page);
  await link.die();
  await page.locator('#problem').waitFor({state: 'visible', timeout: 30000});
  await phase(page, 'done', 40000).catch(() => {});
  await page.waitForTimeout(1500);
  check(await page.locator('#problem').isVisible(), 'the line is gone');
  check(/127\.0\.0\.1/.test(await page.locator('#problem').textContent()), await page.locator('#problem').textContent());
  check(await page.locator('#message').isHidden(), 'a message before the picture');
  const after = await drawnShare(page);
  check(after > 8000 && after > 0.6 * before, `${after} bytes of picture, ${before} before`);
  await shot(page, 'viewer-dead-server');
}, {quiet: false, through: {bytesPerSecond: 60000, rttMs: 20}}), {seconds: 120});

test('viewer: map and ladder fill while the bytes come', () => withViewer('?pkg=packages/large.texmesh&time=12', async (page) => {
  await page.waitForFunction(() => [...window.texmeshViewer?.session.live.rungs.values() ?? []].some((r) => r.filter((k) => k >= 0).length > 4), null, {timeout: 60000});
  await page.evaluate(() => { for (const d of document.querySelectorAll('details')) d.open = true; });
  const painted = () => page.evaluate(() => {
    const c = document.querySelector('.map canvas');
    const colours = new Set();
    const {data} = c.getContext('2d').getImageData(0, 0, c.width, c.height);
    for (let i = 0; i < data.length; i += 4) if (data[i + 3] === 255) colours.add(data[i] << 16 | data[i + 1] << 8 | data[i + 2]);
    return {colours: colours.size, ladder: document.querySelectorAll('.plot canvas').length, over: Number.isFinite(window.texmeshViewer.session.live.doneS)};
  });
  let now;
  for (let t = 0; t < 40 && !(now?.colours > 1 && now.ladder >= 3); t++) {
    await page.waitForTimeout(100);
    now = await painted();
  }
  check(!now.over, 'the load was over before');
  check(now.colours > 1 && now.ladder >= 3, JSON.stringify(now));
  await shot(page, 'viewer-filling');
  // Chromium's advice to those who read canvases again and again is for this test.
  check(page.said.every((s) => s.includes('willReadFrequently')), page.said.join('\n'));
}, {quiet: false, through: {bytesPerSecond: 250000, rttMs: 40}}), {seconds: 90});

for (const [name, options] of [['light', {}], ['dark', {dark: true}], ['phone', {viewport: kPhone, touch: true}]])
  test(`viewer: names, roles, contrast and labels by axe (${name})`, () => withViewer('?pkg=packages/maps.texmesh&time=2', async (page) => {
    await phase(page, 'done');
    await page.evaluate(() => { for (const d of document.querySelectorAll('details')) d.open = true; });
    await page.locator('#split').click();
    await settled(page);
    await page.evaluate(axe);
    const {violations, passes} = await page.evaluate(() => window.axe.run(document, {resultTypes: ['violations', 'passes']}));
    check(passes.length > 10, `${passes.length} rules were looked at`);
    const said = violations.map((v) => `${v.id} (${v.impact}): ${v.nodes.slice(0, 3).map((n) => `${n.target} ${n.failureSummary}`).join('; ')}`);
    check(violations.length === 0, said.join('\n'));
  }, options), {seconds: 120});

test('viewer: without WebGL, or with no address, it says so', async () => {
  for (const [name, query, text] of [
    ['no-address', '?pkg=http://', /could not be loaded/i], ['escape', '?pkg=%25', /no package here|could not be loaded/i],
  ]) {
    await withViewer(query, async (page) => {
      await page.locator('#message').waitFor({state: 'visible', timeout: 20000});
      check(text.test(await page.locator('#message').textContent()), `${name}: ${await page.locator('#message').textContent()}`);
    }, {quiet: false});
  }
  const {browser} = await common();
  const server = await serve(viewerRoots);
  const page = await browser.newPage();
  listen(page);
  try {
    await page.addInitScript(() => { HTMLCanvasElement.prototype.getContext = () => null; });
    await page.goto(`${server.url}/some/where/index.html?pkg=packages/maps.texmesh`);
    await page.locator('#message').waitFor({state: 'visible', timeout: 20000});
    check(/no WebGL/i.test(await page.locator('#message').textContent()), await page.locator('#message').textContent());
  } finally {
    await page.close();
    await server.close();
  }
}, {seconds: 90});

test('viewer: the picture comes back with the graphics context', () => withViewer('?pkg=packages/maps.texmesh&time=2&mbit=3&policy=guard', async (page) => {
  await phase(page, 'done');
  check(await page.locator('#cap').inputValue() === '375000' && await page.locator('#policy').inputValue() === 'guard', 'choices are not shown');
  const before = await drawnShare(page);
  const loss = await page.evaluateHandle(() => window.texmeshViewer.stage.renderer.getContext().getExtension('WEBGL_lose_context'));
  await loss.evaluate((l) => l.loseContext());
  await page.locator('#problem').waitFor({state: 'visible', timeout: 5000});
  await loss.evaluate((l) => l.restoreContext());
  await page.waitForFunction(() => window.texmeshViewer.session.live.problem === '', null, {timeout: 10000});
  await phase(page, 'done');
  await settled(page);
  await shot(page, 'viewer-restored');
  const after = await drawnShare(page);
  check(Math.abs(after / before - 1) < 0.3, `${after} bytes of picture, ${before} before`);
}, {quiet: false}), {seconds: 90});

test('viewer: the original is opened once, and again with the package', () => withViewer('?pkg=packages/maps.texmesh&time=2', async (page) => {
  await phase(page, 'done');
  for (let i = 0; i < 3; i++) await page.locator('#split').click();
  const ready = () => page.waitForFunction(() => ['refining', 'done'].includes(window.texmeshViewer.session.original?.model.state.phase), null, {timeout: 30000});
  await ready();
  check(await page.evaluate(() => window.texmeshViewer.stage.original.children.filter((o) => o.isGroup).length) === 1, 'more than one original');
  await page.locator('#reload').click();
  await page.locator('#reload').click();
  await ready();
  await phase(page, 'done');
  check(await page.evaluate(() => window.texmeshViewer.stage.original.children.filter((o) => o.isGroup).length) === 1, 'no original after loading again');
  check(await page.locator('#message').isHidden() && await page.locator('#problem').isHidden(), 'cancelling is told as an error');
}), {seconds: 90});

test('viewer: texmesh view of a folder offers its packages', async () => {
  const {browser} = await common();
  const view = await startView(packages);
  const page = await browser.newPage({viewport: kDesktop});
  listen(page);
  try {
    await page.goto(view.url);
    await page.locator('#message a').first().waitFor();
    await shot(page, 'viewer-packages');
    await page.getByRole('link', {name: 'maps', exact: true}).click();
    await phase(page, 'done');
    check(page.said.length === 0, page.said.join('\n'));
  } finally {
    await page.close();
    view.stop();
  }
}, {seconds: 60});

test('viewer: the build names no other server and nothing outside its folder', async () => {
  const files = fs.readdirSync(env.viewer, {recursive: true}).map((f) => path.join(env.viewer, String(f))).filter((f) => fs.statSync(f).isFile());
  check(files.length >= 5, `${files.length} files`);
  const page = fs.readFileSync(path.join(env.viewer, 'index.html'), 'utf8');
  check(!/(src|href)="(\/|https?:)/.test(page), 'an absolute path in index.html');
  check(files.some((f) => f.endsWith('draco_decoder.wasm')), 'no Draco decoder');
});
