import type { Material, Object3D } from 'three';
import { servingProxy } from '../decide/proxy_choice';
import { isAbort, throwIfAborted } from '../format/errors';
import { type Manifest, firstPicture } from '../format/manifest';
import type { PackageReader } from '../http/package_reader';
import type { WorkerPool } from '../worker/pool';
import type { LoadOptions, LoadState, LoadedModel } from './api';
import { gpuBytes } from './gpu';
import { LoadContext } from './load_context';
import { disposeGeometries, materialsOf, texturesOf } from './scale_parts';
import { ScaleSource } from './scale_source';
import type { ShownProxy } from './shown_proxy';
import { ShownScale } from './shown_scale';
import type { TextureLoad } from './texture_load';

/** What is fetched on the way to scales. */
interface OnTheWay {
  /** The larger proxy that is shown meanwhile; -1: none. */
  step: number;
  bytes?: Promise<Uint8Array>;
  /** What scales need is there. */
  rest: Promise<unknown>;
}

/** Which proxy a load shows: the smallest first, one that is enough, or a larger one on the way to scales. */
export class ProxyOnTheWay {
  private part_?: Promise<typeof import('./texture_load') | undefined>;
  private way_?: Promise<OnTheWay>;

  /** `fetchRest` fetches what scales need. */
  constructor(
    private readonly load_: LoadContext,
    private readonly proxy_: ShownProxy,
    private readonly fetchRest_: () => Promise<unknown>,
  ) {}

  /** Shows the smallest one. Meanwhile the next parts are loaded, and without turns the link goes on. */
  async showFirst(): Promise<void> {
    const { load_: { reader: { manifest }, view: { display }, options: { turn } }, proxy_: proxy } = this;
    const bytes = proxy.fetch(0);
    const next = (): void => {
      if (servingProxy(manifest, display.heightPx) >= 0) return;
      this.part_ = import('./texture_load').catch(() => undefined); // said later
      if (!turn) this.way_ = this.goOn_();
    };
    await Promise.all([proxy.show(0, bytes), bytes.then(next, () => undefined)]);
  }
  /** Nothing is chosen by hand. */
  private get free_(): boolean {
    const { override: { scale, rung }, options: { rule = 'flip', fullSize } } = this.load_;
    return scale === undefined && rung === undefined && !fullSize && rule === 'flip';
  }
  /** The smallest proxy that is as good as S_0 in this view; -1: none, or somebody chooses by hand. */
  serving(): number {
    const { view, reader } = this.load_;
    return this.free_ && this.proxy_.shown >= 0 ? servingProxy(reader.manifest, view.display.heightPx) : -1;
  }
  /** Shows a proxy that is enough. False where scales are needed. */
  async showServing(): Promise<boolean> {
    const serving = this.serving();
    try {
      if (serving > this.proxy_.shown) await this.proxy_.show(serving);
      return serving >= 0;
    } catch (error) {
      this.load_.fail(error, 'proxy');
      return false;
    }
  }
  /** Fetches what scales need; before that a larger proxy, where one pays on the way to scales. */
  private async goOn_(): Promise<OnTheWay> {
    const { load_: load, proxy_: proxy } = this;
    const part = this.free_ && load.options.policy !== 'thesis' ? await this.part_ : undefined;
    const step = part ? part.stepOf(load) : -1;
    const bytes = step > Math.max(proxy.shown, 0)
      ? load.untilLimit((signal) => proxy.fetch(step, signal)) : undefined;
    const rest = (bytes ?? Promise.resolve()).then(this.fetchRest_, this.fetchRest_);
    rest.catch(() => undefined); // whoever waits hears of it
    return { step, bytes, rest };
  }
  /** Shows the larger proxy that pays, if any; resolves when what scales need is there, too. */
  async showStep(): Promise<void> {
    const { load_: load, proxy_: proxy } = this;
    const { step, bytes, rest } = await (this.way_ ?? this.goOn_());
    // the smaller one stays
    const shown = bytes && proxy.show(step, bytes).catch((error: unknown) => load.fail(error, 'proxy'));
    await Promise.all([shown, rest]);
  }
}

/** Loads one package into one scene, from `startS` on; `forget` is called when the load is disposed of. */
export function loadModel(reader: PackageReader, scene: Object3D, options: LoadOptions, pool: WorkerPool,
    startS: number, forget: () => void): LoadedModel {
  const load = new ModelLoad(new LoadContext(reader, options, pool, startS), scene, forget);
  const { context } = load;
  return {
    object: context.object,
    firstPicture: load.firstPicture,
    done: load.done,
    on: (name, listener) => context.events.on(name, listener),
    get state() {
      return load.state;
    },
    get materials() {
      return load.materials;
    },
    update: (camera = options.camera) => load.update(camera),
    refine: () => load.refine(),
    setOverride: (override) => load.setOverride(override),
    cancel: () => load.cancel(),
    dispose: () => load.dispose(),
    readPlane: (base) => load.textures?.readPlane(base) ?? new Uint8Array(0),
  };
}

/**
 * Bytes that a turn fetches however short it is: a larger proxy that is enough, or documents, and the
 * coarsest mesh where it is not there yet.
 */
function bytesOfAnyTurn({ proxies, scales, index, tables }: Manifest, serving: number, shown: number,
    withMesh: boolean): number {
  if (serving >= 0) return serving > shown ? proxies[serving].glb.bytes : 0;
  return tables.offset + tables.bytes - index.offset + (withMesh ? scales[scales.length - 1].glb.bytes : 0);
}

/** three.js drops what it keeps of a lost context, as a later context could not delete it. */
function forgetGpu(objects: readonly Object3D[], planes: LoadState['planes'],
    materials: readonly Material[]): void {
  objects.forEach(disposeGeometries);
  for (const texture of planes.flatMap((p) => p.textures)) texture.dispose();
  for (const material of new Set([...materials, ...objects.flatMap(materialsOf)])) {
    for (const [, texture] of texturesOf(material)) texture.dispose();
    material.dispose();
  }
}

/** The course of a load: first picture, documents, the timed part, refining. */
class ModelLoad {
  readonly firstPicture: Promise<void>;
  readonly done: Promise<void>;
  textures?: TextureLoad;
  private readonly source_: ScaleSource;
  private readonly scale_: ShownScale;
  private readonly proxies_: ProxyOnTheWay;
  private shape_?: Promise<Object3D>; // the coarsest scale's
  private coming_?: Promise<TextureLoad>;
  private refining_?: Promise<void>;
  private refineAgain_ = false;
  private restoring_?: Promise<unknown>; // from a loss of the context on, until all is made anew
  private contextBack_?: () => void;
  private leaving_?: Promise<void>;
  private readonly endRequests_: () => void;
  private readonly leaveRoom_: () => void;

  constructor(readonly context: LoadContext, scene: Object3D, private readonly forget_: () => void) {
    const { reader, options, materials, pool, signal, disposal } = context;
    pool.onUnavailable = (error) => context.fail(error, 'workers');
    this.source_ = new ScaleSource({
      reader, options, materials, pool, signal, leadBytes: () => context.beta0 * reader.client.latencyS,
      added: () => this.textures?.showInNewMaterials(),
      problem: (error, what) => context.fail(error, what),
    });
    this.scale_ = new ShownScale(context, scene, this.source_);
    this.proxies_ = new ProxyOnTheWay(context, this.scale_.proxy, () => this.source_.fetchDocuments(true));
    this.firstPicture = this.showFirst_();
    this.done = this.firstPicture.then(() => this.showInTime_()).catch((error: unknown) => this.end_(error));
    this.done.catch(() => undefined);
    const whileThere = { signal: disposal };
    options.signal?.addEventListener('abort', () => this.cancel(), whileThere);
    if (options.signal?.aborted) this.cancel();
    this.leaveRoom_ =
      context.room.add({ gpuBytes: () => this.state.gpuBytes, refused: () => this.makeAnew_() });
    for (const name of ['proxy', 'scale', 'plane'] as const)
      context.events.on(name, () => void context.room.ask());
    const { domElement } = options.renderer;
    domElement?.addEventListener('webglcontextlost', () => this.lose_(), whileThere);
    domElement?.addEventListener('webglcontextrestored', () => this.restore_(), whileThere);
    this.endRequests_ = reader.onRequest((record) => {
      context.emit('request', record);
      context.progress();
    });
  }

  get materials(): Material[] {
    return [...this.scale_.proxy.materials, ...this.context.materials.all];
  }
  get state(): LoadState {
    const { phase, view, beta0, reader: { client } } = this.context;
    return {
      phase,
      scale: this.scale_.held ? -1 : this.scale_.shown,
      proxy: this.scale_.proxy.shown,
      wantedScale: this.scale_.wanted,
      displayedPx: view.display.heightPx,
      planes: this.textures?.planes() ?? [],
      gpuBytes: gpuBytes(this.scale_.objects(), this.materials, this.textures?.planes() ?? []),
      bytes: client.received,
      throughputBytesS: this.textures?.throughputBytesS() ?? beta0,
      rttS: client.rttS,
      pending: this.textures?.pending() ?? 0,
    };
  }

  // ---- the course of a load

  private async showFirst_(): Promise<void> {
    const { context, scale_: scales } = this;
    const { reader: { manifest, client }, signal } = context;
    await null; // listeners are added when the caller has the model
    throwIfAborted(signal);
    context.expectedBytes = client.received + firstPicture(manifest).bytes;
    context.enter('first-picture');
    if (manifest.proxies.length > 0 && context.override.scale === undefined)
      try {
        await this.proxies_.showFirst();
      } catch (error) {
        context.fail(error, 'proxy'); // scales do, too
      }
    // On a slow link nothing shares the link with the first picture. The documents are asked for while the
    // GPU prepares for the picture.
    if (!scales.held) await this.startScales_();
    // by the mesh that is there, not by its bounding box alone
    this.update(context.view.camera ?? context.options.camera);
    context.emit('first-picture',
      { scale: scales.held ? -1 : scales.shown, proxy: scales.proxy.shown, bytes: client.received });
  }
  /** Starts with the coarsest scale, which has the materials; resolves when the scale is shown. */
  private startScales_(): Promise<void> {
    const { context } = this;
    const { arrived, shape, shown } = this.scale_.load(context.reader.manifest.scales.at(-1)!.scale);
    this.shape_ = shape;
    // others wait for their first pictures
    if (!context.options.turn || context.phase !== 'first-picture') void this.openTextures_(arrived);
    return shown;
  }
  private openTextures_(arrived?: Promise<void>): Promise<TextureLoad> {
    // whoever takes them asks again
    arrived?.then(() => this.source_.fetchDocuments()).catch(() => undefined);
    this.coming_ ??= Promise.all([import('./texture_load'), this.shape_])
      .then(([part]) => part.openTextureLoad(this.context, this.scale_, this.source_));
    this.coming_.catch(() => undefined);
    return this.coming_;
  }
  private async showInTime_(): Promise<void> {
    const { context } = this;
    await context.turn(bytesOfAnyTurn(context.reader.manifest, this.proxies_.serving(),
      this.scale_.proxy.shown, !this.shape_));
    // A turn without time leaves what stands: other models' turns would begin later.
    if ((context.options.turn && context.limitS <= context.elapsedS()) ||
          (await this.proxies_.showServing())) {
      context.emit('deadline', { limit: context.limitS, actual: context.elapsedS(), skipped: 0 });
      return this.rest_();
    }
    await this.showTextures_();
  }
  private async showTextures_(): Promise<void> {
    const { context } = this;
    context.enter('tables');
    if (!this.shape_) await this.proxies_.showStep().then(() => this.startScales_());
    this.textures = await this.openTextures_();
    throwIfAborted(context.signal);
    await this.textures.timedPart();
    context.phase = 'refining';
    if (context.options.autoRefine ?? true) void this.refine();
  }
  private rest_(): void {
    const { context } = this;
    context.phase = 'done';
    context.emit('done', {});
    context.progress();
  }
  private end_(error: unknown): never {
    const { context } = this;
    const cancelled = isAbort(error) || context.signal.aborted;
    if (!cancelled) context.fail(error, 'load', true);
    this.cancel();
    context.phase = cancelled ? 'cancelled' : 'failed';
    context.pool.dispose();
    throw error;
  }
  cancel(): void {
    this.context.cancel();
    this.scale_.endRetry();
    this.contextBack_?.(); // nobody waits for it any more
    if (this.context.phase !== 'failed') this.context.phase = 'cancelled';
  }
  dispose(): void {
    const { context } = this;
    if (context.disposal.aborted) return;
    this.cancel();
    context.dispose();
    this.endRequests_();
    this.leaveRoom_();
    this.forget_();
    context.object.removeFromParent().clear();
    this.scale_.proxy.dispose();
    this.source_.dispose();
    this.textures?.dispose();
    context.materials.dispose();
    context.pool.dispose();
    context.events.clear();
  }

  // ---- following the view

  update(camera: LoadContext['view']['camera']): boolean {
    const { context } = this;
    const isOther = !context.signal.aborted && context.lookFrom(camera);
    if (isOther && context.resting) this.follow_();
    return isOther;
  }
  setOverride(override: { scale?: number; rung?: number }): void {
    this.context.override = this.context.snapped(override);
    this.scale_.endRetry();
    this.done.then(() => this.follow_(true), () => undefined); // once the timed part is over
  }
  private follow_(always = this.context.options.autoRefine ?? true): void {
    if (!this.textures) return void this.followByProxies_();
    // Behind a proxy nobody sees a scale before refining.
    if (always || !this.scale_.held) void this.scale_.follow();
    if (always) void this.refine();
  }
  /** Where a proxy was enough: a larger one, or from now on scales. */
  private followByProxies_(): Promise<void> {
    return (this.leaving_ ??= (async () => {
      let enough = true;
      while (enough && this.proxies_.serving() > this.scale_.proxy.shown)
        enough = await this.proxies_.showServing();
      if (!enough || this.proxies_.serving() < 0) await this.showTextures_();
    })()
      .catch((error: unknown) => this.context.fail(error, 'scales behind a proxy'))
      .finally(() => (this.leaving_ = undefined)));
  }

  // ---- refining

  refine(): Promise<void> {
    this.refineAgain_ = true;
    return this.refineUntilDone_();
  }
  private refineUntilDone_(): Promise<void> {
    return (this.refining_ ??= this.refineRounds_());
  }
  /** Refines until every wanted fragment is there. */
  private async refineRounds_(): Promise<void> {
    const { context } = this;
    try {
      if (!context.resting) await this.done;
      if (!this.textures) await this.followByProxies_();
      if (!this.textures) {
        this.refineAgain_ = false;
        return this.rest_(); // a proxy is enough
      }
      let restored: Promise<unknown> | undefined;
      do {
        while (restored !== this.restoring_) await (restored = this.restoring_);
        if (!context.signal.aborted) await this.refineOnce_(this.textures!);
      } while ((this.refineAgain_ || restored !== this.restoring_) && !context.signal.aborted);
    } finally {
      this.refining_ = undefined; // a request from now on, by listeners too, is a turn of its own
    }
    if (!context.signal.aborted) this.rest_();
  }
  private async refineOnce_(textures: TextureLoad): Promise<void> {
    this.context.phase = 'refining';
    const scale = this.scale_.follow(); // the time may have allowed a coarser one only
    const asked = this.refineAgain_;
    this.refineAgain_ = false;
    try {
      if (asked) await textures.refine(() => this.refineAgain_);
      await scale; // the view may have changed meanwhile
    } catch (error) {
      this.context.fail(error, 'refining');
    }
  }
  private lose_(): void {
    forgetGpu(this.scale_.objects(), this.textures?.planes() ?? [], this.materials);
    this.textures?.lose();
    this.restoring_ = new Promise<void>((back) => (this.contextBack_ = back));
    this.context.emit('context', { lost: true });
  }
  /** After a lost context: three.js makes geometries and pictures anew; composed textures are gone. */
  private restore_(): void {
    this.context.emit('context', { lost: false });
    this.makeAnew_();
    this.contextBack_?.();
  }
  /** Makes anew what the GPU has lost, or has refused, within the memory that there is now. */
  private makeAnew_(): void {
    const { context } = this;
    if (context.signal.aborted) return;
    this.restoring_ = this.textures?.restore().then((coarser) => coarser &&
      context.emit('memory', { gpuBytes: this.state.gpuBytes, limitBytes: context.memoryBytes }),
      (error) => context.fail(error, 'what the GPU has lost'));
    if (!context.resting) return;
    context.enter('refining');
    this.refineAgain_ ||= context.options.autoRefine ?? true;
    void this.refineUntilDone_();
  }
}
