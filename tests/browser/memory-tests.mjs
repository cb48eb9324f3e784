// Pages within the memory of the GPU: contexts that are lost, storage that is refused, packages that cannot be read, elements that come and go.
import {PNG, check, env, fs, packages, path, pictures, run} from './browser.mjs';
import {countStorage} from './gpu-storage.mjs';
import {test} from './harness.mjs';
import {covered, elements, html, onPage, settled} from './page-tests.mjs';

const large = (count) => elements(count, '', ['large']);
const two = '.grid{grid-template-columns:1fr 1fr}texmesh-viewer{height:440px}';
/** Four models of textures of 1024 px and more. */
const sharp = {before: countStorage, context: {deviceScaleFactor: 2}};
const complete = (page) => page.waitForFunction(() => [...document.querySelectorAll('texmesh-viewer')].every((e) => e.model?.phase === 'shown' && e.model.complete), null, {timeout: 60000});
const bytes = (page) => page.evaluate(async () => {
  const {texmeshPage} = await import('/viewer/texmesh-viewer.js');
  const shared = texmeshPage();
  return {said: shared.gpuBytes, limit: shared.memoryBytes, stored: window.storedBytes()};
});
/** The line of an element, as soon as there is one; and that it is legible is what the pictures are for. */
const line = (page, wanted) => page.waitForFunction((w) => [...document.querySelectorAll('texmesh-viewer')].some((e) => {
  const note = e.shadowRoot.querySelector('[part=note]');
  return !note.hidden && note.textContent.includes(w);
}), wanted, {timeout: 20000});
// Elements say what the renderer's own tables and full-screen triangles take nowhere.
const counted = ({said, stored}) => check(Math.abs(said - stored) <= 0.02 * stored + 70000, `${said} bytes are counted, ${stored} stored`);
const lose = (page) => page.evaluate(() => {
  [window.own] = window.contexts;
  window.loss = window.own.getExtension('WEBGL_lose_context');
  window.loss.loseContext();
});
const restore = (page) => page.evaluate(() => window.loss.restoreContext());

test('memory: a context that is lost with much in it comes back with a smaller picture, and once more; nothing leaks', async () => {
  await onPage(html(large(4), two), async (page) => {
    await complete(page);
    const before = await bytes(page);
    counted(before);
    check(before.said > 32e6, `${before.said} bytes: too little to be lost for want of memory`);
    let most = before.said;
    for (let i = 0; i < 3; i++) {
      await lose(page);
      await line(page, 'waiting for it');
      check(await covered(page, 1, `memory-lost-${i}`) > 0.05, 'the picture is gone with the context');
      await restore(page);
      if (i === 0) await line(page, 'a coarser picture');
      await page.waitForTimeout(200);
      await complete(page);
      const now = await bytes(page);
      counted(now);
      check(now.said <= now.limit && now.limit <= (i === 0 ? 0.5 * before.said : most), `${now.said} bytes within ${now.limit}, ${most} before`);
      check(now.said > 1e6, `${now.said} bytes: that is nothing`);
      most = now.limit;
      check(await covered(page, 1, `memory-restored-${i}`) > 0.05, 'nothing is seen');
    }
    page.said = page.said.filter((s) => !/CONTEXT_LOST|Context Lost|Context Restored/i.test(s));
  }, sharp);
}, {seconds: 150});

test('memory: a context that is lost again while its pictures are made anew', async () => {
  await onPage(html(large(2), two), async (page) => {
    await complete(page);
    for (const delay of [0, 80, 300]) {
      await lose(page);
      await page.waitForTimeout(50);
      await restore(page);
      await page.waitForFunction(() => !window.own.isContextLost());
      await page.waitForTimeout(delay);
    }
    await complete(page);
    counted(await bytes(page));
    for (const i of [0, 1]) check(await covered(page, i, `memory-lost-again-${i}`) > 0.05, `nothing is seen of scan ${i}`);
    page.said = page.said.filter((s) => !/CONTEXT_LOST|Context Lost|Context Restored/i.test(s));
  }, sharp);
}, {seconds: 60});

test('memory: metal mirrors its room again when a lost context is back', async () => {
  await onPage(html(elements(1, '', ['metal'])), async (page) => {
    const mirrors = () => page.waitForFunction(() => document.querySelector('texmesh-viewer').model?.scene.environment, null, {timeout: 20000});
    const shot = async (name) => {
      await page.waitForTimeout(500);
      const {data} = PNG.sync.read(await page.locator('texmesh-viewer').screenshot({path: path.join(pictures, `${name}.png`)}));
      return data;
    };
    await complete(page);
    await mirrors();
    const before = await shot('metal-before');
    await lose(page);
    await line(page, 'waiting for it');
    await restore(page);
    await page.waitForFunction(() => document.querySelector('texmesh-viewer').shadowRoot.querySelector('[part=note]').hidden, null, {timeout: 20000});
    await complete(page);
    const after = await shot('metal-after');
    const difference = before.reduce((sum, v, i) => sum + Math.abs(v - after[i]), 0) / before.length;
    check(difference < 0.5, `the pictures before and after differ by ${difference.toFixed(2)} of 255`);
    page.said = page.said.filter((s) => !/CONTEXT_LOST|Context Lost|Context Restored/i.test(s));
  }, {before: countStorage});
}, {seconds: 60});

test('memory: a GPU that refuses storage shows a smaller picture within what it holds', async () => {
  await onPage(html(large(4), two), async (page) => {
    await complete(page);
    await page.waitForFunction(() => window.refusals > 0 && [...document.querySelectorAll('texmesh-viewer')].every((e) => e.model.complete), null, {timeout: 60000});
    // Asked a little later each time, until all fits.
    let now;
    for (let i = 0; i < 60 && !(now?.said <= 24e6 && now.limit <= 48e6); i++) {
      await page.waitForTimeout(500);
      await complete(page);
      now = await bytes(page);
    }
    check(now.said > 1e6 && now.said <= 24e6 && now.stored <= 24e6, `${now.said} bytes, ${now.stored} stored`);
    await page.screenshot({path: path.join(pictures, 'memory-refused.png')});
    for (const i of [0, 1, 2, 3]) check(await covered(page, i, `memory-refused-${i}`) > 0.05, `nothing is seen of scan ${i}`);
    page.said = page.said.filter((s) => !/WebGL|GL_INVALID|INVALID_/i.test(s)); // what comes of textures that were never made
  }, {...sharp, before: `(${countStorage})(); window.gpuBytesLimit = 24e6;`});
}, {seconds: 150});

test('twenty scans: one of a later version, one with an unknown feature, one whose server dies, one of no height: the others go on', async () => {
  const golden = path.join(env.source, 'tests/golden');
  const odd = path.join(packages, 'odd');
  fs.mkdirSync(odd, {recursive: true});
  run('python3', path.join(golden, 'make_later'), path.join(golden, 'v2.0-webp.texmesh'), path.join(odd, 'later.texmesh'));
  run('python3', path.join(golden, 'make_invalid'), path.join(golden, 'v2.0-scan.texmesh'), odd, 'M02-unknown-feature');
  const names = ['odd/later', 'odd/M02-unknown-feature', 'kept', 'maps', 'webp', 'proxied'];
  const all = Array.from({length: 20}, (_, i) => names[i] ?? names[3 + (i % 3)]);
  await onPage(html(elements(20, '', all), 'texmesh-viewer[alt="scan 3"]{height:0}'), async (page) => {
    const wanted = all.map((name, i) => (name === 'odd/M02-unknown-feature' || name === 'kept' ? 'failed' : i === 3 ? 'waiting' : 'shown')).join();
    await page.waitForFunction((w) => [...document.querySelectorAll('texmesh-viewer')].map((e) => e.model?.phase).join() === w, wanted, {timeout: 60000})
      .catch(async () => check(false, `${await page.evaluate(() => [...document.querySelectorAll('texmesh-viewer')].map((e) => e.model?.phase).join())}, expected ${wanted}: ${await page.evaluate(() => [...document.querySelectorAll('texmesh-viewer')].map((e) => e.shadowRoot.querySelector('[part=error]').innerText).join('|'))}`));
    const said = await page.evaluate(() => [...document.querySelectorAll('texmesh-viewer')].map((e) => e.shadowRoot.querySelector('[part=error]')).map((e) => (e.hidden ? '' : e.innerText)));
    check(said[1] !== '' && said[2] !== '' && said.every((text, i) => [1, 2].includes(i) || text === ''), said.join(' | '));
    check(page.said.some((s) => /holograms/.test(s)), page.said.join(' | ')); // for who looks after the page
    await page.screenshot({path: path.join(pictures, 'page-odd.png')});
    page.said = page.said.filter((s) => !/ERR_|Failed to load|holograms|kept/.test(s)); // the first two are the browser's own
  }, {fault: ({path: p}) => (/kept/.test(p) ? {cut: 500} : undefined)});
}, {seconds: 120});

test('200 elements that come and go leave no element, no storage and no context', async () => {
  await onPage(html(elements(1, '', ['maps'])), async (page) => {
    await settled(page, 1);
    const cycle = (n) => page.evaluate(async (count) => {
      const grid = document.querySelector('.grid');
      for (let i = 0; i < count; i++) {
        const element = Object.assign(document.createElement('texmesh-viewer'), {src: `/packages/${['maps', 'proxied', 'webp'][i % 3]}.texmesh?${i}`});
        grid.prepend(element);
        // At whatever moment: at once, while it opens, while it loads, and every tenth when it is there.
        const until = i % 10 === 9 ? () => element.loaded : () => true;
        const end = performance.now() + 8000;
        do await new Promise((go) => setTimeout(go, (i % 7) * 12)); while (!until() && performance.now() < end);
        element.remove();
        await null;
      }
      await new Promise((go) => setTimeout(go, 300));
      window.gc?.();
      return performance.memory?.usedJSHeapSize ?? 0;
    }, n);
    const heapBefore = await cycle(40);
    await complete(page);
    const before = await bytes(page);
    const heap = await cycle(200);
    await complete(page);
    const after = await bytes(page);
    const left = await page.evaluate(async () => (await import('/viewer/texmesh-viewer.js')).texmeshPage().models.length);
    check(left === 1 && await page.evaluate(() => window.contexts.size) === 1, `${left} models`);
    check(Math.abs(after.stored - before.stored) < 1e5, `${before.stored} bytes stored after 40 (${before.said} said), ${after.stored} (${after.said}) after 200 more`);
    check(heap - heapBefore < 6e6, `${heapBefore} bytes of heap after 40, ${heap} after 200 more`);
  }, {before: countStorage});
}, {seconds: 150});
