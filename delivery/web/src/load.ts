import { Camera, Group, Material, Object3D, Scene } from 'three';
import type { Display, LoadEvents, LoadOptions, LoadPhase, LoadState, LoadedModel } from './api';
import { displayOf } from './camera';
import { InputError } from './errors';
import { Emitter } from './events';
import { gpuIdle, programsReady } from './gpu';
import { isAbort, nowS, sleepS, throwIfAborted } from './http';
import { LoadContext, hysteresis } from './load_context';
import type { PackageReader } from './package_reader';
import { MaterialSet, texturesOf } from './scale_parts';
import { ScaleSource } from './scale_source';
import type { TextureLoad } from './texture_load';
import { wholeObject } from './viewing';
import type { WorkerPool } from './worker_pool';

/** A picture that waits for its programs no longer than this. */
const mostCompileS = 0.5;
/** A scale that could not be had is asked for again after so long, and twice as long each time. */
const retryScaleS = { first: 2, most: 60 };
/** Limits beyond are none: timers and plans end there. */
const longestS = 1e5;

/** Everything about one package in one scene; made by TexmeshPackage.load. */
export class ModelLoad implements LoadedModel {
  readonly object = new Group();
  readonly firstPicture: Promise<void>;
  readonly done: Promise<void>;
  private readonly events_ = new Emitter<LoadEvents>();
  private readonly abort_ = new AbortController();
  private readonly materialSet_ = new MaterialSet();
  private readonly context_: LoadContext;
  private textures_?: TextureLoad;
  private phase_: LoadPhase = 'first-picture';
  private scaleInTransit_ = -1;
  private refining_?: Promise<void>;
  private refineAgain_ = false;
  private scaleRetry_?: { scale: number; timer: ReturnType<typeof setTimeout> };
  private scaleRetryS_ = retryScaleS.first;
  private restoring_?: Promise<void>;
  private disposed_ = false;
  private readonly offRequest_: () => void;
  private readonly cancel_ = (): void => this.cancel();
  private readonly contextLost_ = (): void => this.events_.emit('context', { lost: true });
  private readonly contextRestored_ = (): void => void (this.restoring_ = this.restore_());

  constructor(
    private readonly reader_: PackageReader,
    private readonly scene_: Object3D,
    private readonly options_: LoadOptions,
    pool: WorkerPool,
    startS: number,
    private readonly forget_: () => void = () => undefined,
  ) {
    this.context_ = this.makeContext_(startS, pool);
    this.object.name = reader_.manifest.title || 'texmesh';
    options_.signal?.addEventListener('abort', this.cancel_);
    if (options_.signal?.aborted) this.cancel();
    const { domElement: canvas } = options_.renderer;
    canvas?.addEventListener('webglcontextlost', this.contextLost_);
    canvas?.addEventListener('webglcontextrestored', this.contextRestored_);
    this.offRequest_ = reader_.onRequest((record) => {
      this.events_.emit('request', record);
      this.progress_();
    });
    let shown: () => void = () => undefined;
    let notShown: (error: unknown) => void = () => undefined;
    this.firstPicture = new Promise((done, failed) => ((shown = done), (notShown = failed)));
    this.firstPicture.catch(() => undefined);
    this.done = this.run_(shown).catch((error: unknown) => {
      notShown(error);
      this.ended_(error);
      throw error;
    });
    this.done.catch(() => undefined);
  }
  private makeContext_(startS: number, pool: WorkerPool): LoadContext {
    const { reader_: reader, options_: options, materialSet_: materials, object } = this;
    const fail = (error: unknown, what: string): void => this.fail_(error, what);
    pool.onNone = (error) => this.fail_(error, 'workers');
    return {
      reader,
      options,
      pool,
      materials,
      object,
      scales: new ScaleSource(reader, options, materials, pool, (slot) => this.textures_?.adopt(slot), fail),
      signal: this.abort_.signal,
      limitS: (options.time ?? 5) > longestS ? Infinity : (options.time ?? 5),
      override: this.snapped_(options),
      view: { display: this.readDisplay_(options.camera), camera: options.camera },
      shownScale: -1,
      wantedScale: -1,
      beta0: 0,
      expectedBytes: 0,
      elapsedS: () => nowS() - startS,
      emit: (name, event) => this.events_.emit(name, event),
      fail,
      enter: (phase) => this.enter_(phase),
      lostScale: (error, scale) => this.lostScale_(error, scale),
      showScale: (scale) => this.loadScale_(scale),
    };
  }

  on<K extends keyof LoadEvents>(name: K, listener: (event: LoadEvents[K]) => void): () => void {
    return this.events_.on(name, listener);
  }
  get state(): LoadState {
    const { shownScale, wantedScale, view, beta0 } = this.context_;
    const { client } = this.reader_;
    return {
      phase: this.phase_,
      scale: shownScale,
      wantedScale,
      displayedPx: view.display.heightPx,
      planes: this.textures_?.planes ?? [],
      bytes: client.received,
      throughputBytesS: this.textures_?.throughputBytesS ?? beta0,
      rttS: client.rttS,
      pending: this.textures_?.pending ?? 0,
    };
  }
  get materials(): readonly Material[] {
    return this.materialSet_.all;
  }

  private ended_(error: unknown): void {
    const cancelled = isAbort(error) || this.abort_.signal.aborted;
    this.phase_ = cancelled ? 'cancelled' : 'failed';
    if (!cancelled) this.fail_(error, 'load', true);
    this.abort_.abort();
    this.endRetry_();
    this.context_.pool.dispose();
  }
  private fail_(error: unknown, what: string, fatal = false): void {
    if (isAbort(error) || this.disposed_) return;
    this.events_.emit('error', { fatal, what, message: error instanceof Error ? error.message : String(error), error });
  }
  private progress_(): void {
    const bytes = this.reader_.client.received;
    const bytesExpected = Math.max(bytes, this.context_.expectedBytes);
    this.events_.emit('progress', { phase: this.phase_, bytes, bytesExpected });
  }
  private enter_(phase: LoadPhase): void {
    throwIfAborted(this.abort_.signal);
    this.phase_ = phase;
    this.progress_();
  }

  // ---- the course of a load

  private async run_(shown: () => void): Promise<void> {
    await Promise.resolve(); // listeners are added after the constructor
    throwIfAborted(this.abort_.signal);
    const { manifest, client } = this.reader_;
    const coarsest = manifest.scales[manifest.scales.length - 1];
    this.context_.expectedBytes = client.received + coarsest.glb.bytes;
    this.enter_('first-picture');
    // On a slow link nothing shares it with the first picture; what comes next is asked for just before its end.
    const first = this.context_.scales.coarsest(this.abort_.signal);
    const part = import('./texture_load').then(({ TextureLoad }) => (this.textures_ = new TextureLoad(this.context_)));
    const documents = Promise.all([part, first.almostThere]).then(([textures]) => textures.documents());
    documents.catch(() => undefined);
    await first.bytes;
    await this.loadScale_(coarsest.scale).shown;
    this.update(this.context_.view.camera); // by what is there, not by its bounds alone
    this.events_.emit('first-picture', { scale: coarsest.scale, bytes: client.received });
    shown();
    this.enter_('tables');
    await (await part).timedPart(await documents);
    this.phase_ = 'refining';
    if (this.options_.autoRefine ?? true) void this.refine();
  }

  // ---- scales

  /** Loads a scale and puts it into the scene; what is complete on the way is shown, too. */
  private loadScale_(scale: number): { arrived: Promise<void>; shown: Promise<void> } {
    this.scaleInTransit_ = scale;
    const show = (k: number): void => {
      // Another scale may be wanted by now; what comes on the way to it must not be coarser than what is shown.
      if (this.scaleInTransit_ === scale && (k === scale || k < this.context_.shownScale)) this.showScale_(k);
    };
    const load = this.context_.scales.load(scale, this.context_.signal, show);
    const shown = load.shape.then(async (shape) => {
      if (this.context_.shownScale < 0) await this.compiled_(shape);
      show(scale);
    });
    return { arrived: load.arrived, shown };
  }
  /** Programs and previews before they are first drawn with, each in a turn of its own: the page goes on while the GPU's process makes them. */
  private async compiled_(shape: Object3D): Promise<void> {
    const { renderer } = this.options_;
    let root = this.scene_;
    while (root.parent) root = root.parent;
    await sleepS(0);
    throwIfAborted(this.context_.signal);
    renderer.compile?.(shape, this.context_.view.camera ?? new Camera(), root as Scene);
    await gpuIdle(renderer, mostCompileS); // or what comes next would wait for the programs
    await programsReady(renderer, mostCompileS, () => throwIfAborted(this.context_.signal));
    for (const material of this.materialSet_.all)
      for (const [, texture] of texturesOf(material)) {
        await sleepS(0);
        throwIfAborted(this.context_.signal);
        renderer.initTexture?.(texture);
      }
    await gpuIdle(renderer, mostCompileS);
  }
  /** In one turn of the page: what is drawn next is the new scale, whole. */
  private showScale_(scale: number): void {
    throwIfAborted(this.context_.signal);
    const shape = this.context_.scales.shape(scale)!;
    const [before] = this.object.children;
    if (before && before !== shape) this.object.remove(before);
    if (before !== shape) this.object.add(shape);
    if (!this.object.parent) this.scene_.add(this.object);
    this.context_.shownScale = scale;
    const triangles = this.reader_.manifest.scales.find((s) => s.scale === scale)?.triangles ?? 0;
    this.events_.emit('scale', { scale, triangles });
  }

  // ---- following the view

  private readDisplay_(camera?: Camera): Display {
    const { display } = this.options_;
    const said = typeof display === 'function' ? display() : display;
    if (typeof said === 'number') return { heightPx: said, part: wholeObject };
    if (said) return said;
    if (camera) return displayOf(this.reader_.manifest, this.object, camera, this.options_.renderer);
    return { heightPx: 1000, part: wholeObject };
  }

  private lastView_ = '';
  update(camera: Camera | undefined = this.options_.camera): void {
    if (this.disposed_ || this.context_.signal.aborted) return;
    camera?.updateMatrixWorld();
    this.object.updateWorldMatrix(true, false);
    const display = this.readDisplay_(camera);
    const { heightPx, part } = display;
    const seen = camera ? [camera.matrixWorld, camera.projectionMatrix, this.object.matrixWorld] : [];
    const numbers = [heightPx, part?.widthPx ?? 0, part?.heightPx ?? 0, ...seen.flatMap((m) => m.elements)];
    const key = numbers.map((v) => v.toPrecision(4)).join();
    if (key === this.lastView_) return;
    this.lastView_ = key;
    this.context_.view = { display, camera };
    if (this.resting_) this.follow_();
  }
  setOverride(override: { scale?: number; rung?: number }): void {
    this.context_.override = this.snapped_(override);
    this.endRetry_();
    if (this.resting_) this.follow_(true);
    else this.done.then(() => this.follow_(true), () => undefined); // once the timed part is over
  }

  /** A scale that the package has, as near as possible. InputError: no numbers of scale or rung. */
  private snapped_({ scale, rung }: { scale?: number; rung?: number }): { scale?: number; rung?: number } {
    for (const [name, v] of Object.entries({ scale, rung }))
      if (v !== undefined && !(Number.isInteger(v) && v >= 0)) throw new InputError('options', name, 'a whole number from 0 on', String(v));
    if (scale === undefined) return { rung };
    const away = (k: number): number => Math.abs(k - scale);
    const scales = this.reader_.manifest.scales.map((s) => s.scale);
    return { scale: scales.reduce((best, k) => (away(k) < away(best) ? k : best)), rung };
  }

  private follow_(always = false): void {
    void this.followScale_();
    if (always || (this.options_.autoRefine ?? true)) void this.refine();
  }
  private get resting_(): boolean {
    return this.phase_ === 'refining' || this.phase_ === 'done';
  }
  /** Loads the scale that the view asks for, if it is another one. */
  private async followScale_(scale = this.scaleForView_()): Promise<void> {
    if (scale === this.context_.wantedScale || scale === this.scaleRetry_?.scale) return;
    this.context_.wantedScale = scale;
    try {
      await this.loadScale_(scale).shown;
      this.scaleRetryS_ = retryScaleS.first;
    } catch (error) {
      this.lostScale_(error, scale);
    }
  }
  /** What is shown stays; the scale, or what is wanted by then, is asked for again a little later. */
  private lostScale_(error: unknown, scale: number): void {
    this.fail_(error, `scale ${scale}`);
    if (this.context_.wantedScale === scale) this.context_.wantedScale = this.context_.shownScale;
    if (this.abort_.signal.aborted) return;
    this.endRetry_();
    const timer = setTimeout(() => {
      this.endRetry_();
      void this.followScale_(this.resting_ ? undefined : scale);
    }, 1000 * this.scaleRetryS_);
    this.scaleRetry_ = { scale, timer };
    this.scaleRetryS_ = Math.min(2 * this.scaleRetryS_, retryScaleS.most);
  }
  private endRetry_(): void {
    clearTimeout(this.scaleRetry_?.timer);
    this.scaleRetry_ = undefined;
  }
  /** The scale that the view asks for, by a little more than the last time. */
  private scaleForView_(): number {
    if (this.context_.override.scale !== undefined) return this.context_.override.scale;
    const { heightPx, part } = this.context_.view.display;
    const at = (px: number): number => this.textures_!.scaleFor(px, part);
    const now = at(heightPx);
    if (this.context_.wantedScale < 0) return now;
    const finer = at(heightPx / hysteresis);
    const coarser = at(heightPx * hysteresis);
    if (finer < this.context_.wantedScale) return now;
    return coarser > this.context_.wantedScale ? coarser : this.context_.wantedScale;
  }

  refine(): Promise<void> {
    this.refineAgain_ = true;
    return (this.refining_ ??= this.refineAll_());
  }
  private async refineAll_(): Promise<void> {
    try {
      if (!this.resting_) await this.done;
      await this.restoring_;
      if (!this.abort_.signal.aborted) await this.refineRounds_();
    } finally {
      this.refining_ = undefined; // what is asked for from now on, by listeners too, is a turn of its own
    }
    if (this.abort_.signal.aborted) return;
    if (this.refineAgain_) return this.refine();
    this.phase_ = 'done';
    this.events_.emit('done', {});
    this.progress_();
  }
  private async refineRounds_(): Promise<void> {
    this.phase_ = 'refining';
    const textures = this.textures_!;
    const scale = this.followScale_(); // the time may have allowed a coarser one only
    try {
      while (this.refineAgain_) {
        this.refineAgain_ = false;
        textures.forgetLosses();
        await textures.finerPlanes();
        while (!this.refineAgain_ && (await textures.refineSome()));
        if (this.refineAgain_) continue;
        await textures.composed();
        await scale; // the view may have changed meanwhile
      }
    } catch (error) {
      this.fail_(error, 'refining');
    }
  }

  /** three.js makes geometries and pictures of its own anew; what was composed is gone. */
  private async restore_(): Promise<void> {
    this.events_.emit('context', { lost: false });
    if (this.abort_.signal.aborted) return;
    const over = this.resting_;
    if (over) this.enter_('refining');
    try {
      await this.textures_?.restore();
    } catch (error) {
      if (isAbort(error)) return;
      this.fail_(error, 'textures after a lost context');
    }
    if (!over) return;
    if (this.options_.autoRefine ?? true) return void this.refine();
    this.phase_ = 'done';
    this.events_.emit('done', {});
    this.progress_();
  }

  // ---- end

  readPlane(base: number): Uint8Array {
    return this.textures_?.readPlane(base) ?? new Uint8Array(0);
  }
  cancel(): void {
    this.abort_.abort();
    this.endRetry_();
    if (this.phase_ !== 'failed') this.phase_ = 'cancelled';
  }
  dispose(): void {
    if (this.disposed_) return;
    this.disposed_ = true;
    this.cancel();
    this.offRequest_();
    this.options_.signal?.removeEventListener('abort', this.cancel_);
    const { domElement: canvas } = this.options_.renderer;
    canvas?.removeEventListener('webglcontextlost', this.contextLost_);
    canvas?.removeEventListener('webglcontextrestored', this.contextRestored_);
    this.forget_();
    this.object.removeFromParent();
    this.object.clear();
    this.context_.scales.dispose();
    this.textures_?.dispose();
    this.materialSet_.dispose();
    this.context_.pool.dispose();
    this.events_.clear();
  }
}
