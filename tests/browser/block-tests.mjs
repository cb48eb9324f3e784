// Textures as blocks of 4 x 4 texels: what the GPU shows of every format, what is stored and counted, what memory makes of it, and how fast
// blocks are made.
import {check, common, lab, labPage, labRoots, serve} from './browser.mjs';
import {test} from './harness.mjs';
import {countStorage, onlyFormats} from './gpu-storage.mjs';
import {comparePlane, kEverything, kTopQuality, loaded} from './loads.mjs';

/** Runs in the page before the library: writes down what is uploaded. */
function noteUploads() {
  const uploads = (window.uploads = []);
  for (const name of ['compressedTexSubImage2D', 'texSubImage2D']) {
    const upload = WebGL2RenderingContext.prototype[name];
    WebGL2RenderingContext.prototype[name] = function (...all) {
      const start = performance.now();
      upload.apply(this, all);
      uploads.push({name, width: all[4], height: all[5], ms: performance.now() - start});
    };
  }
}
const before = (formats) => `(${countStorage})();(${onlyFormats})(${JSON.stringify(formats)});(${noteUploads})();`;

/** Loads a package whose textures become blocks of these formats. */
async function inBlocks(b, formats, name, load = {}, url = b.url) {
  const page = await labPage(b.browser, url, before(formats));
  await lab(page, () => window.lab.start({size: 256}));
  const r = await loaded(null, page, `${url}/packages/${name}.texmesh`, {load: {...kEverything, compress: 'always', ...load}});
  check(!r.error, JSON.stringify(r.error));
  return r;
}
const errorsOf = (r) => r.events.filter((e) => e.name === 'error').map((e) => `${e.what}: ${e.message}`);
const texelsOf = (r) => Object.fromEntries(r.state.planes.map((p) => [p.role, p.texels]));
const normalOf = {bc7: 'bc5', astc: 'astc-normal', bc1: 'bc3-normal', etc2: 'rgba8'};

/** Extensions, the format of colours, and how far an 8-bit value may be off in the mean: make_scan's pictures are all edges. */
const kFormats = [
  [['texture_compression_bptc', 'texture_compression_rgtc'], 'bc7', 2.5],
  [['texture_astc'], 'astc', 2.5],
  [['texture_s3tc', 'texture_s3tc_srgb'], 'bc1', 4.5],
  [['texture_etc'], 'etc2', 4.5],
];
for (const [extensions, format, off] of kFormats)
  test(`textures as ${format}: what the GPU shows is the texture, what is stored is what is counted`, async () => {
    const b = await common();
    const r = await inBlocks(b, extensions, 'maps');
    check(errorsOf(r).length === 0, errorsOf(r).join('\n'));
    const {normal, ...others} = texelsOf(r);
    check(normal === normalOf[format] && Object.values(others).every((t) => t === format), JSON.stringify(texelsOf(r)));
    for (const p of r.state.planes) {
      const d = await comparePlane(r.page, r.id, p.base, 'maps', kTopQuality);
      const close = p.role === 'normal' ? d.degrees < 2 : d.mean < off;
      check(d.n > 0 && close && (d.mean > 0 || p.texels === 'rgba8'), `${p.role} as ${p.texels}: ${d.mean.toFixed(2)} off in the mean, ${d.most} at most, ${d.degrees.toFixed(2)} degrees`);
      if (p.texels === 'rgba8') continue;
      const levels = await lab(r.page, ([i, base]) => window.lab.blockLevels(i, base), [r.id, p.base]);
      check(levels.length >= 8 && levels.every((l) => l.mean < 6 || l.mean < 0.7 * l.moved), `${p.role}: levels ${JSON.stringify(levels)}`);
    }
    const stored = await lab(r.page, () => window.storedBytes());
    check(Math.abs(r.state.gpuBytes - stored) <= 0.02 * stored + 70000, `${r.state.gpuBytes} bytes are counted, ${stored} stored`);
    check(r.page.said.length === 0, r.page.said.join('\n'));
    await lab(r.page, (i) => window.lab.dispose(i), r.id);
    const left = await lab(r.page, () => window.storedBytes());
    check(left < 0.02 * stored + 70000, `${left} bytes are left of ${stored}`);
    await r.page.close();
  }, {seconds: 90});

test('a lit picture with textures as blocks is that with RGBA', async () => {
  const b = await common();
  const shots = [];
  for (const compress of ['never', 'always']) {
    const r = await inBlocks(b, ['texture_compression_bptc', 'texture_compression_rgtc'], 'maps', {compress});
    shots.push(await lab(r.page, () => { window.lab.draw(); return [...window.lab.pixels()]; }));
    check(r.page.said.length === 0, r.page.said.join('\n'));
    await r.page.close();
  }
  const off = shots[0].map((v, i) => Math.abs(v - shots[1][i]));
  const mean = off.reduce((a, d) => a + d, 0) / off.length;
  check(mean < 1 && mean > 0, `${mean.toFixed(3)} off in the mean, ${off.reduce((a, d) => Math.max(a, d))} at most`);
});

test('a limit of memory takes blocks where RGBA would be coarser, and RGBA where all fits', async () => {
  const b = await common();
  const server = await serve(labRoots);
  const of = async (load) => {
    const page = await labPage(b.browser, server.url, before(['texture_compression_bptc', 'texture_compression_rgtc']));
    await lab(page, () => window.lab.start({size: 512}));
    const r = await loaded(null, page, `${server.url}/packages/large.texmesh`, {load: {time: 20, display: 3000, autoRefine: false, ...load}, follow: false});
    check(!r.error && errorsOf(r).length === 0, JSON.stringify([r.error, errorsOf(r)]));
    await page.close();
    return r;
  };
  const asked = () => server.requests.some((q) => /blocks\.js|compression/.test(q.path));
  try {
    const plain = await of({});
    check(plain.state.planes.every((p) => p.texels === 'rgba8') && !asked(), 'blocks without a limit');
    const enough = await of({memoryBytes: 2 * plain.state.gpuBytes});
    check(enough.state.planes.every((p) => p.texels === 'rgba8') && !asked(), 'blocks where all fits');
    const memoryBytes = 0.5 * plain.state.gpuBytes;
    const never = await of({memoryBytes, compress: 'never'});
    const auto = await of({memoryBytes});
    const width = (r) => Math.max(...r.state.planes.map((p) => p.widthPx));
    check(auto.state.planes.every((p) => p.texels === 'bc7') && asked(), JSON.stringify(auto.state.planes));
    check(width(auto) > width(never), `${width(auto)} px beside ${width(never)}`);
    for (const r of [never, auto]) check(r.state.gpuBytes <= memoryBytes, `${r.state.gpuBytes} of ${memoryBytes}`);
    check(auto.state.planes.every((p) => p.rungs.some((k) => k > 0)), 'fragments are missing');
  } finally { await server.close(); }
}, {seconds: 120});

test('without what makes blocks, textures are RGBA, and that is said', async () => {
  const b = await common();
  const server = await serve(labRoots, {fault: (q) => (/blocks\.js/.test(q.path) ? {status: 404} : undefined)});
  try {
    const r = await inBlocks(b, ['texture_compression_bptc'], 'maps', {}, server.url);
    check(r.state.planes.every((p) => p.texels === 'rgba8'), JSON.stringify(texelsOf(r)));
    check(errorsOf(r).length === 1 && /compressed textures/.test(errorsOf(r)[0]), errorsOf(r).join('\n'));
    await r.page.close();
  } finally { await server.close(); }
});

test('a lost context begins with previews as blocks and gets its fragments again', async () => {
  const b = await common();
  const r = await inBlocks(b, ['texture_compression_bptc', 'texture_compression_rgtc'], 'maps', {autoRefine: true});
  const rungs = await lab(r.page, async (i) => {
    const {model} = window.lab.loads[i];
    const lose = window.lab.stage().renderer.getContext().getExtension('WEBGL_lose_context');
    const done = new Promise((end) => model.on('done', end));
    lose.loseContext();
    await new Promise((go) => setTimeout(go, 100));
    lose.restoreContext();
    await done;
    return model.state.planes.map((p) => [p.texels, Math.max(...p.rungs)]);
  }, r.id);
  check(rungs.every(([texels, rung]) => texels !== 'rgba8' && rung > 0), JSON.stringify(rungs));
  await r.page.close();
});

test('blocks of every format are made in a worker, and uploads are short', async () => {
  const b = await common();
  const page = await labPage(b.browser, b.url);
  const speeds = await lab(page, () => window.lab.blockSpeeds());
  console.log(`         ${Object.entries(speeds).map(([name, v]) => `${name} ${v.toFixed(0)}`).join(', ')} Mpixel/s in one worker`);
  // A sixth of what docs/figures.md says: other tests run beside.
  for (const [name, v] of Object.entries(speeds)) check(v > (name === 'bc7' || name.startsWith('astc') ? 3 : 10), `${name}: ${v} Mpixel/s`);
  await page.close();
  const r = await inBlocks(b, ['texture_compression_bptc', 'texture_compression_rgtc'], 'large');
  const uploads = await lab(r.page, () => window.uploads.filter((u) => u.name === 'compressedTexSubImage2D'));
  const most = Math.max(...uploads.map((u) => u.width * u.height));
  check(uploads.length > 20 && most <= 1 << 18, `${uploads.length} uploads, ${most} texels at most`);
  const ms = uploads.map((u) => u.ms).sort((a, c) => a - c);
  console.log(`         uploads: ${uploads.length}, ${ms[Math.floor(0.99 * ms.length)].toFixed(2)} ms at the 99th percentile`);
  check(ms[Math.floor(0.95 * ms.length)] <= 4, `${ms.slice(-5).join()} ms`);
  await r.page.close();
}, {seconds: 120});
