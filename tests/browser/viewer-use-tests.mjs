// The viewer by hand: what its controls, plots and comparison do, in what order its frames come, what is left when the server goes.
import {PNG, check, env, fs, kPhone, packages, path, run} from './browser.mjs';
import {test} from './harness.mjs';
import {starvation} from './starved.mjs';
import {live, phase, settled, shot, withViewer} from './viewer-tests.mjs';

const kFast = {bytesPerSecond: 1e12, rttMs: 0};
const timedPartOver = (page) => page.waitForFunction(() => Number.isFinite(window.texmeshViewer?.session.live.doneS), null, {timeout: 60000});
const originalReady = (page) => page.waitForFunction(() => document.getElementById('side-original').textContent === 'original', null, {timeout: 60000});
/** Mean of red, green and blue over what is drawn, 0 to 255; 0 where nothing is. */
async function drawnLight(page) {
  const png = PNG.sync.read(Buffer.from(await page.evaluate(() => {
    const {stage} = window.texmeshViewer;
    stage.render();
    return stage.renderer.domElement.toDataURL('image/png').split(',')[1];
  }), 'base64'));
  let [sum, n] = [0, 0];
  for (let i = 0; i < png.data.length; i += 4) {
    if (png.data[i + 3] < 255) continue;
    sum += (png.data[i] + png.data[i + 1] + png.data[i + 2]) / 3;
    n++;
  }
  return {mean: n ? sum / n : 0, pixels: n};
}

test('viewer: the original beside the current picture is S_0 with the top rungs of full-size textures', () => withViewer('?pkg=packages/maps.texmesh&time=1&scale=20&rung=0', async (page) => {
  await phase(page, 'done');
  await page.locator('#split').click();
  await originalReady(page);
  const {scale, planes} = await page.evaluate(async () => {
    const {model, pkg} = window.texmeshViewer.session.original;
    const tables = await pkg.tables();
    const bytes = (data) => { let text = ''; for (let i = 0; i < data.length; i += 0x8000) text += String.fromCharCode(...data.subarray(i, i + 0x8000)); return btoa(text); };
    return {scale: model.state.scale, planes: model.state.planes.map((p) => ({
      base: p.base, plane: p.plane, widthPx: p.widthPx, base64: bytes(model.readPlane(p.base)),
      missing: [...tables[p.plane].order].filter((f) => p.rungs[f] !== tables[p.plane].rungQuality.length - 1).length,
    }))};
  });
  check(scale === 0 && planes.length === 3, `S_${scale}, ${planes.length} planes`);
  for (const p of planes) {
    check(p.plane === p.base && p.missing === 0, `plane ${p.plane} of ${p.base}, ${p.missing} fragments below the top`);
    const file = path.join(env.work, `original-${p.plane}.png`);
    run(env.compose, path.join(packages, 'maps.texmesh'), String(p.plane), '100', file);
    const wanted = PNG.sync.read(fs.readFileSync(file));
    const data = Buffer.from(p.base64, 'base64');
    let most = 0;
    for (let i = 0; i < wanted.data.length; i += 4)
      if (wanted.data[i + 3] > 0) for (let c = 0; c < 3; c++) most = Math.max(most, Math.abs(wanted.data[i + c] - data[i + c]));
    check(wanted.data.length === data.length && most <= 3, `plane ${p.plane} differs from the C++ reconstruction by ${most}`);
  }
  const other = await page.evaluate(() => window.texmeshViewer.session.live.scale);
  check(other > 0, `the current picture is S_${other}, too`);
}), {seconds: 90});

test('viewer: what cannot be compared leaves the whole current picture, and a line', () => withViewer('?pkg=packages/maps.texmesh&time=1', async (page, server, link) => {
  await phase(page, 'done');
  await link.die();
  await page.locator('#split').click();
  await page.locator('#problem').waitFor({state: 'visible', timeout: 20000});
  check(await page.locator('#divider').isHidden(), 'half of the picture stays empty');
  check(await page.locator('#split').getAttribute('aria-pressed') === 'false', 'the button is pressed');
  check(await page.locator('#message').isHidden(), 'a message before the picture');
}, {quiet: false, through: kFast}), {seconds: 60});

test('viewer: loading again begins with nothing; where that fails, no old picture stands behind the message', () => withViewer('?pkg=packages/maps.texmesh&time=1', async (page, server, link) => {
  await phase(page, 'done');
  check((await drawnLight(page)).pixels > 1000, 'nothing is shown');
  await link.die();
  await page.locator('#reload').click();
  await page.locator('#message').waitFor({state: 'visible', timeout: 20000});
  await settled(page);
  // As the page shows it: drawing once more would hide what was left.
  const png = PNG.sync.read(await page.screenshot({clip: {x: 100, y: 120, width: 680, height: 150}}));
  const colours = new Set();
  for (let i = 0; i < png.data.length; i += 4) colours.add((png.data[i] >> 4 << 8) | (png.data[i + 1] >> 4 << 4) | (png.data[i + 2] >> 4));
  check(colours.size < 12, `${colours.size} colours of an old picture`);
  await shot(page, 'viewer-again-failed');
}, {quiet: false, through: kFast}), {seconds: 60});

test('viewer: a message on a phone leaves the buttons free', () => withViewer('?pkg=packages/none.texmesh', async (page) => {
  await page.locator('#message').waitFor({state: 'visible', timeout: 20000});
  await shot(page, 'viewer-error-phone');
  const message = await page.locator('#message').boundingBox();
  for (const id of ['home', 'split', 'theme', 'toggle']) {
    const b = await page.locator(`#${id}`).boundingBox();
    check(b.x >= message.x + message.width || b.y + b.height <= message.y || b.y >= message.y + message.height, `#${id} is behind the message`);
  }
  check(message.y > 0 && message.x >= 0 && message.x + message.width <= 390, JSON.stringify(message));
}, {viewport: kPhone, touch: true, quiet: false}));

test('viewer: the time limit by keyboard counts for the next load, and is kept', () => withViewer('?pkg=packages/large.texmesh&time=1', async (page) => {
  await timedPartOver(page);
  await page.locator('#time').focus();
  for (const [key, said] of [['ArrowRight', '1.50 s'], ['End', 'no limit'], ['Home', '500 ms'], ['ArrowRight', '1.00 s'], ['ArrowRight', '1.50 s'], ['ArrowRight', '2.00 s'], ['ArrowRight', '3.00 s']]) {
    await page.keyboard.press(key);
    check(await page.locator('#time').getAttribute('aria-valuetext') === said, `${key}: ${await page.locator('#time').getAttribute('aria-valuetext')}`);
    check(await page.locator('output[for=time]').textContent() === said, `${key}: ${await page.locator('output[for=time]').textContent()}`);
  }
  check(await live(page, (l) => l.limitS) === 1, 'the load that is over has another limit');
  await page.locator('#cap').selectOption({value: '62500'});
  await page.locator('#reload').focus();
  const starved = starvation();
  await page.keyboard.press('Enter');
  await page.waitForFunction(() => window.texmeshViewer.session.live.limitS === 3, null, {timeout: 10000});
  await timedPartOver(page);
  const l = await live(page, (x) => ({done: x.doneS, limit: x.limitS, bytes: x.bytes, before: x.transfers.filter((t) => t.start < 0).length}));
  check(l.limit === 3 && l.done <= 3 * 1.1 + starved() && l.done > 2 && l.before === 0, JSON.stringify(l));
}), {seconds: 60, timed: true});

test('viewer: every control can be reached and used by keyboard', () => withViewer('?pkg=packages/maps.texmesh&time=1', async (page) => {
  await phase(page, 'done');
  await page.locator('#split').focus();
  await page.keyboard.press('Enter');
  await originalReady(page);
  await page.locator('#experts > summary').focus();
  await page.keyboard.press('Enter');
  await page.locator('#view').focus();
  const reached = [];
  for (let i = 0; i < 25; i++) {
    await page.keyboard.press('Tab');
    reached.push(await page.evaluate(() => { const e = document.activeElement; return e.id || e.getAttribute('aria-label') || e.textContent.trim(); }));
  }
  const wanted = ['home', 'split', 'theme', 'toggle', 'divider', 'time', 'cap', 'policy', 'scale', 'rung', 'reload', 'refine', 'Scales', 'Fragments', 'Texture', 'rung', 'η', 'bytes', 'skipped', 'Ladder', 'Time', 'Bytes', 'For experts'];
  const missing = wanted.filter((name) => !reached.includes(name));
  check(missing.length === 0, `not reached: ${missing}; reached ${reached}`);
  const theme = () => page.evaluate(() => document.documentElement.dataset.theme);
  const before = await theme();
  await page.locator('#theme').focus();
  await page.keyboard.press('Space');
  check(await theme() !== before, 'the theme stays');
  await page.getByText('Ladder', {exact: true}).focus();
  await page.keyboard.press('Enter');
  check(await page.locator('details', {hasText: 'Ladder'}).last().evaluate((d) => d.open || [...document.querySelectorAll('details')].some((x) => x.open && /^Ladder/.test(x.textContent))), 'the section stays closed');
  const scale = await live(page, (l) => l.scale);
  await page.locator('#scale').focus();
  await page.keyboard.press('End');
  await page.waitForFunction((s) => window.texmeshViewer.session.live.scale !== s, scale, {timeout: 15000});
}), {seconds: 60});

test('viewer: plots say what is under the pointer, and nothing below them moves', () => withViewer('?pkg=packages/large.texmesh&time=6&mbit=4', async (page) => {
  await phase(page, 'done');
  await page.evaluate(() => { for (const d of document.querySelectorAll('details')) d.open = true; });
  await settled(page);
  await settled(page);
  const height = () => page.evaluate(() => document.getElementById('panel').scrollHeight);
  const plots = page.locator('.plot');
  check(await plots.count() === 5, `${await plots.count()} plots`);
  for (let i = 0; i < 5; i++) {
    await plots.nth(i).scrollIntoViewIfNeeded();
    const before = await height();
    const box = await plots.nth(i).locator('.u-over').boundingBox();
    await page.mouse.move(box.x + 0.6 * box.width, box.y + 0.5 * box.height);
    const said = await plots.nth(i).locator('.u-value').allTextContents();
    await plots.nth(i).screenshot({path: path.join(env.work, 'pictures', `plot-${i}.png`)});
    check(said.length >= 2 && said.filter((t) => /\d|mesh|tables|texture|preview|start/.test(t)).length >= 2, `plot ${i}: ${JSON.stringify(said)}`);
    check(await height() === before, `plot ${i}: the panel is ${await height()} px, not ${before}`);
    await page.mouse.move(5, 700);
  }
}), {seconds: 60});

test('viewer: by touch plots and map say what is there, too', () => withViewer('?pkg=packages/maps.texmesh&time=1', async (page) => {
  await phase(page, 'done');
  await settled(page);
  const plot = page.locator('.plot').first();
  await plot.scrollIntoViewIfNeeded();
  await plot.locator('.u-over').tap();
  check((await plot.locator('.u-value').allTextContents()).some((t) => /\d/.test(t)), 'no value');
  await page.locator('.map canvas').scrollIntoViewIfNeeded();
  await page.locator('.map canvas').tap();
  check(/fragment \d+/.test(await page.locator('.hint').textContent()), 'no word of the fragment');
}, {viewport: kPhone, touch: true}));

test('viewer: colours come first in the map; the step function has a dot where things stand', () => withViewer('?pkg=packages/maps.texmesh&time=2', async (page) => {
  await phase(page, 'done');
  await settled(page);
  const chosen = () => page.locator('select[aria-label=Texture] option:checked').textContent();
  check(/^base-colour/.test(await chosen()), await chosen());
  await page.locator('select[aria-label=Texture]').selectOption({index: 1});
  await settled(page);
  const own = await chosen();
  await page.locator('#refine').click();
  await settled(page);
  check(await chosen() === own, 'a texture that was chosen does not stay');
  // The dot is as high as the triangles that are shown.
  const rows = () => page.evaluate(() => {
    const c = document.querySelector('.plot canvas');
    const {data, width, height} = c.getContext('2d').getImageData(0, 0, c.width, c.height);
    const rows = [];
    for (let y = 0; y < height; y++) {
      let run = 0;
      for (let x = 0; x < width; x++) {
        const [r, g, b] = data.subarray(4 * (y * width + x), 4 * (y * width + x) + 3);
        if (r > 130 && g < 110 && b < 60) run++;
      }
      if (run >= 6) rows.push(y);
    }
    return rows.length ? rows.reduce((a, v) => a + v, 0) / rows.length : NaN;
  });
  await page.locator('#experts > summary').click();
  await page.locator('#scale').selectOption({index: 1});
  await page.waitForFunction(() => window.texmeshViewer.session.live.scale === 0, null, {timeout: 15000});
  await settled(page);
  const fine = await rows();
  await page.locator('#scale').selectOption({index: await page.locator('#scale option').count() - 1});
  await page.waitForFunction(() => window.texmeshViewer.session.live.scale > 0, null, {timeout: 15000});
  await settled(page);
  await page.mouse.move(5, 700);
  const coarse = await rows();
  check(coarse > fine + 10, `dot at ${fine} for S_0, at ${coarse} for the coarsest`);
  // Chromium's advice to those who read canvases again and again is for this test.
  check(page.said.every((s) => s.includes('willReadFrequently')), page.said.join('\n'));
}, {quiet: false}), {seconds: 60});

test('viewer: metal mirrors a sky; what is none has its light from lamps', () => withViewer('?pkg=packages/metal.texmesh&time=1', async (page) => {
  await phase(page, 'done');
  const metal = await drawnLight(page);
  await shot(page, 'viewer-metal');
  check(metal.pixels > 20000 && metal.mean > 60, JSON.stringify(metal));
  check(await page.evaluate(() => [window.texmeshViewer.stage.current, window.texmeshViewer.stage.original].every((s) => s.environment !== null)), 'no surroundings');
  await page.goto(page.url().replace('metal', 'maps'));
  await phase(page, 'done');
  check(await page.evaluate(() => window.texmeshViewer.stage.current.environment === null), 'surroundings for what needs none');
}), {seconds: 60});

test('viewer: where frames are slow, what comes is not kept waiting by them, and the last one stands at the limit', () => withViewer('', async (page) => {
  const slowMs = 120;
  await page.addInitScript((ms) => {
    // A GPU that takes so long for everything that it is asked about.
    const begun = new WeakMap();
    const {fenceSync, getSyncParameter, drawElements} = WebGL2RenderingContext.prototype;
    Object.assign(WebGL2RenderingContext.prototype, {
      fenceSync(...all) { const f = fenceSync.apply(this, all); if (f) begun.set(f, performance.now()); return f; },
      getSyncParameter(f, name) { return performance.now() - (begun.get(f) ?? 0) < ms ? this.UNSIGNALED : getSyncParameter.call(this, f, name); },
      drawElements(...all) { if (performance.now() - (window.frames_.at(-1) ?? -1e9) > 5) window.frames_.push(performance.now()); drawElements.apply(this, all); },
    });
    window.frames_ = [];
  }, slowMs);
  await page.goto(`${page.url().split('?')[0]}?pkg=packages/large.texmesh&time=7&scale=20`);
  await timedPartOver(page);
  await page.waitForTimeout(300);
  const {first, over, limit, drawn, fragments} = await page.evaluate(() => {
    const {live} = window.texmeshViewer.session;
    const at = (s) => live.startedAt + 1000 * s;
    return {first: at(live.firstPictureS), over: at(live.doneS), limit: at(live.limitS), drawn: window.frames_, fragments: [...live.rungs.values()].flatMap((r) => [...r]).filter((r) => r >= 0).length};
  });
  const during = drawn.filter((t) => t > first + slowMs && t < over - 20);
  const gaps = during.slice(1).map((t, i) => t - during[i]);
  check(fragments > 10 && during.length >= 2, `${fragments} fragments, ${during.length} frames`);
  check(Math.min(...gaps) > 1.8 * slowMs, `frames ${gaps.map(Math.round)} ms apart`);
  check(!during.some((t) => t > limit - 0.8 * slowMs && t < limit), 'a frame at the last moment');
  check(drawn.some((t) => t >= over - 20), 'no frame of the end');
}, {quiet: false, through: {bytesPerSecond: 120000, rttMs: 20}}), {seconds: 60, timed: true});
