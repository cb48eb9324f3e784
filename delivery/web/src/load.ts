import { Camera, Group, Material, Mesh, Object3D } from 'three';
import type { ComposedPlane, Display, LoadEvents, LoadOptions, LoadPhase, LoadState, LoadedModel } from './api';
import { displayOf } from './camera';
import { Emitter } from './events';
import {
  FragmentList, PackageData, PlaneChoice, fragmentList, fullSize, planesForDisplay,
} from './fragment_list';
import { HarmonicTimePlan, HtcStep, defaultHtcOptions } from './harmonic_time';
import { isAbort, nowS, sleepS, throwIfAborted } from './http';
import type { PackageReader } from './package_reader';
import { chooseScale } from './scale_choice';
import { MaterialSet, Slot, disposeGeometries, meshesOf } from './scale_parts';
import { ScaleSource } from './scale_source';
import { TextureSet } from './texture_set';
import { fullSizePlanes } from './textures';
import { Transfers, Wish } from './transfers';
import { upgradesInOrder } from './upgrades';
import { selectScale, wholeObject } from './viewing';
import { VisibleSurface } from './visibility';
import { WorkerPool } from './worker_pool';

/** A change of scale or plane has to be wanted by this factor of displayed height. */
const hysteresis = 1.1;
/** What decoding and uploading take after the last byte, of the time limit. */
const composeS = 0.04;
/** Fragments that are this late, of the limit, are given up. */
const mostLate = 0.03;
const refineBytes = 256 << 10;
const refineRequests = 4;
const gapBytes = 1024;
/** What the camera does not see is worth this much of what it sees. */
const unseen = 1e-3;

interface View {
  display: Display;
  camera?: Camera;
}

/** Everything about one package in one scene; made by TexmeshPackage.load. */
export class ModelLoad implements LoadedModel {
  readonly object = new Group();
  readonly firstPicture: Promise<void>;
  readonly done: Promise<void>;
  private readonly events = new Emitter<LoadEvents>();
  private readonly abort = new AbortController();
  private readonly pool: WorkerPool;
  private readonly materialSet = new MaterialSet();
  private readonly scales: ScaleSource;
  private textureSet?: TextureSet;
  private transfers?: Transfers;
  private data?: PackageData;
  private phase: LoadPhase = 'first-picture';
  private override: { scale?: number; rung?: number };
  private view: View;
  private surface?: VisibleSurface;
  private surfaceScale = -1;
  private wantedScale = -1;
  private shownScale = -1;
  private scaleInTransit = -1;
  private refining?: Promise<void>;
  private refineAgain = false;
  private readonly gaveUp = new Set<string>();
  private readonly startS: number;
  private beta0 = 0;
  private expectedBytes = 0;
  private disposed = false;
  private plan?: HarmonicTimePlan;
  private readonly offRequest: () => void;

  constructor(
    private readonly reader: PackageReader,
    private readonly scene: Object3D,
    private readonly options: LoadOptions,
    startS: number,
    poolOptions: ConstructorParameters<typeof WorkerPool>[0] = {},
  ) {
    this.startS = startS;
    this.override = { scale: options.scale, rung: options.rung };
    this.pool = new WorkerPool({ workers: options.workers, workerUrl: options.workerUrl, ...poolOptions });
    this.scales = new ScaleSource(reader, options, this.materialSet, this.pool, (slot) => this.adopt(slot));
    this.object.name = reader.manifest.title || 'texmesh';
    this.view = { display: this.readDisplay(options.camera), camera: options.camera };
    options.signal?.addEventListener('abort', () => this.cancel());
    this.offRequest = reader.onRequest((record) => {
      this.events.emit('request', record);
      this.progress();
    });
    let shown: () => void = () => undefined;
    let notShown: (error: unknown) => void = () => undefined;
    this.firstPicture = new Promise((done, failed) => ((shown = done), (notShown = failed)));
    this.firstPicture.catch(() => undefined);
    this.done = this.run(shown).catch((error: unknown) => {
      notShown(error);
      this.ended(error);
      throw error;
    });
    this.done.catch(() => undefined);
  }

  on<K extends keyof LoadEvents>(name: K, listener: (event: LoadEvents[K]) => void): () => void {
    return this.events.on(name, listener);
  }
  get state(): LoadState {
    return {
      phase: this.phase,
      scale: this.shownScale,
      wantedScale: this.wantedScale,
      displayedPx: this.view.display.heightPx,
      planes: [...(this.textureSet?.planes.values() ?? [])] as ComposedPlane[],
      bytes: this.reader.client.received,
      throughputBytesS: this.plan?.throughputBytesS() ?? this.beta0,
      rttS: this.reader.client.rttS,
      pending: (this.transfers?.pending ?? 0) + (this.textureSet?.pending ?? 0),
    };
  }
  get materials(): readonly Material[] {
    return this.materialSet.all;
  }

  private adopt(slot: Slot): void {
    this.textureSet?.adopt(slot);
  }
  private ended(error: unknown): void {
    const cancelled = isAbort(error) || this.abort.signal.aborted;
    this.phase = cancelled ? 'cancelled' : 'failed';
    if (!cancelled) this.fail(error, 'load', true);
    this.abort.abort();
    this.pool.dispose();
  }
  private fail(error: unknown, what: string, fatal = false): void {
    if (isAbort(error) || this.disposed) return;
    this.events.emit('error', { fatal, what, message: error instanceof Error ? error.message : String(error), error });
  }
  private progress(): void {
    const bytes = this.reader.client.received;
    this.events.emit('progress', { phase: this.phase, bytes, bytesExpected: Math.max(bytes, this.expectedBytes) });
  }
  private enter(phase: LoadPhase): void {
    throwIfAborted(this.abort.signal);
    this.phase = phase;
    this.progress();
  }
  private get limitS(): number {
    return this.options.time ?? 5;
  }
  private elapsedS(): number {
    return nowS() - this.startS;
  }

  // ---- the course of a load

  private async run(shown: () => void): Promise<void> {
    await Promise.resolve(); // listeners are added after the constructor
    const { manifest } = this.reader;
    const coarsest = manifest.scales[manifest.scales.length - 1];
    this.expectedBytes = this.reader.client.received + coarsest.glb.bytes;
    this.enter('first-picture');
    const begin = { s: nowS(), bytes: this.reader.client.received };
    // On a slow link nothing shares it with the first picture; what comes next is asked for just before its end.
    const first = this.scales.coarsest(this.abort.signal);
    await first.almostThere;
    const documents = this.documents();
    documents.catch(() => undefined);
    await first.bytes;
    await this.showScale(coarsest.scale);
    this.events.emit('first-picture', { scale: coarsest.scale, bytes: this.reader.client.received });
    shown();
    this.enter('tables');
    const data = await documents;
    this.data = data;
    const spent = Math.max(1e-3, nowS() - begin.s - this.reader.client.rttS);
    this.beta0 = this.options.beta0BytesS || (this.reader.client.received - begin.bytes) / spent;
    await this.timedPart(data);
    this.phase = 'refining';
    if (this.options.autoRefine ?? true) void this.refine();
  }

  private async documents(): Promise<PackageData> {
    await this.reader.prefetchDocuments(this.abort.signal);
    const textures = await this.reader.textures();
    const base = Array.from({ length: fullSizePlanes(textures) }, (_, p) => p);
    const data = await this.reader.data(base);
    const planes = this.planesFor(data).map((p) => p.plane);
    await this.reader.quality();
    return this.reader.data([...base, ...planes]);
  }
  private planesFor(data: PackageData, displayedPx = this.view.display.heightPx): PlaneChoice[] {
    return this.options.fullSize ? fullSize(data.textures) : planesForDisplay(data, displayedPx);
  }

  private async timedPart(data: PackageData): Promise<void> {
    const choices = this.planesFor(data);
    const transfers = this.startTextures(data);
    const ready = Promise.all([transfers.prepare(choices.map((c) => c.plane)), this.showPlanes(choices)]);
    ready.catch(() => undefined);
    const scale = await this.scaleInTime(data, choices);
    this.wantedScale = scale;
    if (scale !== this.shownScale) {
      this.enter('mesh');
      await this.loadScale(scale);
    }
    await ready;
    this.enter('textures');
    const list = this.listOf(data, choices, scale);
    for (const o of list.offers) this.expectedBytes += o.plannedBytes;
    const leftS = this.limitS - this.elapsedS() - composeS;
    if (this.override.rung !== undefined || !Number.isFinite(leftS)) await this.fetchAll(list);
    else if (leftS > 0 && list.offers.length > 0) await this.fetchInTime(list, leftS);
    await this.composed();
    const skipped = [...(this.textureSet?.planes.values() ?? [])].reduce((n, p) => n + this.skippedOf(p), 0);
    this.events.emit('deadline', { limit: this.limitS, actual: this.elapsedS(), skipped });
  }
  private skippedOf(plane: ComposedPlane): number {
    const order = this.data?.tables[plane.plane]?.order ?? [];
    return [...order].filter((f) => plane.rungs[f] < 0).length;
  }
  private async composed(): Promise<void> {
    while ((this.transfers?.pending ?? 0) > 0 || (this.textureSet?.pending ?? 0) > 0) {
      throwIfAborted(this.abort.signal);
      await this.textureSet?.settled();
      await sleepS(0.004);
    }
    this.textureSet?.finish();
  }

  private startTextures(data: PackageData): Transfers {
    this.textureSet = new TextureSet(this.options.renderer, data.textures, this.materialSet);
    this.transfers = new Transfers(this.reader, data.textures, this.pool, {
      decoded: (wish, bitmap) => this.upload(wish, bitmap),
      lost: (wish, error) => this.lost(wish, error),
    });
    return this.transfers;
  }
  private upload(wish: Wish, bitmap: ImageBitmap): void {
    const { base, mip } = this.data!.textures[wish.plane];
    const plane = this.textureSet?.planes.get(mip > 0 ? base : wish.plane);
    if (this.disposed || !plane || plane.plane !== wish.plane) return bitmap.close();
    const { fragment, rung } = wish;
    this.textureSet!.upload(plane, bitmap, fragment, rung, () =>
      this.events.emit('fragment', { plane: wish.plane, fragment, rung }),
    );
  }
  private lost(wish: Wish, error: unknown): void {
    if (isAbort(error)) return;
    this.gaveUp.add(`${wish.plane}/${wish.fragment}/${wish.rung}`);
    this.fail(error, `fragment ${wish.fragment} of plane ${wish.plane} at rung ${wish.rung}`);
  }

  /** Shows textures by these planes; alpha planes, which no GLB has, begin with their preview. */
  private async showPlanes(choices: readonly PlaneChoice[]): Promise<void> {
    for (const choice of choices) {
      const { base, plane } = choice;
      const shown = this.textureSet!.planes.get(base);
      if (shown?.plane === plane) continue;
      const info = this.data!.textures[plane];
      let preview: ImageBitmap | undefined;
      if (!shown && info.role === 'alpha') {
        const file = await this.reader.preview(base, this.abort.signal);
        const none = new Uint8Array(0);
        preview = await this.pool.decode({ codec: 'jpeg', tables: none, streams: [file], digests: [], complete: true });
      }
      throwIfAborted(this.abort.signal);
      this.textureSet!.show(choice, preview);
      preview?.close();
      this.events.emit('plane', { base, plane, widthPx: info.widthPx, heightPx: info.heightPx });
    }
  }

  private async scaleInTime(data: PackageData, choices: readonly PlaneChoice[]): Promise<number> {
    const { heightPx, part } = this.view.display;
    const wanted = this.override.scale ?? selectScale(data.manifest, heightPx, part, this.options.rule);
    if (this.override.scale !== undefined || !Number.isFinite(this.limitS)) return wanted;
    const quality = await this.reader.quality();
    const list = fragmentList(data, choices, { scale: wanted });
    return chooseScale(data, quality, list, choices, wanted, (scale) => {
      const meshS = scale === this.shownScale ? 0 : this.scales.bytesOf(scale) / this.beta0 + this.reader.client.rttS;
      return (this.limitS - this.elapsedS() - composeS - meshS) * this.beta0;
    });
  }

  /** The list of what may be fetched; of a tree without files of fragments, whole rungs. */
  private listOf(data: PackageData, choices: readonly PlaneChoice[], scale: number): FragmentList {
    const list = fragmentList(data, choices, { scale });
    list.offers.forEach((offer, i) => {
      const { plane, fragment } = list.fragments[i];
      offer.bytes = offer.bytes.map((b, r) => this.transfers!.bytesOf(plane, r, fragment) || b);
    });
    return this.wholeRungs ? packedList(list) : list;
  }
  /** A rung comes as a whole, whatever is asked for. */
  private get wholeRungs(): boolean {
    const [first] = this.textureSet?.planes.values() ?? [];
    return this.reader.form === 'files' && first !== undefined && !this.transfers!.filesOf(first.plane).complete;
  }
  private wishesOf(list: FragmentList, offer: number, rung: number): Wish[] {
    const { plane, fragment } = list.fragments[offer];
    if (fragment >= 0) return [{ plane, fragment, rung, offer }];
    const order = this.data!.tables[plane]!.order;
    return [...order].map((f) => ({ plane, fragment: f, rung, offer }));
  }

  /** Every fragment at its override's rung, or the highest. */
  private async fetchAll(list: FragmentList): Promise<void> {
    const wishes = list.offers.flatMap((o, i) => {
      const rung = Math.min(this.override.rung ?? Infinity, o.bytes.length - 1);
      return rung < 0 ? [] : this.wishesOf(list, i, rung);
    });
    const missing = wishes.filter((w) => this.rungOf(w) !== w.rung);
    await this.fetchWishes(missing);
  }
  private rungOf(wish: { plane: number; fragment: number }): number {
    for (const p of this.textureSet?.planes.values() ?? []) if (p.plane === wish.plane) return p.rungs[wish.fragment];
    return -1;
  }
  private async fetchWishes(wishes: readonly Wish[], signal = this.abort.signal): Promise<void> {
    await this.transfers!.fetch(
      wishes,
      { gapBytes, mostBytes: refineBytes, signal },
      () => undefined,
      (wish, error) => this.lost(wish, error),
    );
    throwIfAborted(this.abort.signal);
  }

  /** Harmonic Time Compensation: fragment by fragment, so that the last one comes at the limit. */
  private async fetchInTime(list: FragmentList, limitS: number): Promise<void> {
    const { policy, order, beta0BytesS } = this.options;
    const { client } = this.reader;
    const defaults = defaultHtcOptions();
    const beta0 = beta0BytesS || this.beta0;
    const plan = new HarmonicTimePlan(list.offers, {
      ...defaults,
      policy: policy ?? 'guard',
      order: order ?? 'credit',
      timeLimitS: limitS,
      rttS: client.rttS,
      throughput: { ...defaults.throughput, initialBytesS: Math.max(1, beta0) },
    });
    this.plan = plan;
    const t0 = nowS();
    const waiting = new Map<number, number>(); // by offer: fragments of it that have not ended
    const tooLate = new AbortController();
    const stop = (): void => tooLate.abort();
    this.abort.signal.addEventListener('abort', stop);
    const timer = setTimeout(stop, (limitS + mostLate * this.limitS) * 1000);
    let told = 0;
    try {
      await new Promise<void>((finished, failed) => {
        const end = (wish: Wish, well: boolean): void => {
          const left = (waiting.get(wish.offer) ?? 1) - 1;
          waiting.set(wish.offer, left);
          if (left > 0) return;
          const at = nowS() - t0;
          if (well) plan.completed(wish.offer, at);
          else plan.failed(wish.offer, at);
          const step = plan.steps.find((s) => s.offer === wish.offer);
          if (step) this.tell(list, step);
          queueMicrotask(pump);
        };
        const pump = (): void => {
          if (this.abort.signal.aborted) return failed(new DOMException('The load was cancelled', 'AbortError'));
          const wishes: Wish[] = [];
          for (let step = plan.next(nowS() - t0); step; step = plan.next(nowS() - t0)) {
            const own = this.wishesOf(list, step.offer, step.rung);
            waiting.set(step.offer, own.length);
            wishes.push(...own);
          }
          while (told < plan.steps.length) this.tell(list, plan.steps[told++]);
          if (wishes.length > 0)
            void this.transfers!.fetch(
              wishes,
              { gapBytes: 0, mostBytes: Infinity, signal: tooLate.signal },
              (w) => end(w, true),
              (w, error) => {
                this.lost(w, error);
                end(w, false);
              },
            );
          if (plan.finished) finished();
        };
        pump();
      });
    } finally {
      clearTimeout(timer);
      this.abort.signal.removeEventListener('abort', stop);
    }
  }
  private tell(list: FragmentList, s: HtcStep): void {
    this.events.emit('decision', {
      position: s.position,
      ...list.fragments[s.offer],
      eta: list.offers[s.offer].eta,
      rung: s.rung,
      bytes: s.bytes,
      plannedSeconds: s.thetaS,
      ...(s.doneS >= 0 && s.rung >= 0 ? { actualSeconds: s.spacingS, done: s.doneS } : {}),
      creditSeconds: s.creditS,
      bytesPerSecond: s.throughputBytesS,
      issued: s.issuedS,
      skipped: s.rung < 0,
    });
  }

  // ---- scales

  /** Loads a scale and puts it into the scene, in one turn of the page. */
  private async loadScale(scale: number): Promise<void> {
    this.scaleInTransit = scale;
    try {
      await this.scales.prepare(scale, this.abort.signal);
      if (this.scaleInTransit === scale) await this.showScale(scale);
    } finally {
      if (this.scaleInTransit === scale) this.scaleInTransit = -1;
    }
  }
  private async showScale(scale: number): Promise<void> {
    const shape = await this.scales.get(scale);
    throwIfAborted(this.abort.signal);
    const [before] = this.object.children;
    if (before && before !== shape) this.object.remove(before);
    if (before !== shape) this.object.add(shape);
    if (!this.object.parent) this.scene.add(this.object);
    this.shownScale = scale;
    const triangles = this.reader.manifest.scales.find((s) => s.scale === scale)?.triangles ?? 0;
    this.events.emit('scale', { scale, triangles });
  }

  // ---- following the view

  private readDisplay(camera?: Camera): Display {
    const { display } = this.options;
    const said = typeof display === 'function' ? display() : display;
    if (typeof said === 'number') return { heightPx: said, part: wholeObject };
    if (said) return said;
    if (camera) return displayOf(this.reader.manifest, this.object, camera, this.options.renderer);
    return { heightPx: 1000, part: wholeObject };
  }

  private lastView = '';
  update(camera: Camera | undefined = this.options.camera): void {
    if (this.disposed || this.abort.signal.aborted) return;
    if (camera) camera.updateMatrixWorld();
    const display = this.readDisplay(camera);
    const matrix = camera ? camera.matrixWorld.elements.map((v) => v.toPrecision(4)).join() : '';
    const key = `${display.heightPx.toPrecision(4)}/${matrix}`;
    if (key === this.lastView) return;
    this.lastView = key;
    this.view = { display, camera };
    if (this.phase === 'refining' || this.phase === 'done') this.follow();
  }
  setOverride(override: { scale?: number; rung?: number }): void {
    this.override = { ...override };
    if (this.phase === 'refining' || this.phase === 'done') this.follow();
  }

  private follow(): void {
    const scale = this.scaleForView();
    if (scale !== this.wantedScale) {
      this.wantedScale = scale;
      this.loadScale(scale).catch((error: unknown) => this.fail(error, `scale ${scale}`));
    }
    if (this.options.autoRefine ?? true) void this.refine();
  }
  /** The scale that the view asks for, by a little more than the last time. */
  private scaleForView(): number {
    if (this.override.scale !== undefined) return this.override.scale;
    const { heightPx, part } = this.view.display;
    const at = (px: number): number => selectScale(this.reader.manifest, px, part, this.options.rule);
    const now = at(heightPx);
    if (this.wantedScale < 0) return now;
    const finer = at(heightPx / hysteresis);
    const coarser = at(heightPx * hysteresis);
    if (finer < this.wantedScale) return now;
    return coarser > this.wantedScale ? coarser : this.wantedScale;
  }

  refine(): Promise<void> {
    this.refineAgain = true;
    return (this.refining ??= this.refineAll().finally(() => (this.refining = undefined)));
  }
  private async refineAll(): Promise<void> {
    if (this.phase !== 'refining' && this.phase !== 'done') await this.done;
    this.phase = 'refining';
    try {
      while (this.refineAgain) {
        this.refineAgain = false;
        await this.finerPlanes();
        while (!this.refineAgain && (await this.refineSome()));
      }
      await this.composed();
      this.phase = 'done';
      this.events.emit('done', {});
      this.progress();
    } catch (error) {
      if (!isAbort(error)) {
        this.fail(error, 'refining');
        this.phase = 'done';
      }
    }
  }

  /** Planes with more texels where the view has come nearer; never back, as what is there is there. */
  private async finerPlanes(): Promise<void> {
    const base = this.data!;
    const wanted = this.planesFor(base, this.view.display.heightPx / hysteresis);
    const finer = wanted.filter((c) => {
      const shown = this.textureSet!.planes.get(c.base);
      return !shown || shown.widthPx < base.textures[c.plane].widthPx;
    });
    if (finer.length === 0) return;
    const planes = [...this.textureSet!.planes.values()].map((p) => p.plane);
    this.data = await this.reader.data([...planes, ...finer.map((c) => c.plane)]);
    await this.transfers!.prepare(finer.map((c) => c.plane));
    await this.showPlanes(finer);
  }

  /** Fetches what saves most of what the camera sees; false when there is nothing left. */
  private async refineSome(): Promise<boolean> {
    const data = this.data!;
    const choices = [...this.textureSet!.planes.values()].map(({ base, plane }) => ({ base, plane }));
    const list = this.listOf(data, choices, Math.max(this.shownScale, 0));
    if (this.override.rung !== undefined) {
      await this.fetchAll(list);
      return false;
    }
    if (this.wholeRungs) return this.refineRung(list);
    const seen = this.seen(choices);
    const wishes: Wish[] = [];
    let bytes = 0;
    const rungs = list.fragments.map((f) => this.rungOf(f));
    list.offers.forEach((o, i) => {
      const { plane, fragment } = list.fragments[i];
      const weight = seen?.get(plane)?.[fragment] ?? 1;
      o.loss = o.loss.map((l) => l * (weight > 0 ? weight : unseen));
      if (weight === 0) rungs[i] = Math.max(rungs[i], o.bytes.length - 1); // not to be seen: not to be fetched
    });
    const taken = new Map<number, number>();
    for (const u of upgradesInOrder(list.offers, rungs)) {
      const { plane, fragment } = list.fragments[u.offer];
      if (this.gaveUp.has(`${plane}/${fragment}/${u.rung}`)) continue;
      if (bytes > 0 && bytes + u.bytes > refineBytes * refineRequests) break;
      bytes += u.bytes;
      taken.set(u.offer, u.rung);
    }
    for (const [offer, rung] of taken) wishes.push({ ...list.fragments[offer], rung, offer });
    if (wishes.length === 0) return false;
    await this.fetchWishes(wishes);
    await this.composed();
    return true;
  }
  private async refineRung(list: FragmentList): Promise<boolean> {
    for (let i = 0; i < list.offers.length; ++i) {
      const shown = this.wishesOf(list, i, 0).reduce((least, w) => Math.min(least, this.rungOf(w)), Infinity);
      const rung = shown + 1;
      const wishes = this.wishesOf(list, i, rung).filter(
        (w) => rung < list.offers[i].bytes.length && !this.gaveUp.has(`${w.plane}/${w.fragment}/${rung}`),
      );
      if (wishes.length === 0) continue;
      await this.fetchWishes(wishes);
      await this.composed();
      return true;
    }
    return false;
  }

  /** Share of each fragment that the camera sees, by plane; undefined without a camera. */
  private seen(choices: readonly PlaneChoice[]): Map<number, Float32Array> | undefined {
    const { camera } = this.view;
    const [shape] = this.object.children;
    if (!camera || !shape) return undefined;
    if (this.surfaceScale !== this.shownScale) {
      const slots = this.materialSet.slots;
      this.surface = new VisibleSurface(this.object, meshesOf(shape), (mesh: Mesh) => {
        const own = Array.isArray(mesh.material) ? mesh.material : [mesh.material];
        return new Set(slots.filter((s) => own.includes(s.material)).map((s) => s.image));
      });
      this.surfaceScale = this.shownScale;
    }
    const seen = new Map<number, Float32Array>();
    for (const { plane } of choices) {
      const t = this.data!.textures[plane];
      const cell: [number, number] = [t.fragmentWidthPx / t.widthPx, t.fragmentHeightPx / t.heightPx];
      seen.set(plane, this.surface!.ofImage(t.image, t.columns, t.rows, camera, this.object, cell));
    }
    return seen;
  }

  // ---- end

  readPlane(base: number): Uint8Array {
    return this.textureSet?.planes.get(base)?.read() ?? new Uint8Array(0);
  }
  cancel(): void {
    this.abort.abort();
    if (this.phase !== 'failed') this.phase = 'cancelled';
  }
  dispose(): void {
    if (this.disposed) return;
    this.disposed = true;
    this.cancel();
    this.offRequest();
    this.object.removeFromParent();
    for (const shape of this.scales.dispose()) disposeGeometries(shape);
    this.object.clear();
    this.textureSet?.dispose();
    this.materialSet.dispose();
    this.transfers?.dispose();
    this.pool.dispose();
    this.surface = undefined;
    this.events.clear();
  }
}

/** One offer per plane: its whole rungs. */
function packedList(list: FragmentList): FragmentList {
  const packed: FragmentList = { offers: [], fragments: [], totalWeight: list.totalWeight };
  const at = new Map<number, number>();
  list.offers.forEach((o, i) => {
    const { plane } = list.fragments[i];
    const known = at.get(plane);
    if (known === undefined) {
      at.set(plane, packed.offers.push({ ...o, bytes: [...o.bytes], loss: [...o.loss] }) - 1);
      packed.fragments.push({ plane, fragment: -1 });
      return;
    }
    const p = packed.offers[known];
    o.bytes.forEach((b, r) => (p.bytes[r] += b));
    o.loss.forEach((l, r) => (p.loss[r] += l));
    p.plannedBytes += o.plannedBytes;
    p.eta += o.eta;
  });
  return packed;
}

