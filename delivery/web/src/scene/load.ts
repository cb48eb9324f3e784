import { Camera, Group, Object3D, Scene } from 'three';
import { InputError, isAbort, throwIfAborted } from '../format/errors';
import { nowS, sleepS } from '../http/clock';
import type { PackageReader } from '../http/package_reader';
import type { WorkerPool } from '../worker/pool';
import type { Display, LoadEvents, LoadOptions, LoadPhase, LoadedModel } from './api';
import { displayOf } from './camera';
import { Emitter } from './events';
import { gpuIdle, programsReady } from './gpu';
import { LoadContext, hysteresis } from './load_context';
import { MaterialSet, texturesOf } from './scale_parts';
import { scaleSource } from './scale_source';
import type { TextureLoad } from './texture_load';

/** A picture that waits for its programs no longer than this. */
const mostCompileS = 0.5;
/** A scale that could not be had is asked for again after so long, and twice as long each time. */
const retryScaleS = { first: 2, most: 60 };
/** Limits beyond are none: timers and plans end there. */
const longestS = 1e5;

interface Override {
  scale?: number;
  rung?: number;
}

/** Everything about one package in one scene, from `startS` on; `forget` is called at its end. */
export function loadModel(
  reader: PackageReader,
  scene: Object3D,
  options: LoadOptions,
  pool: WorkerPool,
  startS: number,
  forget: () => void,
): LoadedModel {
  const { manifest, client } = reader;
  const { renderer, autoRefine = true, time = 5 } = options;
  const events = new Emitter<LoadEvents>();
  const abort = new AbortController();
  const disposed = new AbortController();
  const { signal } = abort;
  const materials = new MaterialSet();
  const object = new Group();
  object.name = manifest.title || 'texmesh';
  pool.onNone = (error) => fail(error, 'workers');
  let phase: LoadPhase = 'first-picture';
  let coming: Promise<TextureLoad>;
  let textures: TextureLoad | undefined;
  let lastView = '';
  let retryScale = -1;
  let retryTimer: ReturnType<typeof setTimeout> | undefined;
  let retryS = retryScaleS.first;
  let refining: Promise<void> | undefined;
  let refineAgain = false;
  let restoring: Promise<void> | undefined;
  const scales = scaleSource(reader, options, materials, pool, signal, () => textures?.adopt(), fail);
  const load: LoadContext = {
    reader, options, pool, materials, object, scales, signal, fail, enter, lostScale,
    limitS: time > longestS ? Infinity : time,
    override: snapped(options),
    view: { display: readDisplay(options.camera), camera: options.camera },
    shownScale: -1,
    wantedScale: -1,
    beta0: 0,
    expectedBytes: 0,
    elapsedS: () => nowS() - startS,
    emit: (name, event) => events.emit(name, event),
    showScale: loadScale,
  };

  function fail(error: unknown, what: string, fatal = false): void {
    if (isAbort(error) || disposed.signal.aborted) return;
    events.emit('error', { fatal, what, message: error instanceof Error ? error.message : String(error), error });
  }
  function progress(): void {
    events.emit('progress', { phase, bytes: client.received, bytesExpected: Math.max(client.received, load.expectedBytes) });
  }
  function enter(next: LoadPhase): void {
    throwIfAborted(signal);
    phase = next;
    progress();
  }
  const resting = (): boolean => phase === 'refining' || phase === 'done';
  /** Nothing is left to fetch. */
  function finish(): void {
    phase = 'done';
    events.emit('done', {});
    progress();
  }

  // ---- the course of a load

  async function showFirst(): Promise<void> {
    await null; // listeners are added when the caller has the model
    throwIfAborted(signal);
    const { scale, glb } = manifest.scales.at(-1)!;
    load.expectedBytes = client.received + glb.bytes;
    enter('first-picture');
    // On a slow link nothing shares it with the first picture. What comes next is asked for while the GPU
    // prepares for it.
    const { shape, shown } = loadScale(scale);
    coming = Promise.all([import('./texture_load'), shape]).then(([part]) => part.textureLoad(load));
    coming.catch(() => undefined);
    await shown;
    model.update(load.view.camera); // by what is there, not by its bounds alone
    events.emit('first-picture', { scale, bytes: client.received });
  }
  async function showInTime(): Promise<void> {
    enter('tables');
    textures = await coming;
    throwIfAborted(signal);
    await textures.timedPart();
    phase = 'refining';
    if (autoRefine) void model.refine();
  }

  // ---- scales

  /** Loads a scale and puts it into the scene; what is complete on the way is shown, too. */
  function loadScale(scale: number): { arrived: Promise<void>; shape: Promise<Object3D>; shown: Promise<void> } {
    load.wantedScale = scale;
    const show = (k: number): void => {
      // Another scale may be wanted by now; what comes on the way to it must not be coarser than what is shown.
      if (load.wantedScale === scale && (k === scale || k < load.shownScale)) showScale(k);
    };
    const { arrived, shape } = scales.load(scale, show);
    const shown = shape.then(async (its) => {
      if (load.shownScale < 0) await compiled(its);
      show(scale);
    });
    return { arrived, shape, shown };
  }
  /** Programs and previews before they are first drawn with, each in a turn of its own: the page goes on while the GPU's process makes them. */
  async function compiled(shape: Object3D): Promise<void> {
    const goOn = (): void => throwIfAborted(signal);
    let root = scene;
    while (root.parent) root = root.parent;
    await sleepS(0);
    goOn();
    renderer.compile(shape, load.view.camera ?? new Camera(), root as Scene);
    await gpuIdle(renderer, mostCompileS); // or what comes next would wait for the programs
    await programsReady(renderer, mostCompileS, goOn);
    for (const [, texture] of materials.all.flatMap(texturesOf)) {
      await sleepS(0);
      goOn();
      renderer.initTexture(texture);
    }
    await gpuIdle(renderer, mostCompileS);
  }
  /** In one turn of the page: what is drawn next is the new scale, whole. */
  function showScale(scale: number): void {
    throwIfAborted(signal);
    const shape = scales.shape(scale)!;
    if (object.children[0] !== shape) object.clear().add(shape);
    if (!object.parent) scene.add(object);
    load.shownScale = scale;
    events.emit('scale', { scale, triangles: manifest.scales.find((s) => s.scale === scale)!.triangles });
  }

  // ---- following the view

  function readDisplay(camera?: Camera): Display {
    const { display } = options;
    const said = (typeof display === 'function' ? display() : display) ?? (camera ? displayOf(manifest, object, camera, renderer) : 1000);
    return typeof said === 'number' ? { heightPx: said } : said;
  }
  /** A scale that the package has, as near as possible. InputError: no numbers of scale or rung. */
  function snapped({ scale, rung }: Override): Override {
    for (const [name, v] of Object.entries({ scale, rung }))
      if (v !== undefined && !(Number.isInteger(v) && v >= 0)) throw new InputError('options', name, 'a whole number from 0 on', String(v));
    const away = (k: number): number => Math.abs(k - scale!);
    const near = manifest.scales.map((s) => s.scale).reduce((best, k) => (away(k) < away(best) ? k : best));
    return { scale: scale === undefined ? scale : near, rung };
  }
  function follow(always = autoRefine): void {
    void followScale();
    if (always) void model.refine();
  }
  /** Loads the scale that the view asks for, if it is another one. */
  async function followScale(scale = scaleForView()): Promise<void> {
    if (scale === load.wantedScale || scale === retryScale) return;
    try {
      await loadScale(scale).shown;
      retryS = retryScaleS.first;
    } catch (error) {
      lostScale(error, scale);
    }
  }
  /** What is shown stays; the scale, or what is wanted by then, is asked for again a little later. */
  function lostScale(error: unknown, scale: number): void {
    fail(error, `scale ${scale}`);
    if (load.wantedScale === scale) load.wantedScale = load.shownScale;
    endRetry();
    if (signal.aborted) return;
    retryScale = scale;
    retryTimer = setTimeout(() => {
      retryScale = -1;
      void followScale(resting() ? undefined : scale);
    }, 1000 * retryS);
    retryS = Math.min(2 * retryS, retryScaleS.most);
  }
  function endRetry(): void {
    clearTimeout(retryTimer);
    retryScale = -1;
  }
  /** The scale that the view asks for, by a little more than the last time. */
  function scaleForView(): number {
    const { override, wantedScale, view: { display } } = load;
    const at = (factor: number): number => override.scale ?? textures!.scaleFor(display.heightPx * factor, display.part);
    if (override.scale !== undefined || at(1 / hysteresis) < wantedScale) return at(1);
    return Math.max(at(hysteresis), wantedScale);
  }
  /** All that is wanted is there. */
  async function settle(): Promise<void> {
    try {
      if (!resting()) await done;
      do {
        await restoring;
        if (!signal.aborted) await refineOnce(textures!);
      } while (refineAgain && !signal.aborted);
    } finally {
      refining = undefined; // what is asked for from now on, by listeners too, is a turn of its own
    }
    if (!signal.aborted) finish();
  }
  async function refineOnce({ refine }: TextureLoad): Promise<void> {
    phase = 'refining';
    const scale = followScale(); // the time may have allowed a coarser one only
    const asked = refineAgain;
    refineAgain = false;
    try {
      if (asked) await refine(() => refineAgain);
      await scale; // the view may have changed meanwhile
    } catch (error) {
      fail(error, 'refining');
    }
  }
  /** three.js makes geometries and pictures of its own anew; what was composed is gone. */
  function restore(): void {
    events.emit('context', { lost: false });
    if (signal.aborted) return;
    restoring = textures?.restore().catch((error) => fail(error, 'textures after a lost context'));
    if (!resting()) return;
    enter('refining');
    refineAgain ||= autoRefine;
    refining ??= settle();
  }

  const firstPicture = showFirst();
  const done = firstPicture.then(showInTime).catch((error: unknown) => {
    const cancelled = isAbort(error) || signal.aborted;
    if (!cancelled) fail(error, 'load', true);
    model.cancel();
    phase = cancelled ? 'cancelled' : 'failed';
    pool.dispose();
    throw error;
  });
  done.catch(() => undefined);
  const model: LoadedModel = {
    object,
    firstPicture,
    done,
    on: (name, listener) => events.on(name, listener),
    get state() {
      return {
        phase,
        scale: load.shownScale,
        wantedScale: load.wantedScale,
        displayedPx: load.view.display.heightPx,
        planes: textures?.planes() ?? [],
        bytes: client.received,
        throughputBytesS: textures?.throughputBytesS() ?? load.beta0,
        rttS: client.rttS,
        pending: textures?.pending() ?? 0,
      };
    },
    get materials() {
      return materials.all;
    },
    update(camera = options.camera) {
      if (signal.aborted) return;
      camera?.updateMatrixWorld();
      object.updateWorldMatrix(true, false);
      const display = readDisplay(camera);
      const { heightPx, part } = display;
      const seen = camera ? [camera.matrixWorld, camera.projectionMatrix, object.matrixWorld] : [];
      const numbers = [heightPx, part?.widthPx ?? 0, part?.heightPx ?? 0, ...seen.flatMap((m) => m.elements)];
      const view = numbers.map((v) => v.toPrecision(4)).join();
      if (view === lastView) return;
      lastView = view;
      load.view = { display, camera };
      if (resting()) follow();
    },
    refine() {
      refineAgain = true;
      return (refining ??= settle());
    },
    setOverride(override) {
      load.override = snapped(override);
      endRetry();
      done.then(() => follow(true), () => undefined); // once the timed part is over
    },
    cancel() {
      abort.abort();
      endRetry();
      if (phase !== 'failed') phase = 'cancelled';
    },
    dispose() {
      if (disposed.signal.aborted) return;
      model.cancel();
      disposed.abort();
      offRequest();
      forget();
      object.removeFromParent().clear();
      scales.dispose();
      textures?.dispose();
      materials.dispose();
      pool.dispose();
      events.clear();
    },
    readPlane: (base) => textures?.readPlane(base) ?? new Uint8Array(0),
  };
  const whileThere = { signal: disposed.signal };
  options.signal?.addEventListener('abort', model.cancel, whileThere);
  if (options.signal?.aborted) model.cancel();
  renderer.domElement?.addEventListener('webglcontextlost', () => events.emit('context', { lost: true }), whileThere);
  renderer.domElement?.addEventListener('webglcontextrestored', restore, whileThere);
  const offRequest = reader.onRequest((record) => {
    events.emit('request', record);
    progress();
  });
  return model;
}
