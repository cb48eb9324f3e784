import { Camera, Group, Material, Mesh, Object3D } from 'three';
import type { ComposedPlane, Display, LoadEvents, LoadOptions, LoadPhase, LoadState, LoadedModel } from './api';
import { displayOf } from './camera';
import { Emitter } from './events';
import {
  FragmentList, PackageData, PlaneChoice, TextureBudget, budgetSteps, fragmentList, fullSize, planesForDisplay,
} from './fragment_list';
import { GroupedList, groupBytes, groupedList, throughputOf } from './groups';
import { HarmonicTimePlan, HtcStep, defaultHtcOptions } from './harmonic_time';
import { isAbort, nowS, sleepS, throwIfAborted } from './http';
import type { PackageReader } from './package_reader';
import { chooseScale } from './scale_choice';
import { MaterialSet, Slot, meshesOf } from './scale_parts';
import { ScaleSource } from './scale_source';
import { TextureSet } from './texture_set';
import { fullSizePlanes } from './textures';
import { Transfers, Wish } from './transfers';
import { upgradesInOrder } from './upgrades';
import { selectScale, wholeObject } from './viewing';
import { VisibleSurface } from './visibility';
import { WorkerPool } from './worker_pool';
import type { Levels } from './worker_protocol';

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
  private readonly events_ = new Emitter<LoadEvents>();
  private readonly abort_ = new AbortController();
  private readonly pool_: WorkerPool;
  private readonly materialSet_ = new MaterialSet();
  private readonly scales_: ScaleSource;
  private textureSet_?: TextureSet;
  private transfers_?: Transfers;
  private data_?: PackageData;
  private phase_: LoadPhase = 'first-picture';
  private override_: { scale?: number; rung?: number };
  private view_: View;
  private surface_?: VisibleSurface;
  private surfaceScale_ = -1;
  private wantedScale_ = -1;
  private shownScale_ = -1;
  private scaleInTransit_ = -1;
  private refining_?: Promise<void>;
  private refineAgain_ = false;
  private readonly gaveUp_ = new Set<string>();
  private readonly startS_: number;
  private beta0_ = 0;
  private expectedBytes_ = 0;
  private disposed_ = false;
  private plan_?: HarmonicTimePlan;
  private readonly offRequest_: () => void;

  constructor(
    private readonly reader_: PackageReader,
    private readonly scene_: Object3D,
    private readonly options_: LoadOptions,
    startS: number,
  ) {
    this.startS_ = startS;
    this.override_ = this.snapped_(options_);
    this.pool_ = new WorkerPool(options_);
    this.scales_ = new ScaleSource(
      reader_,
      options_,
      this.materialSet_,
      this.pool_,
      (slot) => this.adopt_(slot),
      (error, what) => this.fail_(error, what),
    );
    this.object.name = reader_.manifest.title || 'texmesh';
    this.view_ = { display: this.readDisplay_(options_.camera), camera: options_.camera };
    options_.signal?.addEventListener('abort', () => this.cancel());
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

  on<K extends keyof LoadEvents>(name: K, listener: (event: LoadEvents[K]) => void): () => void {
    return this.events_.on(name, listener);
  }
  get state(): LoadState {
    return {
      phase: this.phase_,
      scale: this.shownScale_,
      wantedScale: this.wantedScale_,
      displayedPx: this.view_.display.heightPx,
      planes: [...(this.textureSet_?.planes.values() ?? [])] as ComposedPlane[],
      bytes: this.reader_.client.received,
      throughputBytesS: this.plan_?.throughputBytesS() ?? this.beta0_,
      rttS: this.reader_.client.rttS,
      pending: (this.transfers_?.pending ?? 0) + (this.textureSet_?.pending ?? 0),
    };
  }
  get materials(): readonly Material[] {
    return this.materialSet_.all;
  }

  private adopt_(slot: Slot): void {
    this.textureSet_?.adopt(slot);
  }
  private ended_(error: unknown): void {
    const cancelled = isAbort(error) || this.abort_.signal.aborted;
    this.phase_ = cancelled ? 'cancelled' : 'failed';
    if (!cancelled) this.fail_(error, 'load', true);
    this.abort_.abort();
    this.pool_.dispose();
  }
  private fail_(error: unknown, what: string, fatal = false): void {
    if (isAbort(error) || this.disposed_) return;
    this.events_.emit('error', { fatal, what, message: error instanceof Error ? error.message : String(error), error });
  }
  private progress_(): void {
    const bytes = this.reader_.client.received;
    this.events_.emit('progress', { phase: this.phase_, bytes, bytesExpected: Math.max(bytes, this.expectedBytes_) });
  }
  private enter_(phase: LoadPhase): void {
    throwIfAborted(this.abort_.signal);
    this.phase_ = phase;
    this.progress_();
  }
  private get limitS_(): number {
    return this.options_.time ?? 5;
  }
  private elapsedS_(): number {
    return nowS() - this.startS_;
  }

  // ---- the course of a load

  private async run_(shown: () => void): Promise<void> {
    await Promise.resolve(); // listeners are added after the constructor
    const { manifest } = this.reader_;
    const coarsest = manifest.scales[manifest.scales.length - 1];
    this.expectedBytes_ = this.reader_.client.received + coarsest.glb.bytes;
    this.enter_('first-picture');
    // On a slow link nothing shares it with the first picture; what comes next is asked for just before its end.
    const first = this.scales_.coarsest(this.abort_.signal);
    await first.almostThere;
    const documents = this.documents_();
    documents.catch(() => undefined);
    await first.bytes;
    await this.loadScale_(coarsest.scale).shown;
    this.events_.emit('first-picture', { scale: coarsest.scale, bytes: this.reader_.client.received });
    shown();
    this.enter_('tables');
    const data = await documents;
    this.data_ = data;
    this.beta0_ = this.options_.beta0BytesS || throughputOf(this.reader_.requests, this.reader_.client.rttS);
    await this.timedPart_(data);
    this.phase_ = 'refining';
    if (this.options_.autoRefine ?? true) void this.refine();
  }

  private async documents_(): Promise<PackageData> {
    const [whole] = await Promise.all([
      this.reader_.prefetchDocuments(this.abort_.signal),
      this.scales_.openStream(this.abort_.signal),
    ]);
    if (whole) return this.reader_.data();
    const textures = await this.reader_.textures();
    const base = Array.from({ length: fullSizePlanes(textures) }, (_, p) => p);
    const planes = this.planesFor_(await this.reader_.data(base)).map((p) => p.plane);
    return this.reader_.data([...base, ...planes]);
  }
  private planesFor_(data: PackageData, displayedPx = this.view_.display.heightPx): PlaneChoice[] {
    return this.options_.fullSize ? fullSize(data.textures) : planesForDisplay(data, displayedPx);
  }

  private async timedPart_(data: PackageData): Promise<void> {
    const transfers = this.startTextures_(data);
    const scale = await this.scaleInTime_(data);
    this.wantedScale_ = scale;
    if (scale !== this.shownScale_) this.enter_('mesh');
    const mesh = this.loadScale_(scale);
    mesh.shown.catch(() => undefined);
    const choices = await this.planesInTime_(data, scale);
    const [{ shown }] = await Promise.all([this.showPlanes_(choices), transfers.prepare(choices.map((c) => c.plane))]);
    await mesh.arrived;
    this.enter_('textures');
    const list = this.listOf_(data, choices, scale);
    for (const o of list.offers) this.expectedBytes_ += o.plannedBytes;
    const leftS = this.limitS_ - this.elapsedS_() - composeS;
    if (this.override_.rung !== undefined || !Number.isFinite(leftS)) await this.fetchAll_(list);
    else if (leftS > 0 && list.offers.length > 0) await this.fetchInTime_(list, leftS);
    await shown;
    await this.composed_();
    const skipped = [...(this.textureSet_?.planes.values() ?? [])].reduce((n, p) => n + this.skippedOf_(p), 0);
    await mesh.shown;
    this.events_.emit('deadline', { limit: this.limitS_, actual: this.elapsedS_(), skipped });
  }
  /** Planes for the display, or coarser ones where the time left buys too few bytes for them. */
  private async planesInTime_(data: PackageData, scale: number): Promise<PlaneChoice[]> {
    const all = data.tables.every((t) => t !== undefined);
    if (this.options_.fullSize || !Number.isFinite(this.limitS_) || this.override_.rung !== undefined || !all)
      return this.planesFor_(data);
    const bytes = this.textureBytes_(scale);
    let best: TextureBudget | undefined;
    for (best of budgetSteps(data, this.view_.display.heightPx, { scale }, bytes)) await sleepS(0);
    return best!.planes;
  }
  /** Bytes that the time leaves for textures when this scale is loaded. */
  private textureBytes_(scale: number): number {
    const mesh = this.scales_.bytesOf(scale);
    const meshS = mesh > 0 ? mesh / this.beta0_ + this.reader_.client.rttS : 0;
    return (this.limitS_ - this.elapsedS_() - composeS - meshS) * this.beta0_;
  }
  private skippedOf_(plane: ComposedPlane): number {
    const order = this.data_?.tables[plane.plane]?.order ?? [];
    return [...order].filter((f) => plane.rungs[f] < 0).length;
  }
  private async composed_(): Promise<void> {
    while ((this.transfers_?.pending ?? 0) > 0 || (this.textureSet_?.pending ?? 0) > 0) {
      throwIfAborted(this.abort_.signal);
      await this.textureSet_?.settled();
      await sleepS(0.004);
    }
    this.textureSet_?.finish();
  }

  private startTextures_(data: PackageData): Transfers {
    this.textureSet_ = new TextureSet(this.options_.renderer, data.textures, this.materialSet_, this.pool_);
    this.transfers_ = new Transfers(this.reader_, data.textures, this.pool_, {
      decoded: (wish, levels) => this.upload_(wish, levels),
      lost: (wish, error) => this.lost_(wish, error),
    });
    return this.transfers_;
  }
  private upload_(wish: Wish, levels: Levels): void {
    const { base, mip } = this.data_!.textures[wish.plane];
    const plane = this.textureSet_?.planes.get(mip > 0 ? base : wish.plane);
    if (this.disposed_ || !plane || plane.plane !== wish.plane) return levels.forEach((b) => b.close());
    const { fragment, rung } = wish;
    this.textureSet_!.upload(plane, levels, fragment, rung, () =>
      this.events_.emit('fragment', { plane: wish.plane, fragment, rung }),
    );
  }
  private lost_(wish: Wish, error: unknown): void {
    if (isAbort(error)) return;
    this.gaveUp_.add(`${wish.plane}/${wish.fragment}/${wish.rung}`);
    this.fail_(error, `fragment ${wish.fragment} of plane ${wish.plane} at rung ${wish.rung}`);
  }

  /**
   * Shows textures by these planes; alpha planes, which no GLB has, begin with their preview. Fragments may come from
   * then on; `shown` resolves when the scene has changed.
   */
  private async showPlanes_(choices: readonly PlaneChoice[]): Promise<{ shown: Promise<unknown> }> {
    const shown: Promise<void>[] = [];
    for (const choice of choices) {
      const { base, plane } = choice;
      const before = this.textureSet_!.planes.get(base);
      if (before?.plane === plane) continue;
      const info = this.data_!.textures[plane];
      let preview: ImageBitmap | undefined;
      if (!before && info.role === 'alpha') {
        const file = await this.reader_.preview(base, this.abort_.signal);
        const none = new Uint8Array(0);
        const decoded = this.pool_.decode({ codec: 'jpeg', tables: none, streams: [file], digests: [], complete: true, levels: 1 });
        [preview] = await decoded;
      }
      throwIfAborted(this.abort_.signal);
      shown.push(
        this.textureSet_!.show(choice, preview).then(() => {
          preview?.close();
          this.events_.emit('plane', { base, plane, widthPx: info.widthPx, heightPx: info.heightPx });
        }),
      );
    }
    return { shown: Promise.all(shown) };
  }

  private async scaleInTime_(data: PackageData): Promise<number> {
    const { heightPx, part } = this.view_.display;
    const wanted = this.override_.scale ?? selectScale(data.manifest, heightPx, part, this.options_.rule);
    if (this.override_.scale !== undefined || !Number.isFinite(this.limitS_)) return wanted;
    const quality = await this.reader_.quality();
    const planes = this.planesFor_(data);
    const list = fragmentList(data, planes, { scale: wanted });
    return chooseScale(data, quality, list, planes, wanted, (scale) => this.textureBytes_(scale));
  }

  /** The list of what may be fetched, with the bytes that fetching takes. */
  private listOf_(data: PackageData, choices: readonly PlaneChoice[], scale: number): FragmentList {
    const list = fragmentList(data, choices, { scale });
    list.offers.forEach((offer, i) => {
      const { plane, fragment } = list.fragments[i];
      offer.bytes = offer.bytes.map((b, r) => this.transfers_!.bytesOf(plane, r, fragment) || b);
    });
    return list;
  }
  /** A rung comes as a whole, whatever is asked for: a tree without files of fragments. */
  private get wholeRungs_(): boolean {
    const [first] = this.textureSet_?.planes.values() ?? [];
    return this.reader_.form === 'files' && first !== undefined && !this.transfers_!.filesOf(first.plane).complete;
  }

  /** Every fragment at its override's rung, or the highest. */
  private async fetchAll_(list: FragmentList): Promise<void> {
    const wishes = list.offers.flatMap((o, i) => {
      const rung = Math.min(this.override_.rung ?? Infinity, o.bytes.length - 1);
      return rung < 0 ? [] : [{ ...list.fragments[i], rung, offer: i }];
    });
    const missing = wishes.filter((w) => this.rungOf_(w) !== w.rung);
    await this.fetchWishes_(missing);
  }
  private rungOf_(wish: { plane: number; fragment: number }): number {
    for (const p of this.textureSet_?.planes.values() ?? []) if (p.plane === wish.plane) return p.rungs[wish.fragment];
    return -1;
  }
  private async fetchWishes_(wishes: readonly Wish[], signal = this.abort_.signal): Promise<void> {
    await this.transfers_!.fetch(
      wishes,
      { gapBytes, mostBytes: refineBytes, signal },
      () => undefined,
      (wish, error) => this.lost_(wish, error),
    );
    throwIfAborted(this.abort_.signal);
  }

  /** Harmonic Time Compensation: fragment by fragment, so that the last one comes at the limit. */
  private async fetchInTime_(fragments: FragmentList, limitS: number): Promise<void> {
    const { policy, order, beta0BytesS } = this.options_;
    const { client } = this.reader_;
    const defaults = defaultHtcOptions();
    const beta0 = beta0BytesS || this.beta0_;
    const list = groupedList(fragments, this.wholeRungs_ ? Infinity : groupBytes(beta0, client.rttS, limitS), beta0 * limitS);
    const plan = new HarmonicTimePlan(list.offers, {
      ...defaults,
      policy: policy ?? 'guard',
      order: order ?? 'credit',
      timeLimitS: limitS,
      rttS: client.rttS,
      throughput: { ...defaults.throughput, initialBytesS: Math.max(1, beta0) },
    });
    this.plan_ = plan;
    const t0 = nowS();
    const waiting = new Map<number, number>(); // by offer: fragments of it that have not ended
    const tooLate = new AbortController();
    const stop = (): void => tooLate.abort();
    this.abort_.signal.addEventListener('abort', stop);
    const timer = setTimeout(stop, (limitS + mostLate * this.limitS_) * 1000);
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
          if (step) this.tell_(list, step);
          queueMicrotask(pump);
        };
        const pump = (): void => {
          if (this.abort_.signal.aborted) return failed(new DOMException('The load was cancelled', 'AbortError'));
          const wishes: Wish[] = [];
          for (let step = plan.next(nowS() - t0); step; step = plan.next(nowS() - t0)) {
            const { offer, rung } = step;
            const own = list.groups[offer].map((f) => ({ ...f, rung, offer }));
            waiting.set(step.offer, own.length);
            wishes.push(...own);
          }
          while (told < plan.steps.length) this.tell_(list, plan.steps[told++]);
          if (wishes.length > 0)
            void this.transfers_!.fetch(
              wishes,
              { gapBytes: 0, mostBytes: Infinity, signal: tooLate.signal },
              (w) => end(w, true),
              (w, error) => {
                this.lost_(w, error);
                end(w, false);
              },
            );
          if (plan.finished) finished();
        };
        pump();
      });
    } finally {
      clearTimeout(timer);
      this.abort_.signal.removeEventListener('abort', stop);
    }
  }
  private tell_(list: GroupedList, s: HtcStep): void {
    this.events_.emit('decision', {
      position: s.position,
      ...list.groups[s.offer][0],
      fragments: list.groups[s.offer].map((f) => f.fragment),
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

  /** Loads a scale and puts it into the scene; what is complete on the way is shown, too. */
  private loadScale_(scale: number): { arrived: Promise<void>; shown: Promise<void> } {
    this.scaleInTransit_ = scale;
    const show = (k: number): void => {
      // Another scale may be wanted by now; what comes on the way to it must not be coarser than what is shown.
      if (this.scaleInTransit_ === scale && (k === scale || k < this.shownScale_)) this.showScale_(k);
    };
    const load = this.scales_.load(scale, this.abort_.signal, show);
    return { arrived: load.arrived, shown: load.shape.then(() => show(scale)) };
  }
  /** In one turn of the page: what is drawn next is the new scale, whole. */
  private showScale_(scale: number): void {
    throwIfAborted(this.abort_.signal);
    const shape = this.scales_.shape(scale)!;
    const [before] = this.object.children;
    if (before && before !== shape) this.object.remove(before);
    if (before !== shape) this.object.add(shape);
    if (!this.object.parent) this.scene_.add(this.object);
    this.shownScale_ = scale;
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
    if (this.disposed_ || this.abort_.signal.aborted) return;
    if (camera) camera.updateMatrixWorld();
    const display = this.readDisplay_(camera);
    const matrix = camera ? camera.matrixWorld.elements.map((v) => v.toPrecision(4)).join() : '';
    const key = `${display.heightPx.toPrecision(4)}/${matrix}`;
    if (key === this.lastView_) return;
    this.lastView_ = key;
    this.view_ = { display, camera };
    if (this.phase_ === 'refining' || this.phase_ === 'done') this.follow_();
  }
  setOverride(override: { scale?: number; rung?: number }): void {
    this.override_ = this.snapped_(override);
    if (this.phase_ === 'refining' || this.phase_ === 'done') this.follow_();
  }

  /** A scale that the package has, as near as possible. */
  private snapped_({ scale, rung }: { scale?: number; rung?: number }): { scale?: number; rung?: number } {
    if (scale === undefined) return { rung };
    const away = (k: number): number => Math.abs(k - scale);
    const scales = this.reader_.manifest.scales.map((s) => s.scale);
    return { scale: scales.reduce((best, k) => (away(k) < away(best) ? k : best)), rung };
  }

  private follow_(): void {
    const scale = this.scaleForView_();
    if (scale !== this.wantedScale_) {
      this.wantedScale_ = scale;
      this.loadScale_(scale).shown.catch((error: unknown) => this.fail_(error, `scale ${scale}`));
    }
    if (this.options_.autoRefine ?? true) void this.refine();
  }
  /** The scale that the view asks for, by a little more than the last time. */
  private scaleForView_(): number {
    if (this.override_.scale !== undefined) return this.override_.scale;
    const { heightPx, part } = this.view_.display;
    const at = (px: number): number => selectScale(this.reader_.manifest, px, part, this.options_.rule);
    const now = at(heightPx);
    if (this.wantedScale_ < 0) return now;
    const finer = at(heightPx / hysteresis);
    const coarser = at(heightPx * hysteresis);
    if (finer < this.wantedScale_) return now;
    return coarser > this.wantedScale_ ? coarser : this.wantedScale_;
  }

  refine(): Promise<void> {
    this.refineAgain_ = true;
    return (this.refining_ ??= this.refineAll_().finally(() => (this.refining_ = undefined)));
  }
  private async refineAll_(): Promise<void> {
    if (this.phase_ !== 'refining' && this.phase_ !== 'done') await this.done;
    this.phase_ = 'refining';
    try {
      while (this.refineAgain_) {
        this.refineAgain_ = false;
        await this.finerPlanes_();
        while (!this.refineAgain_ && (await this.refineSome_()));
      }
      await this.composed_();
      this.phase_ = 'done';
      this.events_.emit('done', {});
      this.progress_();
    } catch (error) {
      if (!isAbort(error)) {
        this.fail_(error, 'refining');
        this.phase_ = 'done';
      }
    }
  }

  /** Planes with more texels where the view has come nearer; never back, as what is there is there. */
  private async finerPlanes_(): Promise<void> {
    const base = this.data_!;
    const wanted = this.planesFor_(base, this.view_.display.heightPx / hysteresis);
    const finer = wanted.filter((c) => {
      const shown = this.textureSet_!.planes.get(c.base);
      return !shown || shown.widthPx < base.textures[c.plane].widthPx;
    });
    if (finer.length === 0) return;
    const planes = [...this.textureSet_!.planes.values()].map((p) => p.plane);
    this.data_ = await this.reader_.data([...planes, ...finer.map((c) => c.plane)]);
    await this.transfers_!.prepare(finer.map((c) => c.plane));
    await (await this.showPlanes_(finer)).shown;
  }

  /** Fetches what saves most of what the camera sees; false when there is nothing left. */
  private async refineSome_(): Promise<boolean> {
    const data = this.data_!;
    const choices = [...this.textureSet_!.planes.values()].map(({ base, plane }) => ({ base, plane }));
    const list = this.listOf_(data, choices, Math.max(this.shownScale_, 0));
    if (this.override_.rung !== undefined) {
      await this.fetchAll_(list);
      return false;
    }
    if (this.wholeRungs_) return this.refineRung_(list);
    const seen = this.seen_(choices);
    const wishes: Wish[] = [];
    let bytes = 0;
    const rungs = list.fragments.map((f) => this.rungOf_(f));
    list.offers.forEach((o, i) => {
      const { plane, fragment } = list.fragments[i];
      const weight = seen?.get(plane)?.[fragment] ?? 1;
      o.loss = o.loss.map((l) => l * (weight > 0 ? weight : unseen));
      if (weight === 0) rungs[i] = Math.max(rungs[i], o.bytes.length - 1); // not to be seen: not to be fetched
    });
    const taken = new Map<number, number>();
    for (const u of upgradesInOrder(list.offers, rungs)) {
      const { plane, fragment } = list.fragments[u.offer];
      if (this.gaveUp_.has(`${plane}/${fragment}/${u.rung}`)) continue;
      if (bytes > 0 && bytes + u.bytes > refineBytes * refineRequests) break;
      bytes += u.bytes;
      taken.set(u.offer, u.rung);
    }
    for (const [offer, rung] of taken) wishes.push({ ...list.fragments[offer], rung, offer });
    if (wishes.length === 0) return false;
    await this.fetchWishes_(wishes);
    await this.composed_();
    return true;
  }
  /** The next rung of the first plane that lacks some. */
  private async refineRung_(list: FragmentList): Promise<boolean> {
    const lacking = list.fragments.map((f, i) => ({ ...f, rung: this.rungOf_(f) + 1, offer: i }));
    const open = lacking.filter(
      (w) => w.rung < list.offers[w.offer].bytes.length && !this.gaveUp_.has(`${w.plane}/${w.fragment}/${w.rung}`),
    );
    const least = open.reduce((rung, w) => Math.min(rung, w.rung), Infinity);
    const wishes = open.filter((w) => w.rung === least && w.plane === open.find((o) => o.rung === least)!.plane);
    if (wishes.length === 0) return false;
    await this.fetchWishes_(wishes);
    await this.composed_();
    return true;
  }

  /** Share of each fragment that the camera sees, by plane; undefined without a camera. */
  private seen_(choices: readonly PlaneChoice[]): Map<number, Float32Array> | undefined {
    const { camera } = this.view_;
    const [shape] = this.object.children;
    if (!camera || !shape) return undefined;
    if (this.surfaceScale_ !== this.shownScale_) {
      const slots = this.materialSet_.slots;
      this.surface_ = new VisibleSurface(this.object, meshesOf(shape), (mesh: Mesh) => {
        const own = Array.isArray(mesh.material) ? mesh.material : [mesh.material];
        return new Set(slots.filter((s) => own.includes(s.material)).map((s) => s.image));
      });
      this.surfaceScale_ = this.shownScale_;
    }
    const seen = new Map<number, Float32Array>();
    for (const { plane } of choices) {
      const t = this.data_!.textures[plane];
      const cell: [number, number] = [t.fragmentWidthPx / t.widthPx, t.fragmentHeightPx / t.heightPx];
      seen.set(plane, this.surface_!.ofImage(t.image, t.columns, t.rows, camera, this.object, cell));
    }
    return seen;
  }

  // ---- end

  readPlane(base: number): Uint8Array {
    return this.textureSet_?.planes.get(base)?.read() ?? new Uint8Array(0);
  }
  cancel(): void {
    this.abort_.abort();
    if (this.phase_ !== 'failed') this.phase_ = 'cancelled';
  }
  dispose(): void {
    if (this.disposed_) return;
    this.disposed_ = true;
    this.cancel();
    this.offRequest_();
    this.object.removeFromParent();
    this.object.clear();
    this.scales_.dispose();
    this.textureSet_?.dispose();
    this.materialSet_.dispose();
    this.transfers_?.dispose();
    this.pool_.dispose();
    this.surface_ = undefined;
    this.events_.clear();
  }
}
