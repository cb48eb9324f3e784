// What a page pays for the library: the files that ordinary loads fetch, against what its build says.
import {check, common, env, fs, lab, labPage, labRoots, path, serve} from './browser.mjs';
import {test} from './harness.mjs';
import {loaded} from './loads.mjs';
import {gzipSync} from 'node:zlib';

/** Runs in the page before the library: a browser with a GPU, as most have. */
function withGpu() {
  const own = WebGL2RenderingContext.prototype.getParameter;
  WebGL2RenderingContext.prototype.getParameter = function (name) {
    return name === 0x9246 ? 'ANGLE (a GPU)' : own.call(this, name); // UNMASKED_RENDERER_WEBGL
  };
}

/** The camera goes around the object and to and fro. */
const orbit = (page, id, seconds) => lab(page, async ([i, s]) => {
  const {camera, centre, radius} = window.lab.stage();
  const {model} = window.lab.loads[i];
  const away = camera.position.distanceTo(centre);
  for (const begun = performance.now(); performance.now() - begun < 1000 * s; await new Promise((go) => requestAnimationFrame(go))) {
    const t = (performance.now() - begun) / 1000;
    camera.position.set(Math.sin(t), 0.3, Math.cos(t)).setLength(Math.max(0.9 * radius, away * (1 - 0.3 * t))).add(centre);
    camera.lookAt(centre);
    model.update(camera);
    window.lab.draw();
  }
  await model.refine();
  return model.state;
}, [id, seconds]);

test('ordinary loads fetch no more of the library than its build counts', async () => {
  const b = await common();
  const server = await serve(labRoots);
  const [, limit] = /\ball: ([\d.]+) \* 1024/.exec(fs.readFileSync(path.join(env.source, 'delivery/web/build.mjs'), 'utf8'));
  const page = await labPage(b.browser, server.url, withGpu);
  const counted = () => {
    const names = [...new Set(server.requests.map((q) => q.path))].filter((p) => /^\/texmesh\/.*\.js$/.test(p) && !p.endsWith('/worker.js')).sort();
    const sizes = names.map((name) => {
      const code = fs.readFileSync(path.join(labRoots['/texmesh/'], path.basename(name)), 'utf8').replace(/\n\/\/# sourceMapping.*\n?$/, '');
      return gzipSync(code, {level: 9}).length;
    });
    return {files: names.map((name, i) => `${path.basename(name)} ${sizes[i]}`).join(', '), sum: sizes.reduce((a, n) => a + n, 0)};
  };
  try {
    // The page of the laboratory has the worker's module beside it for loads without workers.
    await lab(page, () => window.lab.start({size: 256, zoom: 0.3}));
    for (const [name, load] of [['large', {meshes: 'stream', time: 2}], ['large', {meshes: 'glb', time: 2}], ['progressive', {time: 1}]]) {
      const r = await loaded(null, page, `${server.url}/packages/${name}.texmesh`, {load});
      check(!r.error && !r.events.some((e) => e.name === 'error'), JSON.stringify(r.error ?? r.events.filter((e) => e.name === 'error')));
      const {planes, scale} = await orbit(page, r.id, env.full ? 60 : 4);
      check(scale >= 0 && planes.some((p) => Object.values(p.rungs).some((k) => k > 0)), `${name}: nothing was refined`);
      // A second load from the same package, which outlives the first.
      const again = await lab(page, async (i) => {
        const {lab} = window;
        const {renderer, scene, camera} = lab.stage();
        const model = lab.loads[i].pkg.load(scene, {renderer, gltfLoader: lab.gltfLoader, camera, time: 1});
        await model.done;
        lab.loads[i].model.dispose();
        await model.refine();
        const {phase} = model.state;
        model.dispose();
        return phase;
      }, r.id);
      check(again === 'done', `the second load is ${again}`);
      await lab(page, (i) => window.lab.dispose(i), r.id);
    }
    const {files, sum} = counted();
    console.log(`         the library: ${(sum / 1024).toFixed(2)} KB gzip of ${limit}: ${files}`);
    check(/open\.js/.test(files) && /open-texture_load\.js/.test(files), files);
    check(sum <= limit * 1024, `${sum} bytes, more than ${limit} KB: ${files}`);
    check(server.requests.some((q) => q.path === '/texmesh/worker.js'), 'no worker came');
  } finally {
    await page.close();
    await server.close();
  }
}, {seconds: 240});
