// The page that tests and figures drive: the client library alone, a fixed camera, and everything that happens written down.
import {TexmeshPackage, open} from 'texmesh';
import {handle} from 'texmesh/worker';
import {
  Box3, Color, DirectionalLight, HemisphereLight, Mesh, OrthographicCamera, PerspectiveCamera, PlaneGeometry, Scene, ShaderMaterial, Vector3, WebGLRenderer, WebGLRenderTarget,
} from 'three';
import {DRACOLoader} from 'three/addons/loaders/DRACOLoader.js';
import {GLTFLoader} from 'three/addons/loaders/GLTFLoader.js';
import {MeshoptDecoder} from 'three/addons/libs/meshopt_decoder.module.js';

const draco = new DRACOLoader().setDecoderPath('/three/examples/jsm/libs/draco/gltf/').setWorkerLimit(2);
const gltfLoader = () => new GLTFLoader().setDRACOLoader(draco).setMeshoptDecoder(MeshoptDecoder);

let stage;
const loads = [];
const longTasks = [];
new PerformanceObserver((list) => {
  for (const e of list.getEntries()) longTasks.push({start: e.startTime, ms: e.duration});
}).observe({type: 'longtask', buffered: true});

/** A canvas of `size` px and a camera that sees a box of the object whole; by default that of make_scan's objects. */
function start({size = 512, min = [-0.13, -0.18, -0.13], max = [0.13, 0.18, 0.18], azimuth = 30, elevation = 15, zoom = 1, background = 0x808080} = {}) {
  stage?.renderer.dispose();
  document.body.replaceChildren();
  const renderer = new WebGLRenderer({antialias: true, preserveDrawingBuffer: true});
  renderer.setPixelRatio(1);
  renderer.setSize(size, size);
  document.body.append(renderer.domElement);
  const scene = new Scene();
  scene.background = new Color(background);
  const box = new Box3(new Vector3(...min), new Vector3(...max));
  const centre = box.getCenter(new Vector3());
  const radius = box.getSize(new Vector3()).length() / 2 || 1;
  const camera = new PerspectiveCamera(30, 1, radius / 100, radius * 20);
  const [a, e] = [azimuth, elevation].map((d) => (d * Math.PI) / 180);
  const direction = new Vector3(Math.sin(a) * Math.cos(e), Math.sin(e), Math.cos(a) * Math.cos(e));
  camera.position.copy(centre).addScaledVector(direction, (1.02 * radius) / Math.sin((15 * Math.PI) / 180) / zoom);
  camera.lookAt(centre);
  camera.updateMatrixWorld();
  const lamp = new DirectionalLight(0xffffff, 1.5);
  lamp.position.copy(camera.position).add(new Vector3(0, radius, 0));
  lamp.target.position.copy(centre);
  scene.add(new HemisphereLight(0xffffff, 0xcccccc, 2), lamp, lamp.target);
  stage = {renderer, scene, camera, size, radius, centre};
}

const draw = () => stage.renderer.render(stage.scene, stage.camera);

/** RGBA of the canvas, top row first. */
function pixels() {
  const {size} = stage;
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = size;
  const c = canvas.getContext('2d');
  c.drawImage(stage.renderer.domElement, 0, 0);
  return c.getImageData(0, 0, size, size).data;
}

/**
 * Opens and loads a package; events, requests and, with `frames`, pictures are kept. Comes back at once with a number;
 * `finished` waits. `load` takes LoadOptions without renderer, loader and camera; `follow` gives the camera, too. With `memory`,
 * all of it is fetched before the clock starts; with `still`, nothing is drawn before the end; with `always`, every frame of the page is
 * drawn, as pages do that move. `here`: no workers. `px`: displayed height, which may be changed later.
 */
function load(url, {open: openOptions = {}, load: loadOptions = {}, frames = 0, follow = true, memory = false, still = false, always = false, here = false, px} = {}) {
  const run = {events: [], requests: [], frames: [], error: null, t0: performance.now(), pkg: null, model: null, px, abort: new AbortController()};
  loads.push(run);
  let dirty = true;
  let over = false;
  let lastFrame = -1e9;
  const note = (name) => (e) => {
    run.events.push({name, ...e, error: undefined, at: (e.at - run.t0) / 1000});
    if (['first-picture', 'proxy', 'scale', 'fragment', 'plane', 'deadline', 'done'].includes(name)) dirty = true;
  };
  const tick = () => {
    if (over === 'yes') return;
    if (run.model) run.model.update(px ? undefined : stage.camera);
    const now = performance.now();
    if ((dirty || always) && (!still || over) && (!frames || now - lastFrame >= frames || over)) {
      dirty = false;
      lastFrame = now;
      draw();
      // The picture stands on the screen now: its time is this, whatever reading it back takes.
      if (frames) run.frames.push({at: (now - run.t0) / 1000, data: pixels()});
    }
    if (over) { over = 'yes'; run.drawn(); return; }
    requestAnimationFrame(tick);
  };
  run.whole = new Promise((done) => { run.drawn = done; });
  run.promise = (async () => {
    try {
      const bytes = memory ? new Uint8Array(await (await fetch(url)).arrayBuffer()) : null;
      if (memory) run.t0 = performance.now();
      const pkg = bytes ? await TexmeshPackage.openBytes(bytes) : await open(url, {signal: run.abort.signal, ...openOptions});
      run.pkg = pkg;
      run.requests.push(...pkg.requests);
      pkg.onRequest((r) => run.requests.push(r));
      const model = pkg.load(stage.scene, {
        renderer: stage.renderer, gltfLoader, ...(follow && !px ? {camera: stage.camera} : {}), ...(here ? {decode: handle} : {}),
        ...(px ? {display: () => run.px} : {}), signal: run.abort.signal, ...loadOptions,
      });
      run.model = model;
      for (const name of ['first-picture', 'proxy', 'scale', 'plane', 'fragment', 'decision', 'progress', 'deadline', 'context', 'error', 'done'])
        model.on(name, note(name));
      requestAnimationFrame(tick);
      await model.done;
    } catch (error) {
      run.error = {name: error.name, message: error.message};
    }
    run.endedAt = (performance.now() - run.t0) / 1000;
    over = true;
    if (run.model) await run.whole;
  })();
  return loads.length - 1;
}

/** What became of a load, once its timed part is over. */
async function finished(id) {
  const run = loads[id];
  await run.promise;
  return report(id);
}

function report(id) {
  const run = loads[id];
  const s = run.model?.state;
  return {
    error: run.error, events: run.events, endedAt: run.endedAt,
    requests: run.requests.map((r) => ({...r, started: r.started - run.t0 / 1000, firstByte: r.firstByte - run.t0 / 1000, ended: r.ended - run.t0 / 1000})),
    state: s && {
      phase: s.phase, scale: s.scale, proxy: s.proxy, wantedScale: s.wantedScale, displayedPx: s.displayedPx, bytes: s.bytes, gpuBytes: s.gpuBytes, pending: s.pending, rttS: s.rttS,
      planes: s.planes.map((p) => ({base: p.base, plane: p.plane, role: p.role, texels: p.texels, widthPx: p.widthPx, heightPx: p.heightPx, rungs: [...p.rungs]})),
    },
    longTasks: longTasks.filter((t) => t.start >= run.t0).map((t) => ({...t, start: (t.start - run.t0) / 1000})),
  };
}

/** A composed plane, as base64 so that it comes over quickly. */
function plane(id, base) {
  const run = loads[id];
  const shown = run.model.state.planes.find((p) => p.base === base);
  return {...toBase64(run.model.readPlane(base)), widthPx: shown.widthPx, heightPx: shown.heightPx, plane: shown.plane, rungs: [...shown.rungs]};
}

/** Each mip level of a composed plane against the mean of four texels of the level before: mean and greatest difference of 8-bit values. */
function levels(id, base) {
  const shown = loads[id].model.state.planes.find((p) => p.base === base);
  const gl = stage.renderer.getContext();
  const {__webglTexture: texture} = stage.renderer.properties.get(shown.textures[0]);
  const frame = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
  const out = [];
  let before;
  for (let level = 0, [w, h] = [shown.widthPx, shown.heightPx]; ; level++, w = Math.max(1, w >> 1), h = Math.max(1, h >> 1)) {
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, level);
    if (gl.checkFramebufferStatus(gl.FRAMEBUFFER) !== gl.FRAMEBUFFER_COMPLETE) break;
    const data = new Uint8Array(4 * w * h);
    gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, data);
    if (before) {
      let [most, sum] = [0, 0];
      const at = (x, y, c) => before.data[4 * (Math.min(y, before.h - 1) * before.w + Math.min(x, before.w - 1)) + c];
      for (let y = 0; y < h; y++)
        for (let x = 0; x < w; x++)
          for (let c = 0; c < 4; c++) {
            const mean = (at(2 * x, 2 * y, c) + at(2 * x + 1, 2 * y, c) + at(2 * x, 2 * y + 1, c) + at(2 * x + 1, 2 * y + 1, c)) / 4;
            const d = Math.abs(data[4 * (y * w + x) + c] - mean);
            most = Math.max(most, d);
            sum += d;
          }
      out.push({level, w, h, most, mean: sum / (4 * w * h)});
    }
    before = {w, h, data};
    if (w === 1 && h === 1) break;
  }
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.deleteFramebuffer(frame);
  stage.renderer.resetState();
  return out;
}

/** As levels(), for a texture of blocks: each level is drawn. Means alone, and what they were of a level that stood a texel aside. */
function blockLevels(id, base) {
  const shown = loads[id].model.state.planes.find((p) => p.base === base);
  const {renderer} = stage;
  const out = [];
  const material = new ShaderMaterial({
    depthTest: false, depthWrite: false, uniforms: {map: {value: shown.textures[0]}, level: {value: 0}},
    vertexShader: 'varying vec2 at; void main() { at = uv; gl_Position = vec4(position.xy * 2.0, 0.0, 1.0); }',
    fragmentShader: 'varying vec2 at; uniform sampler2D map; uniform int level; void main() { gl_FragColor = texelFetch(map, ivec2(at * vec2(textureSize(map, level))), level); }',
  });
  const square = new Mesh(new PlaneGeometry(1, 1), material);
  square.frustumCulled = false;
  let before;
  for (let level = 0, [w, h] = [shown.widthPx, shown.heightPx]; ; level++, w = Math.max(1, w >> 1), h = Math.max(1, h >> 1)) {
    material.uniforms.level.value = level;
    const target = new WebGLRenderTarget(w, h, {colorSpace: shown.textures[0].colorSpace, depthBuffer: false});
    renderer.setRenderTarget(target);
    renderer.render(square, new OrthographicCamera());
    const data = new Uint8Array(4 * w * h);
    renderer.readRenderTargetPixels(target, 0, 0, w, h, data);
    renderer.setRenderTarget(null);
    target.dispose();
    if (before) {
      const off = (by) => {
        let sum = 0;
        const at = (x, y, c) => before.data[4 * (Math.min(y, before.h - 1) * before.w + Math.min(x, before.w - 1)) + c];
        for (let y = 0; y < h; y++)
          for (let x = 0; x < w; x++)
            for (let c = 0; c < 3; c++) {
              const [u, v] = [2 * ((x + by) % w), 2 * ((y + by) % h)];
              sum += Math.abs(data[4 * (y * w + x) + c] - (at(u, v, c) + at(u + 1, v, c) + at(u, v + 1, c) + at(u + 1, v + 1, c)) / 4);
            }
        return sum / (3 * w * h);
      };
      out.push({level, mean: off(0), moved: off(1)});
    }
    before = {w, h, data};
    if (w === 1 && h === 1) return out;
  }
}

/** Mpixel/s of a worker that makes blocks of a picture with shades, edges and noise, by format: of the fastest of many rounds. */
async function blockSpeeds() {
  const side = 256; // so little that a busy machine gives some of the rounds a processor of their own
  const source = `onmessage = async () => {
    const {toBlocks} = await import('${new URL('/texmesh/blocks.js', location.href)}');
    const pixels = Uint8Array.from({length: 4 * ${side} * ${side}}, (_, i) => {
      const [x, y] = [(i >> 2) % ${side}, Math.floor((i >> 2) / ${side})];
      return 128 + 60 * Math.sin(x / 19 + i % 4) * Math.cos(y / 23) + (x + y > 180 ? 40 : 0) + (Math.imul(i, 2654435761) >>> 28);
    });
    const speeds = {};
    for (const format of ['bc1', 'bc3-normal', 'bc5', 'bc7', 'etc2', 'astc', 'astc-normal']) {
      const once = async () => { const start = performance.now(); await toBlocks({pixels, width: ${side}, height: ${side}}, {format, own: 1, size: [${side}, ${side}]}); return performance.now() - start; };
      const ms = [];
      for (let i = 0; i < 80; i++) ms.push(await once());
      speeds[format] = ${side} * ${side} / 1000 / Math.min(...ms);
    }
    postMessage(speeds);
  };`;
  const worker = new Worker(URL.createObjectURL(new Blob([source], {type: 'text/javascript'})), {type: 'module'});
  const speeds = await new Promise((done, fail) => { worker.onmessage = (e) => done(e.data); worker.onerror = fail; worker.postMessage(0); });
  worker.terminate();
  return speeds;
}

function toBase64(bytes) {
  let text = '';
  for (let i = 0; i < bytes.length; i += 0x8000) text += String.fromCharCode(...bytes.subarray(i, i + 0x8000));
  return {base64: btoa(text)};
}

function dispose(id) {
  const run = loads[id];
  run.model?.dispose();
  run.pkg?.dispose();
  run.frames = [];
  loads[id] = {events: [], requests: []};
  draw();
}

/** A plain GLB, as any page would load it; shown when all of it is there. */
function loadGlb(url, {frames = 0} = {}) {
  const run = {frames: [], t0: performance.now(), events: [], requests: []};
  loads.push(run);
  run.promise = (async () => {
    const bytes = await (await fetch(url, {cache: 'no-store'})).arrayBuffer();
    run.bytes = bytes.byteLength;
    const gltf = await gltfLoader().parseAsync(bytes, url.replace(/[^/]*$/, ''));
    run.object = gltf.scene;
    stage.scene.add(gltf.scene);
    draw();
    run.endedAt = (performance.now() - run.t0) / 1000;
    if (frames) run.frames.push({at: run.endedAt, data: pixels()});
  })();
  return loads.length - 1;
}

/** Mean SSIM of luma over covered pixels (8 x 8 windows, step 4), against a kept picture. */
function ssim(a, b, size) {
  const luma = (d) => {
    const l = new Float32Array(size * size);
    for (let i = 0; i < l.length; i++) l[i] = 0.2126 * d[4 * i] + 0.7152 * d[4 * i + 1] + 0.0722 * d[4 * i + 2];
    return l;
  };
  const [x, y] = [luma(a), luma(b)];
  const covered = (i) => Math.abs(b[4 * i] - 128) + Math.abs(b[4 * i + 1] - 128) + Math.abs(b[4 * i + 2] - 128) > 6;
  let [sum, n] = [0, 0];
  for (let v = 0; v + 8 <= size; v += 4)
    for (let u = 0; u + 8 <= size; u += 4) {
      let [sx, sy, sxx, syy, sxy, c] = [0, 0, 0, 0, 0, 0];
      for (let j = 0; j < 8; j++)
        for (let i = 0; i < 8; i++) {
          const k = (v + j) * size + u + i;
          const [p, q] = [x[k], y[k]];
          sx += p; sy += q; sxx += p * p; syy += q * q; sxy += p * q;
          c += covered(k);
        }
      if (c < 32) continue;
      const [mx, my] = [sx / 64, sy / 64];
      const [vx, vy, cv] = [sxx / 64 - mx * mx, syy / 64 - my * my, sxy / 64 - mx * my];
      sum += ((2 * mx * my + 6.5025) * (2 * cv + 58.5225)) / ((mx * mx + my * my + 6.5025) * (vx + vy + 58.5225));
      n++;
    }
  return n ? sum / n : 0;
}

let reference = null;
/** Keeps the last picture of a load (or of the canvas) as the reference. */
function keepReference() {
  draw();
  reference = pixels();
}
function clear(id) {
  stage.scene.remove(loads[id].object);
}
/** [seconds, SSIM] of a load's pictures. */
function qualityOverTime(id) {
  return loads[id].frames.map((f) => [f.at, ssim(f.data, reference, stage.size)]);
}

/** Milliseconds from a JPEG's bytes to a texture with mip levels on the GPU, as a page would do it. */
async function wholeJpeg(url) {
  const blob = new Blob([await (await fetch(url)).arrayBuffer()], {type: 'image/jpeg'});
  const gl = stage.renderer.getContext();
  const begun = performance.now();
  const image = await createImageBitmap(blob, {colorSpaceConversion: 'none', premultiplyAlpha: 'none'});
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.SRGB8_ALPHA8, gl.RGBA, gl.UNSIGNED_BYTE, image);
  gl.generateMipmap(gl.TEXTURE_2D);
  settle(texture);
  const ms = performance.now() - begun;
  gl.deleteTexture(texture);
  image.close();
  stage.renderer.resetState();
  return ms;
}

/** Waits until the GPU has done what was asked: reads a pixel of the texture, or of the canvas. */
function settle(texture) {
  const gl = stage.renderer.getContext();
  const pixel = new Uint8Array(4);
  if (!texture) return gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
  const frame = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.deleteFramebuffer(frame);
}

/** Triangles of all visible meshes beneath an object: corners and texture coordinates, [15 each]. */
function trianglesOf(root) {
  const out = [];
  root.updateMatrixWorld(true);
  root.traverse((o) => {
    if (!o.isMesh) return;
    const {index, drawRange, groups, attributes: {position, uv}} = o.geometry;
    const count = index ? index.count : position.count;
    const parts = groups.length ? groups : [{start: 0, count: Infinity}];
    const p = new Vector3();
    for (const g of parts) {
      const from = Math.max(g.start, drawRange.start);
      const to = Math.min(g.start + g.count, drawRange.start + drawRange.count, count);
      for (let t = from; t + 2 < to; t += 3) {
        const corners = [0, 1, 2].map((k) => (index ? index.getX(t + k) : t + k));
        const at = corners.map((i) => { p.fromBufferAttribute(position, i).applyMatrix4(o.matrixWorld); return [p.x, p.y, p.z, uv ? uv.getX(i) : 0, uv ? uv.getY(i) : 0]; });
        out.push(at);
      }
    }
  });
  return out;
}

/** Each triangle of a load's mesh against those of a GLB: the same corners, in any order and to a thousandth of the extent. */
async function compareMesh(id, glb) {
  const own = trianglesOf(loads[id].model.object);
  const gltf = await gltfLoader().parseAsync(await (await fetch(glb)).arrayBuffer(), '');
  const theirs = trianglesOf(gltf.scene);
  const {boundsMin: min, boundsMax: max} = loads[id].pkg.manifest;
  const extent = Math.max(...max.map((v, k) => v - min[k]));
  const eps = 1e-3;
  const middle = (t) => [0, 1, 2].map((k) => (t[0][k] + t[1][k] + t[2][k]) / 3 / extent);
  const cell = (m) => m.map((v) => Math.floor(v / eps));
  const grid = new Map();
  theirs.forEach((t, i) => {
    const key = cell(middle(t)).join();
    grid.set(key, [...(grid.get(key) ?? []), i]);
  });
  const taken = new Uint8Array(theirs.length);
  const apart = (a, b) => {
    let best = Infinity;
    for (let turn = 0; turn < 3; turn++) {
      let most = 0;
      for (let c = 0; c < 3; c++) {
        const [x, y] = [a[c], b[(c + turn) % 3]];
        most = Math.max(most, Math.hypot(x[0] - y[0], x[1] - y[1], x[2] - y[2]) / extent, Math.abs(x[3] - y[3]), Math.abs(x[4] - y[4]));
      }
      best = Math.min(best, most);
    }
    return best;
  };
  let [unmatched, farthest] = [0, 0];
  for (const t of own) {
    const [x, y, z] = cell(middle(t));
    let [at, best] = [-1, Infinity];
    for (let k = 0; k < 27; k++)
      for (const i of grid.get([x + (k % 3) - 1, y + (Math.floor(k / 3) % 3) - 1, z + Math.floor(k / 9) - 1].join()) ?? []) {
        const d = taken[i] ? Infinity : apart(t, theirs[i]);
        if (d < best) [at, best] = [i, d];
      }
    if (best <= eps) { taken[at] = 1; farthest = Math.max(farthest, best); } else unmatched++;
  }
  return {triangles: [own.length, theirs.length], unmatched, farthest};
}

const memory = () => ({
  ...stage.renderer.info.memory, programs: stage.renderer.info.programs.length, heap: performance.memory?.usedJSHeapSize ?? 0,
});

const gl = () => stage.renderer.getContext();

Object.assign(window, {
  lab: {
    start, draw, pixels, load, finished, report, plane, dispose, loadGlb, clear, keepReference, qualityOverTime, memory, loads, longTasks, gl,
    gltfLoader, toBase64, ssim, wholeJpeg, settle, compareMesh, levels, blockLevels, blockSpeeds, stage: () => stage, draco, open,
  },
  ready: true,
});
