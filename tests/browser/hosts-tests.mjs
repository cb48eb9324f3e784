// <texmesh-viewer> on pages and hosts that nobody here has seen: policies, other origins, sizes that change, servers that fail for a while.
import {check, fs, packages, path, serve} from './browser.mjs';
import {test} from './harness.mjs';
import {covered, html, kElement, onPage} from './page-tests.mjs';

const one = (attributes = '', name = 'maps') => html(`<texmesh-viewer src="/packages/${name}.texmesh" alt="a statue" ${attributes}></texmesh-viewer>`);
const model = (page) => page.evaluate(() => {
  const {model: m, shadowRoot: root} = document.querySelector('texmesh-viewer');
  const said = (selector) => (root.querySelector(selector).hidden ? '' : root.querySelector(selector).innerText);
  const {state} = m?.load ?? {};
  return {
    phase: m?.phase, complete: m?.complete, lacking: m?.lacking, error: said('[part=error]'), note: said('.note'), scale: state?.scale,
    wanted: state?.wantedScale, rungs: (state?.planes ?? []).flatMap((p) => [...p.rungs]), canvas: [m?.canvas.width, m?.canvas.height],
  };
});
/** Waits until the model is as `wanted` says; what it is then. */
async function becomes(page, wanted, what, seconds = 30) {
  for (let left = seconds * 10; left > 0; left--) {
    const now = await model(page);
    if (wanted(now)) return now;
    await page.waitForTimeout(100);
  }
  return check(false, `${what}: ${JSON.stringify({...await model(page), rungs: 0})}; ${page.said.join('\n')}`);
}
const complete = (m) => m.phase === 'shown' && m.complete && !m.lacking && m.rungs.some((k) => k > 0);
const failed = (m) => m.phase === 'failed';
const kBrowsers = /Failed to load resource|violates the following|blocked|WebAssembly|Aborted|THREE\./;

test('hosts: an element that has no size at first is shown when it has one', () => onPage(one('id="e" style="width:0;height:0"'), async (page) => {
  await page.waitForTimeout(500);
  check((await model(page)).phase === 'waiting', 'it loads though nobody sees it');
  await page.evaluate(() => window.e.removeAttribute('style'));
  await becomes(page, complete, 'with a size');
  check(await covered(page, 0, 'hosts-grown') > 0.02, 'nothing is seen');
}));

test('hosts: zoom and other screens: the canvas has the pixels of the device', () => onPage(one('style="width:300px"'), async (page) => {
  const {canvas: [width]} = await becomes(page, complete, 'at first');
  const devtools = await page.context().newCDPSession(page);
  await devtools.send('Emulation.setDeviceMetricsOverride', {width: 640, height: 450, deviceScaleFactor: 2, mobile: false});
  await becomes(page, (m) => m.canvas[0] === 2 * width && m.canvas[1] === 400, 'with twice the pixels', 5);
}));

// Nothing in the text of a page, as strict sites have it; README names what the decoders need.
const kPolicy = "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self'; worker-src 'self' blob:; connect-src 'self'; img-src data:; " +
  "require-trusted-types-for 'script'; trusted-types texmesh";
test('hosts: under the policy that README names the element looks and works as ever', () => onPage(one('camera-controls').replace(/<style>.*<\/style>/s, ''), async (page) => {
  const m = await becomes(page, complete, 'under a policy');
  check(m.canvas.join() === '300,300', `a canvas of ${m.canvas}: the element's own style is missing`);
  const help = await page.evaluate(() => document.querySelector('texmesh-viewer').shadowRoot.querySelector('#help').getBoundingClientRect().width);
  check(help <= 1, `the help is ${help} px wide`);
  check(await covered(page, 0, 'hosts-policy') > 0.02, 'nothing is seen');
}, {policy: kPolicy}));

test('hosts: without WebAssembly the meshes have a decoder, too', () => onPage(one(), async (page) => {
  await becomes(page, complete, 'without WebAssembly');
  page.said = page.said.filter((s) => !kBrowsers.test(s));
}, {policy: kPolicy.replace(" 'wasm-unsafe-eval'", '').replace("style-src 'self'", "style-src 'unsafe-inline'")}));

test('hosts: a host that compresses whatever is asked for is asked for the whole package', () => onPage(one(), async (page, server) => {
  const told = [];
  page.on('console', (m) => m.type() === 'info' && told.push(m.text()));
  await becomes(page, complete, 'compressed');
  check(server.requests.filter((r) => r.path.endsWith('maps.texmesh')).length < 10, 'it is asked again and again');
  await page.waitForTimeout(200);
  check(told.some((t) => /Content-Encoding/.test(t)), told.join('\n'));
  page.said = page.said.filter((s) => !kBrowsers.test(s));
}, {fault: (r) => r.path.endsWith('maps.texmesh') && {gzip: true}}));

test('hosts: where a policy forbids decoders, a sentence says that nothing comes, and the console why', () => onPage(one(), async (page) => {
  const told = [];
  page.on('console', (m) => m.type() === 'info' && told.push(m.text()));
  await becomes(page, failed, 'without decoders', 10);
  await page.waitForTimeout(200);
  check(told.some((t) => /Content-Security-Policy.*must have worker-src blob:\./.test(t)), told.join('\n'));
  page.said = page.said.filter((s) => !kBrowsers.test(s) && !/the decoder of meshes gives no answer/.test(s));
}, {policy: "script-src 'self'; style-src 'self' 'unsafe-inline'"}));

test('hosts: where a policy forbids the picture by which three.js tries WebP, the console has the source that lacks', () => onPage(one('', 'large'), async (page) => {
  const told = [];
  page.on('console', (m) => m.type() === 'info' && told.push(m.text()));
  const named = () => told.some((t) => /Content-Security-Policy.*must have img-src data:\./.test(t));
  for (let left = 100; left > 0 && !named(); left--) await page.waitForTimeout(100);
  check(named(), `${JSON.stringify(await model(page))}; ${told.join('\n')}`);
  page.said = page.said.filter((s) => !kBrowsers.test(s));
}, {policy: kPolicy.replace('img-src data:', "img-src 'self'")}));

test('hosts: a script of another host has its workers, too', async () => {
  const other = await serve(kElement);
  try {
    await onPage(one().replace('src="/viewer/', `src="${other.url}/viewer/`), async (page) => {
      await becomes(page, complete, 'fragments of the textures');
    });
  } finally { await other.close(); }
});

test('hosts: without WebGL the element says so in the language of its page, and offers no second try', () => onPage(
  `<!doctype html><html lang="de"><title>page</title><link rel="icon" href="data:,"><script type="module" src="/viewer/texmesh-viewer.js"></script><div></div></html>`,
  async (page) => {
    // Within a shadow root, as pages of components have it.
    await page.evaluate(() => { document.querySelector('div').attachShadow({mode: 'open'}).innerHTML = '<texmesh-viewer src="/packages/maps.texmesh"></texmesh-viewer>'; });
    const error = page.locator('texmesh-viewer').locator('[part=error]');
    await error.waitFor();
    check(/^Dieser Browser kann keine Objekte in 3D zeigen/.test(await error.innerText()), await error.innerText());
    check(await error.locator('button').isHidden(), 'a button that helps nobody');
    page.said = page.said.filter((s) => !/WebGL/.test(s));
  }, {before: () => {
    const own = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (kind, ...rest) { return /webgl/.test(kind) ? null : own.call(this, kind, ...rest); };
  }}));

test('hosts: a server that fails for a while is not stormed; the rest comes when it is there again', () => onPage(one('', 'large'), async (page, server) => {
  const isPackage = (r) => r.path.endsWith('large.texmesh');
  server.setFault((r) => isPackage(r) && server.requests.filter(isPackage).length > 4 && {status: 503});
  const without = await becomes(page, (m) => m.phase === 'shown' && m.complete, 'without a server');
  check(without.lacking && without.note === 'Parts of it could not be loaded yet.', JSON.stringify({...without, rungs: 0}));
  const asked = server.requests.filter((r) => r.status === 503).length;
  check(asked > 4 && asked < 110, `${asked} requests of a server that fails`);
  server.setFault(() => undefined);
  const whole = await becomes(page, (m) => complete(m) && m.scale === m.wanted, 'with a server');
  page.said = page.said.filter((s) => !kBrowsers.test(s));
}), {seconds: 90});

test('hosts: what failed without a network is tried again when there is one', () => onPage(one(), async (page, server) => {
  await becomes(page, failed, 'without a network');
  check(/could not be loaded/.test((await model(page)).error), (await model(page)).error);
  server.setFault(() => undefined);
  await page.evaluate(() => window.dispatchEvent(new Event('online')));
  const {error} = await becomes(page, complete, 'with a network');
  check(error === '', error);
  page.said = page.said.filter((s) => !kBrowsers.test(s) && !/InputError/.test(s));
}, {fault: (r) => r.path.endsWith('.texmesh') && {status: 503}}));

test('hosts: a package that is replaced while it comes is opened anew', async () => {
  const now = path.join(packages, 'now.texmesh');
  fs.copyFileSync(path.join(packages, 'large.texmesh'), now);
  try {
    let asked = 0;
    await onPage(one('', 'now'), async (page) => {
      const whole = await becomes(page, (m) => complete(m) && m.scale === m.wanted, 'the new one');
      check(whole.error === '' && asked < 40, `${asked} requests`);
      check(await page.evaluate(() => document.querySelector('texmesh-viewer').model.package.manifest.planeCount) > 1, 'the old one');
      page.said = page.said.filter((s) => !kBrowsers.test(s));
    }, {fault: (r) => { if (r.path.endsWith('now.texmesh') && ++asked === 3) fs.copyFileSync(path.join(packages, 'maps.texmesh'), now); }});
  } finally { fs.rmSync(now); }
});
