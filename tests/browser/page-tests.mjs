// Many packages on one page, and <texmesh-viewer>: one time limit, one link, one memory, whatever single ones do.
import {PNG, check, common, env, fs, listen, packages, path, pictures, serve} from './browser.mjs';
import {test} from './harness.mjs';
import {startLink} from './link.mjs';
import {countStorage} from './gpu-storage.mjs';

const kNames = ['maps', 'large', 'kept', 'progressive'];
export const kElement = {'/packages/': packages, '/viewer/': path.join(env.work, 'work/delivery/web/dist/viewer')};
/** A page with `elements`, by one script tag. */
export const html = (elements, style = '') => `<!doctype html><html lang="en"><title>page</title><link rel="icon" href="data:,">
<style>body{margin:0;font:14px sans-serif}.grid{display:grid;grid-template-columns:repeat(5,1fr);gap:4px}texmesh-viewer{width:100%;height:200px}${style}</style>
<script type="module" src="/viewer/texmesh-viewer.js"></script><div class="grid">${elements}</div></html>`;
export const elements = (count, attributes = '', names = kNames) =>
  Array.from({length: count}, (_, i) => `<texmesh-viewer src="/packages/${names[i % names.length]}.texmesh?${i}" alt="scan ${i}" ${attributes}></texmesh-viewer>`).join('');

/** Serves the page and opens it in a context of its own; `body` gets the page and the server. */
export async function onPage(text, body, {link: linkOptions, context: contextOptions = {}, before, fault, policy} = {}) {
  const folder = fs.mkdtempSync(path.join(env.work, 'page-'));
  fs.writeFileSync(path.join(folder, 'index.html'), text);
  const b = await common();
  const server = await serve({...kElement, '/': folder}, {fault, policy});
  const link = linkOptions && await startLink({target: server.port, ...linkOptions});
  const context = await b.browser.newContext({viewport: {width: 1280, height: 900}, ...contextOptions});
  const page = await context.newPage();
  listen(page);
  if (before) await page.addInitScript(before);
  try {
    await page.goto(`${link?.url ?? server.url}/index.html`, {waitUntil: 'commit'});
    await page.waitForFunction(() => window.customElements?.get('texmesh-viewer'), null, {timeout: 20000});
    await body(page, server);
    check(page.said.length === 0, page.said.join('\n'));
  } finally {
    await context.close();
    link?.close();
    await server.close();
    fs.rmSync(folder, {recursive: true, force: true});
  }
}
const phases = (page) => page.evaluate(() => [...document.querySelectorAll('texmesh-viewer')].map((e) => e.model?.phase ?? 'none'));
export const settled = (page, count) => page.waitForFunction((n) => {
  const all = [...document.querySelectorAll('texmesh-viewer')].map((e) => e.model?.phase);
  return all.length === n && all.every((p) => p === 'shown' || p === 'failed');
}, count, {timeout: 60000}).catch(async () => check(false, `it does not end: ${await phases(page)}: ${page.said.join('\n')}`));
/** Share of an element's pixels that are not the background. */
export async function covered(page, index, name) {
  const shot = await page.locator('texmesh-viewer').nth(index).screenshot({path: path.join(pictures, `${name}.png`)});
  const {data} = PNG.sync.read(shot);
  let n = 0;
  for (let i = 0; i < data.length; i += 4) if (data[i] + data[i + 1] + data[i + 2] < 720) ++n;
  return n / (data.length / 4);
}

test('twenty scans on one page: all first pictures, then each its turn, in one graphics context and few workers', async () => {
  const count = () => {
    window.made = {contexts: 0, workers: 0};
    const get = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (kind, ...rest) { if (/webgl/.test(kind)) ++window.made.contexts; return get.call(this, kind, ...rest); };
    window.Worker = class extends window.Worker { constructor(...a) { super(...a); ++window.made.workers; } };
    window.order = [];
    document.addEventListener('DOMContentLoaded', () => document.querySelectorAll('texmesh-viewer').forEach((e) => {
      for (const name of ['poster-dismissed', 'load']) e.addEventListener(name, () => window.order.push(name));
    }));
  };
  await onPage(html(elements(20)), async (page) => {
    await settled(page, 20);
    await page.screenshot({path: path.join(pictures, 'page-twenty.png')});
    const {made, order} = await page.evaluate(() => ({made: window.made, order: window.order}));
    check(made.contexts === 1, `${made.contexts} contexts`);
    check(made.workers <= 5, `${made.workers} workers`); // Draco's one may be among them
    check(order.filter((n) => n === 'poster-dismissed').length === 20 && order.lastIndexOf('poster-dismissed') < order.indexOf('load'), order.join(' '));
    for (const i of [0, 7, 19]) check(await covered(page, i, `page-twenty-${i}`) > 0.05, `nothing is seen of scan ${i}`);
  }, {before: count});
}, {seconds: 120});

test('twenty scans behind 4 Mbit/s and 40 ms: when the first pictures stand', async () => {
  await onPage(html(elements(20)), async (page) => {
    await page.waitForFunction(() => [...document.querySelectorAll('texmesh-viewer')].every((e) => ['first-picture', 'turn', 'shown'].includes(e.model?.phase)), null, {timeout: 60000});
    const seconds = await page.evaluate(() => performance.now() / 1000);
    console.log(`         all first pictures after ${seconds.toFixed(2)} s, scripts included`);
    check(seconds < 30, `${seconds} s`);
    await settled(page, 20);
  }, {link: {bytesPerSecond: 500000, rttMs: 40}});
}, {seconds: 120});

test('a page keeps within its memory: what WebGL was asked to store is what is counted', async () => {
  await onPage(html(elements(4, 'camera-controls'), 'texmesh-viewer{height:440px}.grid{grid-template-columns:1fr 1fr}'), async (page) => {
    await settled(page, 4);
    await page.waitForFunction(() => [...document.querySelectorAll('texmesh-viewer')].every((e) => e.model.complete), null, {timeout: 60000});
    const {said, stored} = await page.evaluate(() => ({
      said: [...document.querySelectorAll('texmesh-viewer')].reduce((n, e) => n + e.model.gpuBytes, 0), stored: window.storedBytes(),
    }));
    check(said > 1e6 && said <= 512e6, `${said} bytes`);
    // The renderer's own tables and full-screen triangles are no part of the models.
    check(Math.abs(said - stored) <= 0.02 * stored + 70000, `${said} bytes are counted, ${stored} stored`);
    // Models that are removed leave nothing.
    await page.evaluate(() => document.querySelectorAll('texmesh-viewer').forEach((e) => e.remove()));
    await page.waitForTimeout(100);
    const left = await page.evaluate(() => window.storedBytes());
    check(left < 0.02 * stored + 70000, `${left} bytes are left of ${stored}`);
  }, {before: countStorage});
}, {seconds: 120});

test('one package of twenty that cannot be had, an element of no height, one removed while it loads: the others go on', async () => {
  await onPage(html(elements(6), 'texmesh-viewer[alt="scan 4"]{height:0}'), async (page) => {
    await page.evaluate(() => document.querySelectorAll('texmesh-viewer')[2].remove());
    const done = () => [...document.querySelectorAll('texmesh-viewer')].map((e) => e.model?.phase).join();
    await page.waitForFunction(() => [...document.querySelectorAll('texmesh-viewer')].map((e) => e.model?.phase).join() === 'shown,failed,shown,waiting,failed', null, {timeout: 40000})
      .catch(async () => check(false, await page.evaluate(done)));
    const said = await page.evaluate(() => document.querySelectorAll('texmesh-viewer')[1].shadowRoot.querySelector('[part=error]').innerText);
    check(/could not be loaded/.test(said) && /Try again/.test(said) && !/503/.test(said), said);
    page.said = page.said.filter((s) => !/503/.test(s)); // the browser's own line
  }, {fault: ({path: p}) => (/large/.test(p) ? {status: 503} : undefined)});
}, {seconds: 90});

test('the element: poster and price before the click, Save-Data, keys, rights, no motion where none is wanted', async () => {
  const saving = () => Object.defineProperty(navigator, 'connection', {value: {saveData: true, downlink: 2}, configurable: true});
  const text = html('<texmesh-viewer src="/packages/maps.texmesh" alt="a statue" poster="data:image/gif;base64,R0lGODlhAQABAAAAACH5BAEKAAEALAAAAAABAAEAAAICTAEAOw==" bytes="2500000" camera-controls auto-rotate></texmesh-viewer>');
  await onPage(text, async (page, server) => {
    const element = page.locator('texmesh-viewer');
    const offered = await element.evaluate((e) => e.shadowRoot.querySelector('button.box').innerText);
    check(/45 kB/.test(offered) && /under a second/.test(offered) && /2\.5 MB/.test(offered), offered);
    check(!server.requests.some((r) => /texmesh$/.test(r.path)), 'a package is asked for before the click');
    await page.screenshot({path: path.join(pictures, 'element-offer.png')});
    await page.keyboard.press('Tab'); // the canvas
    await page.keyboard.press('Tab'); // the button
    await page.keyboard.press('Enter');
    await page.waitForFunction(() => document.querySelector('texmesh-viewer').loaded, null, {timeout: 30000});
    await page.waitForTimeout(50);
    check(await element.evaluate((e) => getComputedStyle(e.shadowRoot.querySelector('.poster')).opacity) === '0', 'the poster stays before the object');
    const angle = () => element.evaluate((e) => Math.atan2(e.model.camera.position.x, e.model.camera.position.z));
    const [at, still] = [await angle(), await page.waitForTimeout(300).then(angle)];
    check(at === still, 'it rotates though no motion is wanted');
    await element.evaluate((e) => e.shadowRoot.querySelector('canvas').focus());
    await page.keyboard.press('ArrowRight');
    check(Math.abs(await angle() - at) > 0.05, 'a key does not turn it');
    const label = await element.evaluate((e) => e.shadowRoot.querySelector('canvas').getAttribute('aria-label'));
    check(label === 'a statue', label);
    check(await covered(page, 0, 'element-shown') > 0.05, 'nothing is seen');
    const hosts = new Set(page.wentTo.map((u) => new URL(u)).filter((u) => u.protocol !== 'data:' && u.protocol !== 'blob:').map((u) => u.host));
    check(hosts.size === 1, `it asks ${[...hosts].join(', ')}`);
  }, {before: saving, context: {reducedMotion: 'reduce'}});
});
