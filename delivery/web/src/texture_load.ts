import type { Mesh } from 'three';
import type { ComposedPlane } from './api';
import { fullSizePlanes } from './textures';
import { FragmentList, PackageData, PlaneChoice, fragmentList, fullSize, planesForDisplay } from './fragment_list';
import { GroupedList, groupBytes, groupedList, throughputOf } from './groups';
import { HarmonicTimePlan, HtcOptions, HtcStep, Policy, defaultHtcOptions } from './harmonic_time';
import { InputError } from './errors';
import { isAbort, isForGood, sleepS, throwIfAborted } from './http';
import { mostPreviewPx } from './image_size';
import { LoadContext, hysteresis } from './load_context';
import type { QualityTable } from './quality_table';
import { choiceInTime, finerWhereSeen } from './scale_choice';
import { Slot, meshesOf } from './scale_parts';
import { TextureSet } from './texture_set';
import { TimedFetch } from './timed_fetch';
import { Transfers, Wish } from './transfers';
import { RefusedRung, upgradesInOrder } from './upgrades';
import { VisiblePart, selectScale } from './viewing';
import { VisibleSurface } from './visibility';
import type { TextureInfo } from './textures';
import type { Levels } from './worker_protocol';

/** What decoding and uploading take after the last byte: 4 ms, or 11, on a machine whose GPU is its processor. */
const composeS = 0.015;
/** Fragments that are this late, of the limit, are given up. */
const mostLate = 0.02;
const refineBytes = 256 << 10;
const refineRequests = 4;
/** Fragments that may wait for decoding and uploads when the next ones are asked for. */
const mostPending = 48;
/** Of the time left when a mesh is asked for: textures do not wait longer for it. */
const meshShare = 0.5;
const longestTimerS = 1e6;
/** Less of the limit than this, beside a round trip, is not worth another request. */
const leastRest = 0.004;
/** Of the bytes that throughput promises. */
const certain = 0.85;
const gapBytes = 1024;
const tellsApart = 0.003;
/** What the camera does not see is worth this much of what it sees. */
const unseen = 1e-3;
/** Refining ends where so many rounds have brought nothing. */
const mostBarren = 3;

const keyOf = (f: { plane: number; fragment: number }, rung: number): string => `${f.plane}/${f.fragment}/${rung}`;

/**
 * What a load does once the first picture stands: decides what to fetch, fetches it in time, refines. In a part of its
 * own that is loaded while the first picture comes, so that nobody waits for it.
 */
export class TextureLoad {
  private textureSet_?: TextureSet;
  private transfers_?: Transfers;
  private data_?: PackageData;
  private plan_?: HarmonicTimePlan;
  private quality_?: QualityTable;
  private surface_?: VisibleSurface;
  private surfaceScale_ = -1;
  private readonly gaveUp_ = new Map<string, boolean>(); // by keyOf: whether for good
  private readonly underWay_ = new Map<string, number[]>(); // rungs, by plane/fragment
  private barren_ = 0; // rounds of refining that brought nothing, one after the other

  constructor(private readonly load_: LoadContext) {}

  get planes(): readonly ComposedPlane[] {
    return [...(this.textureSet_?.planes.values() ?? [])];
  }
  get throughputBytesS(): number | undefined {
    return this.plan_?.throughputBytesS();
  }
  /** Fragments whose decoding or upload is under way. */
  get pending(): number {
    return (this.transfers_?.pending ?? 0) + (this.textureSet_?.pending ?? 0);
  }
  adopt(slot: Slot): void {
    this.textureSet_?.adopt(slot);
  }
  readPlane(base: number): Uint8Array {
    return this.textureSet_?.planes.get(base)?.read() ?? new Uint8Array(0);
  }
  dispose(): void {
    this.textureSet_?.dispose();
    this.transfers_?.dispose();
    this.surface_ = undefined;
  }

  /** Reads what decisions are made from. */
  async documents(): Promise<PackageData> {
    this.load_.pool.start();
    const [whole] = await Promise.all([
      this.load_.reader.prefetchDocuments(this.load_.signal),
      this.load_.scales.openStream(this.load_.signal),
    ]);
    const { reader, signal } = this.load_;
    if (whole) return reader.data(undefined, signal);
    const textures = await reader.textures(signal);
    const base = Array.from({ length: fullSizePlanes(textures) }, (_, p) => p);
    const shown = this.planesFor_(await reader.data(base, signal));
    // With the mips below, which a short time may ask for.
    const among = (t: TextureInfo): boolean => shown.some((c) => t.mip > 0 && t.base === c.base && t.mip >= textures[c.plane].mip);
    return reader.data([...base, ...textures.flatMap((t, p) => (among(t) ? [p] : []))], signal);
  }
  private planesFor_(data: PackageData, displayedPx = this.load_.view.display.heightPx): PlaneChoice[] {
    return this.load_.options.fullSize ? fullSize(data.textures) : planesForDisplay(data, displayedPx);
  }

  /** Planes that the GPU can hold: a smaller one where it cannot; where there is none, what the mesh brought along stays. */
  private fitting_({ textures }: PackageData, choices: readonly PlaneChoice[]): PlaneChoice[] {
    const { maxTextureSize: most } = this.load_.options.renderer.capabilities;
    const fits = (p: number): boolean => Math.max(textures[p].widthPx, textures[p].heightPx) <= most;
    return choices.flatMap(({ base, plane }) => {
      const mips = [...textures.keys()].filter((p) => textures[p].mip > 0 && textures[p].base === base && fits(p));
      const largest = mips.sort((a, b) => textures[a].mip - textures[b].mip)[0];
      const taken = fits(plane) ? plane : largest;
      if (taken !== undefined) return [{ base, plane: taken }];
      this.load_.fail(new InputError('GPU', `texture plane ${plane}`, `at most ${most} px`, 'more'), 'textures');
      return [];
    });
  }

  /** Scale and textures within the time. */
  async timedPart(data: PackageData): Promise<void> {
    this.data_ = data;
    this.quality_ = await this.load_.reader.quality(this.load_.signal);
    this.load_.beta0 = this.load_.options.beta0BytesS || throughputOf(this.load_.reader.requests, this.load_.reader.client.latencyS);
    const transfers = this.startTextures_(data);
    const { scale, planes } = await this.choice_(data);
    this.load_.wantedScale = scale;
    if (scale !== this.load_.shownScale) this.load_.enter('mesh');
    const meshBytes = this.load_.scales.bytesOf(scale);
    const mesh = this.load_.showScale(scale);
    // Without it picture and fragments stand all the same.
    const meshShown = mesh.shown.catch((error: unknown) => this.load_.lostScale(error, scale));
    // Coverage that no material asks for is not fetched.
    const choices = this.fitting_(data, planes).filter(({ base }) => data.textures[base].role !== 'alpha' || this.textureSet_!.isUsed(base));
    const [{ shown }] = await Promise.all([this.showPlanes_(choices), transfers.prepare(choices.map((c) => c.plane), this.load_.signal)]);
    // A mesh that is only waited for leaves the link to the textures.
    // One that takes longer than it should has coarser scales to show on its way.
    if (meshBytes > this.load_.beta0 * this.load_.reader.client.latencyS)
      await Promise.race([mesh.arrived, sleepS(this.leftS_(meshShare))]);
    this.load_.enter('textures');
    const list = this.listOf_(data, choices.filter(({ base }) => this.textureSet_!.planes.has(base)), scale);
    for (const o of list.offers) this.load_.expectedBytes += o.plannedBytes;
    const leftS = this.load_.limitS - this.load_.elapsedS() - composeS;
    if (this.load_.override.rung !== undefined || !Number.isFinite(leftS)) await this.fetchAll_(list);
    else if (leftS > 0 && !this.load_.pool.none && list.offers.length > 0) await this.fetchInTime_(list, leftS);
    await shown;
    await this.composed();
    const skipped = [...(this.textureSet_?.planes.values() ?? [])].reduce((n, p) => n + this.skippedOf_(p), 0);
    await Promise.race([meshShown, sleepS(this.leftS_(1))]);
    this.load_.emit('deadline', { limit: this.load_.limitS, actual: this.load_.elapsedS(), skipped });
  }
  /** A share of the time left, for timers. */
  private leftS_(share: number): number {
    return Math.min(longestTimerS, Math.max(0, share * (this.load_.limitS - this.load_.elapsedS())));
  }
  /** Scale and planes: those for the display, or what looks best in the time. */
  private async choice_(data: PackageData): Promise<{ scale: number; planes: PlaneChoice[] }> {
    const { limitS, options, override, view } = this.load_;
    const { heightPx, part } = view.display;
    const wanted = override.scale ?? this.scaleFor(heightPx, part);
    if (options.fullSize || !Number.isFinite(limitS) || override.rung !== undefined)
      return { scale: wanted, planes: this.planesFor_(data) };
    const steps = choiceInTime(data, this.quality_!, {
      displayedPx: heightPx, wanted, only: override.scale !== undefined,
      connections: this.load_.reader.client.options.connections,
      afterMesh: (scale) => ({ htc: this.htc_(limitS - this.load_.elapsedS() - composeS - this.meshS_(scale)), linkBytesS: this.load_.beta0 }),
    });
    for (let step = steps.next(); ; step = steps.next()) {
      if (step.done) return step.value!;
      await sleepS(0); // the page goes on meanwhile
      throwIfAborted(this.load_.signal);
    }
  }
  /** What the mesh of a scale takes when nothing shares the link. */
  private meshS_(scale: number): number {
    const bytes = this.load_.scales.bytesOf(scale);
    return bytes > 0 ? bytes / this.load_.beta0 + this.load_.reader.client.latencyS : 0;
  }
  private htc_(timeLimitS: number): HtcOptions {
    const { policy, order } = this.load_.options;
    const defaults = defaultHtcOptions();
    const throughput = { ...defaults.throughput, initialBytesS: Math.max(1, this.load_.beta0) };
    const { latencyS: rttS } = this.load_.reader.client;
    return { ...defaults, policy: policy as Policy, order: order ?? 'credit', timeLimitS, rttS, throughput };
  }
  private skippedOf_(plane: ComposedPlane): number {
    const order = this.data_?.tables[plane.plane]?.order ?? [];
    return [...order].filter((f) => plane.rungs[f] < 0).length;
  }
  /** Waits until all that has come (but so many) is in its texture. */
  async composed(but = 0): Promise<void> {
    while (this.pending > but) {
      throwIfAborted(this.load_.signal);
      if (but === 0) await this.textureSet_?.settled();
      await sleepS(0.004);
    }
    if (but === 0) this.textureSet_?.finish();
  }

  private startTextures_(data: PackageData): Transfers {
    this.textureSet_ = new TextureSet(this.load_.options.renderer, data.textures, this.load_.materials, this.load_.pool);
    this.transfers_ = new Transfers(this.load_.reader, data.textures, this.load_.pool, {
      decoded: (wish, levels) => this.upload_(wish, levels),
      lost: (wish, error) => this.lost_(wish, error),
    });
    return this.transfers_;
  }
  private upload_(wish: Wish, levels: Levels): void {
    const { base, mip } = this.data_!.textures[wish.plane];
    const plane = this.textureSet_?.planes.get(mip > 0 ? base : wish.plane);
    if (this.load_.signal.aborted || !plane || plane.plane !== wish.plane) {
      this.ended_(wish);
      return levels.forEach((b) => b.close());
    }
    const { fragment, rung, replaces } = wish;
    const better = (there: number): boolean => rung > there || (!!replaces && this.load_.override.rung !== undefined);
    this.textureSet_!.upload(plane, levels, wish, better, (uploaded) => {
      this.ended_(wish);
      if (uploaded) this.load_.emit('fragment', { plane: wish.plane, fragment, rung });
    });
  }
  private began_(f: { plane: number; fragment: number }, rung: number): void {
    const key = `${f.plane}/${f.fragment}`;
    this.underWay_.set(key, [...(this.underWay_.get(key) ?? []), rung]);
  }
  private ended_(wish: Wish): void {
    const key = `${wish.plane}/${wish.fragment}`;
    const left = (this.underWay_.get(key) ?? []).filter((rung) => rung !== wish.rung);
    if (left.length > 0) this.underWay_.set(key, left);
    else this.underWay_.delete(key);
  }
  private lost_(wish: Wish, error: unknown): void {
    this.ended_(wish);
    if (isAbort(error) || this.load_.pool.none) return;
    this.gaveUp_.set(keyOf(wish, wish.rung), isForGood(error));
    this.load_.fail(error, `fragment ${wish.fragment} of plane ${wish.plane} at rung ${wish.rung}`);
  }
  /** What could not be had for a while may be asked for again. */
  forgetLosses(): void {
    for (const [key, forGood] of this.gaveUp_) if (!forGood) this.gaveUp_.delete(key);
  }
  /** Rungs of a list that were given up. */
  private refusedOf_({ fragments }: FragmentList): RefusedRung | undefined {
    return this.gaveUp_.size > 0 ? (offer, rung) => this.gaveUp_.has(keyOf(fragments[offer], rung)) : undefined;
  }

  /**
   * Shows textures by these planes; those that the first GLB does not show begin with the package's preview. Fragments may come from
   * then on; `shown` resolves when the scene has changed.
   */
  private async showPlanes_(choices: readonly PlaneChoice[], anew = false): Promise<{ shown: Promise<unknown> }> {
    const shown: Promise<void>[] = [];
    for (const choice of choices) {
      const { base, plane } = choice;
      const before = this.textureSet_!.planes.get(base);
      if (before?.plane === plane) continue;
      const info = this.data_!.textures[plane];
      // A plane that cannot be shown leaves what the mesh brought along.
      const lost = (error: unknown): void => this.load_.fail(error, `texture plane ${plane}`);
      let preview: ImageBitmap | undefined;
      try {
        if (!before && (anew || info.role === 'alpha' || !this.textureSet_!.isUsed(base))) preview = await this.preview_(base);
      } catch (error) {
        lost(error);
        continue;
      } finally {
        throwIfAborted(this.load_.signal);
      }
      const tell = (): void => this.load_.emit('plane', { base, plane, widthPx: info.widthPx, heightPx: info.heightPx });
      shown.push(this.textureSet_!.show(choice, preview).then(tell).catch(lost).finally(() => preview?.close()));
    }
    return { shown: Promise.all(shown) };
  }
  /** The GPU has lost everything: previews, then the fragments that there were. */
  async restore(): Promise<void> {
    if (!this.textureSet_ || !this.data_) return; // the mesh and its previews are three.js's own
    const { options, materials, pool } = this.load_;
    const before = [...this.textureSet_.planes.values()];
    this.textureSet_.dispose();
    this.textureSet_ = new TextureSet(options.renderer, this.data_.textures, materials, pool);
    await (await this.showPlanes_(before.map(({ base, plane }) => ({ base, plane })), true)).shown;
    const wishes = before.flatMap(({ plane, rungs }) => [...rungs].flatMap((rung, fragment) => (rung >= 0 ? [{ plane, fragment, rung, offer: 0 }] : [])));
    await this.fetchWishes_(wishes);
    await this.composed();
  }
  private async preview_(base: number): Promise<ImageBitmap> {
    const file = await this.load_.reader.preview(base, this.load_.signal);
    const none = new Uint8Array(0);
    const decoded = this.load_.pool.decode({ codec: 'jpeg', tables: none, streams: [file], digests: [], complete: true, levels: 1, most: [mostPreviewPx, mostPreviewPx] });
    return (await decoded)[0];
  }

  /** The scale that is enough at a displayed height: by the rule, or finer where that was measured to be seen. */
  scaleFor(heightPx: number, part: VisiblePart | undefined): number {
    const { rule } = this.load_.options;
    const { manifest } = this.load_.reader;
    if (rule && rule !== 'measured') return selectScale(manifest, heightPx, part, rule);
    const scale = selectScale(manifest, heightPx, part);
    const hidden = part?.clipped && part.widthPx === 0;
    return this.quality_ && !hidden ? finerWhereSeen(this.quality_, scale, heightPx) : scale;
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
    return this.load_.reader.form === 'files' && first !== undefined && !this.transfers_!.filesOf(first.plane).complete;
  }

  /** Every fragment at its override's rung, or the highest; at the next below where that one cannot be had. */
  private async fetchAll_(list: FragmentList): Promise<void> {
    const { override } = this.load_;
    const replaces = override.rung !== undefined;
    for (let lost = -1; lost < this.gaveUp_.size && !this.load_.pool.none; ) {
      if (this.underWay_.size > 0) await this.composed(); // nothing comes behind what replaces it
      lost = this.gaveUp_.size;
      const wishes = list.fragments.map((f, offer): Wish => {
        let rung = Math.min(override.rung ?? Infinity, list.offers[offer].bytes.length - 1);
        while (this.gaveUp_.has(keyOf(f, rung))) --rung;
        return { ...f, rung, offer, replaces };
      });
      const there = (w: Wish): boolean => (replaces ? this.rungOf_(w) === w.rung : this.rungOf_(w) >= w.rung);
      await this.fetchWishes_(wishes.filter((w) => w.rung >= 0 && !there(w)));
      await this.composed();
    }
  }
  private rungOf_(wish: { plane: number; fragment: number }): number {
    for (const p of this.textureSet_?.planes.values() ?? []) if (p.plane === wish.plane) return p.rungs[wish.fragment];
    return -1;
  }
  /** The rung of each fragment when all that is under way has come. */
  private rungsOf_(list: FragmentList): number[] {
    return list.fragments.map((f) => Math.max(this.rungOf_(f), ...(this.underWay_.get(`${f.plane}/${f.fragment}`) ?? [])));
  }
  /** How many have come. */
  private async fetchWishes_(wishes: readonly Wish[], signal = this.load_.signal): Promise<number> {
    for (const w of wishes) this.began_(w, w.rung);
    let arrived = 0;
    await this.transfers_!.fetch(wishes, { gapBytes, mostBytes: refineBytes, signal }, () => ++arrived, (wish, error) => this.lost_(wish, error));
    throwIfAborted(this.load_.signal);
    return arrived;
  }

  /** Harmonic Time Compensation: group by group, so that the last one comes at the limit. */
  private async fetchInTime_(fragments: FragmentList, limitS: number): Promise<void> {
    const { beta0 } = this.load_;
    const bytesEach = this.wholeRungs_ ? Infinity : groupBytes(beta0, this.load_.reader.client.latencyS, limitS);
    const list = groupedList(fragments, bytesEach, beta0 * limitS);
    const plan = new HarmonicTimePlan(list.offers, this.htc_(limitS));
    this.plan_ = plan;
    const fetch = new TimedFetch(plan, list, this.transfers_!, this.load_.signal, {
      decided: (step) => {
        if (step.doneS < 0) for (const f of list.groups[step.offer]) this.began_(f, step.rung);
        this.tell_(list, step);
      },
      lost: (wish, error) => this.lost_(wish, error),
    });
    await fetch.run(limitS + mostLate * this.load_.limitS);
    if (!this.wholeRungs_) await this.spendRest_(fragments, plan);
  }
  /** What a plan leaves of the time, because rungs do not fit it to the byte, goes into upgrades: ever smaller requests. */
  private async spendRest_(list: FragmentList, plan: HarmonicTimePlan): Promise<void> {
    const { limitS, reader } = this.load_;
    const { rttS: latencyS, options } = reader.client; // nothing else is on its way
    for (;;) {
      const leftS = limitS - composeS - this.load_.elapsedS();
      const bytes = certain * plan.throughputBytesS() * (leftS - latencyS);
      if (leftS < latencyS + leastRest * limitS) return;
      const taken = new Map<number, Wish>();
      const full = new Set<number>();
      let left = bytes;
      for (const u of upgradesInOrder(list.offers, this.rungsOf_(list), false, this.refusedOf_(list))) {
        const before = taken.get(u.offer);
        const more = u.bytes - (before ? list.offers[u.offer].bytes[before.rung] : 0);
        // What is too large leaves room for smaller ones; more requests at once would wait for connections.
        if (more > left || (!before && taken.size >= 2 * options.connections)) full.add(u.offer);
        if (full.has(u.offer)) continue;
        left -= more;
        taken.set(u.offer, { ...list.fragments[u.offer], rung: u.rung, offer: u.offer });
      }
      if (taken.size === 0) return;
      const late = AbortSignal.timeout(Math.ceil(1000 * (leftS + mostLate * limitS)));
      if ((await this.fetchWishes_([...taken.values()], AbortSignal.any?.([late, this.load_.signal]) ?? late)) === 0) return;
    }
  }
  private tell_(list: GroupedList, s: HtcStep): void {
    this.load_.emit('decision', {
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

  /** Planes with more texels where the view has come nearer; never back, as what is there is there. */
  async finerPlanes(): Promise<void> {
    const base = this.data_!;
    const wanted = this.planesFor_(base, this.load_.view.display.heightPx / hysteresis);
    const { planes: there } = this.textureSet_!;
    const finer = this.fitting_(base, wanted.filter((c) => there.has(c.base))).filter(
      (c) => there.get(c.base)!.widthPx < base.textures[c.plane].widthPx,
    );
    if (finer.length === 0) return;
    const planes = [...this.textureSet_!.planes.values()].map((p) => p.plane);
    this.data_ = await this.load_.reader.data([...planes, ...finer.map((c) => c.plane)], this.load_.signal);
    await this.transfers_!.prepare(finer.map((c) => c.plane), this.load_.signal);
    await (await this.showPlanes_(finer)).shown;
  }

  /** Fetches what saves most of what the camera sees; false when there is nothing left. */
  async refineSome(): Promise<boolean> {
    const data = this.data_!;
    const choices = [...this.textureSet_!.planes.values()].map(({ base, plane }) => ({ base, plane }));
    await sleepS(0);
    const list = this.listOf_(data, choices, Math.max(this.load_.shownScale, 0));
    if (this.load_.override.rung !== undefined) {
      await this.fetchAll_(list);
      return false;
    }
    if (this.wholeRungs_) return this.refineRung_(list);
    const seen = await this.seen_(choices);
    let bytes = 0;
    const rungs = this.rungsOf_(list);
    list.offers.forEach((o, i) => {
      const { plane, fragment } = list.fragments[i];
      const weight = seen?.get(plane)?.[fragment] ?? 1;
      const enough = this.goodEnough_(plane, fragment);
      o.bytes.length = Math.min(o.bytes.length, enough + 1);
      o.loss.length = o.bytes.length + 1;
      o.loss = o.loss.map((l) => l * (weight > 0 ? weight : unseen));
      if (weight === 0) rungs[i] = o.bytes.length - 1; // not to be seen: not to be fetched
    });
    const taken = new Map<number, number>();
    for (const u of upgradesInOrder(list.offers, rungs, false, this.refusedOf_(list))) {
      if (bytes > 0 && bytes + u.bytes > refineBytes * refineRequests) break;
      bytes += u.bytes;
      taken.set(u.offer, u.rung);
    }
    return this.round_([...taken].map(([offer, rung]) => ({ ...list.fragments[offer], rung, offer })), mostPending);
  }
  /** The next rung of the first plane that lacks some. */
  private async refineRung_(list: FragmentList): Promise<boolean> {
    const open: Wish[] = [];
    list.fragments.forEach((f, offer) => {
      let rung = this.rungOf_(f) + 1;
      while (this.gaveUp_.has(keyOf(f, rung))) ++rung;
      if (rung < list.offers[offer].bytes.length) open.push({ ...f, rung, offer });
    });
    const least = open.reduce((rung, w) => Math.min(rung, w.rung), Infinity);
    const wishes = open.filter((w) => w.rung === least && w.plane === open.find((o) => o.rung === least)!.plane);
    return this.round_(wishes, 0);
  }
  /** Fetches, until so many or fewer wait to be shown; false when there is no use in going on. */
  private async round_(wishes: readonly Wish[], mostWaiting: number): Promise<boolean> {
    if (this.load_.pool.none) return false;
    const lost = this.gaveUp_.size;
    if (wishes.length > 0) this.barren_ = (await this.fetchWishes_(wishes)) > 0 ? 0 : this.barren_ + 1;
    await this.composed(wishes.length > 0 ? mostWaiting : 0);
    // What was lost on the way leaves lower rungs to ask for.
    if (wishes.length > 0 ? this.barren_ < mostBarren : this.gaveUp_.size > lost) return true;
    this.barren_ = 0;
    return false;
  }

  /** The lowest rung of a fragment that nobody can tell from the source. */
  private goodEnough_(plane: number, fragment: number): number {
    const t = this.data_!.tables[plane]!;
    const limit = this.load_.options.refineTo ?? tellsApart;
    const rungs = t.rungQuality.length;
    for (let r = 0; r < rungs; ++r) if (t.dssim[r * t.columns * t.rows + fragment] <= limit) return r;
    return rungs - 1;
  }

  /** Share of each fragment that the camera sees, by plane; undefined without a camera. */
  private async seen_(choices: readonly PlaneChoice[]): Promise<Map<number, Float32Array> | undefined> {
    await sleepS(0); // the page goes on in between
    const { camera } = this.load_.view;
    const [shape] = this.load_.object.children;
    if (!camera || !shape) return undefined;
    if (this.surfaceScale_ !== this.load_.shownScale) {
      const slots = this.load_.materials.slots;
      this.surface_ = new VisibleSurface(this.load_.object, meshesOf(shape), (mesh: Mesh) => {
        const own = Array.isArray(mesh.material) ? mesh.material : [mesh.material];
        return new Set(slots.filter((s) => own.includes(s.material)).map((s) => s.image));
      });
      this.surfaceScale_ = this.load_.shownScale;
    }
    const seen = new Map<number, Float32Array>();
    for (const { plane } of choices) {
      const t = this.data_!.textures[plane];
      const cell: [number, number] = [t.fragmentWidthPx / t.widthPx, t.fragmentHeightPx / t.heightPx];
      await sleepS(0);
      seen.set(plane, this.surface_!.ofImage(t.image, t.columns, t.rows, camera, this.load_.object, cell));
    }
    return seen;
  }
}
