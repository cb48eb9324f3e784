// Pages whose workers fail: not there, dead, silent.
import {check, common, lab, labPage, labRoots, serve} from './browser.mjs';
import {test} from './harness.mjs';
import {comparePlane, kEverything, kTopQuality, loaded, rightFrom} from './loads.mjs';

const errorsOf = (r) => r.events.filter((e) => e.name === 'error').map((e) => e.message);

test('a worker that is not where the page says (404): the mesh is shown, the error says what to do, once', async () => {
  const b = await common();
  const server = await serve(labRoots);
  try {
    const none = {workerUrl: `${server.url}/none/worker.js`, workers: 2};
    const r = await loaded({browser: b.browser, url: server.url}, null, `${server.url}/packages/meshopt.texmesh`,
      {open: none, load: {...none, time: 3, autoRefine: false}});
    check(!r.error && r.state.scale >= 0, JSON.stringify(r.error));
    check(errorsOf(r).length === 1 && /texmesh\/worker/.test(errorsOf(r)[0]), JSON.stringify(errorsOf(r)));
    const asked = server.requests.filter((q) => q.path === '/none/worker.js').length;
    check(asked <= 6, `the worker was asked for ${asked} times`);
    await r.page.close();
    // Only open() was told a wrong place: the load's own workers do.
    const right = await rightFrom({browser: b.browser}, server.url, 'maps.texmesh', {options: {open: none, load: kEverything}});
    check(errorsOf(right).length === 0, JSON.stringify(errorsOf(right)));
    await right.page.close();
  } finally { await server.close(); }
}, {seconds: 90});

test('a worker that dies while it decodes the manifest is replaced', async () => {
  const b = await common();
  const page = await labPage(b.browser, b.url, () => {
    window.started = 0;
    window.Worker = class extends Worker {
      constructor(...all) {
        super(...all);
        this.number = window.started++;
      }
      postMessage(message, ...rest) {
        if (this.number > 0) return super.postMessage(message, ...rest);
        setTimeout(() => {
          this.terminate();
          this.dispatchEvent(new ErrorEvent('error', {cancelable: true}));
        }, 0);
      }
    };
  });
  await lab(page, () => window.lab.start({size: 256}));
  const r = await loaded(null, page, `${b.url}/packages/maps.texmesh`, {load: kEverything});
  check(!r.error && errorsOf(r).length === 0, JSON.stringify([r.error, errorsOf(r)]));
  const d = await comparePlane(page, r.id, r.state.planes[0].base, 'maps', kTopQuality);
  check(d.most <= 3, `texture differs by ${d.most}`);
  check(await lab(page, () => window.started) > 1, 'no other worker was started');
  await page.close();
}, {seconds: 60});
