import { type FragmentList, type ListOptions, lossesOf } from '../decide/fragment_list';
import { scaleWithin } from '../decide/gpu_memory';
import { proxyBytes, scaleBytes } from '../decide/gpu_size';
import { clamp } from '../decide/numbers';
import { proxyLoss } from '../decide/proxy_choice';
import { proxyAhead, proxyStep } from '../decide/proxy_steps';
import { throughputOf } from '../decide/request_groups';
import { choiceInTime, refinedScale } from '../decide/scale_choice';
import { type PlaneChoice, pictureFlip } from '../decide/texture_loss';
import { type VisiblePart, finestShown, selectScale } from '../decide/viewing';
import { throwIfAborted } from '../format/errors';
import { worthwhileFlip } from '../format/shared_numbers';
import { nextTurn, nowS, sleepS } from '../http/requests';
import type { PlaneComposer } from './composer';
import { FetchInTime, composeS } from './fetch_in_time';
import { FragmentFetch, allWishes, bestWishes, requestBytes } from './fragment_fetch';
import { gpuBytes } from './gpu';
import type { LoadContext } from './load_context';
import type { ScaleSource } from './scale_source';
import { ShownPlanes, readPlaneData } from './shown_planes';
import type { ShownScale } from './shown_scale';

// Which larger proxy a load shows besides the smallest one.

/** Proxies on the way to scales are chosen as if the limit were no longer. */
const longestStepS = 60;

/** Throughput that whoever gave the load its turn expects, that options say, or that transfers have shown. */
export function throughputBytesS(
    { expectedBytesS, options: { beta0BytesS }, reader: { requests, client } }: LoadContext): number {
  return expectedBytesS || beta0BytesS || throughputOf(requests, client.latencyS);
}

const fits = ({ memoryBytes, reader: { manifest } }: LoadContext, proxy: number): boolean =>
  proxyBytes(manifest.proxies[proxy]) <= memoryBytes;

/** The larger proxy that pays on the way to scales; -1: none does. */
export function stepOf(load: LoadContext): number {
  const { reader: { manifest, client }, view: { display: { heightPx, part } }, memoryBytes } = load;
  const wanted = scaleWithin(manifest.scales, selectScale(manifest, heightPx, part), memoryBytes);
  const leftS = Math.min(load.limitS, longestStepS) - load.elapsedS();
  const step =
    proxyStep(manifest, wanted, heightPx, { bytesS: throughputBytesS(load), rttS: client.latencyS, leftS });
  return step >= 0 && fits(load, step) ? step : -1;
}

/** Bytes of all requests that are made at once while refining. */
const refineBytes = 4 * requestBytes;
/** Fragments that may wait for decoding and uploads when the next ones are asked for. */
const mostPending = 48;
/** Textures wait for a mesh no longer than this share of the time left when the mesh is asked for. */
const meshShare = 0.5;
const longestTimerS = 1e6;
/** The scale is compared with the proxy in the scene this often, seconds. */
const lookEachS = 0.1;
/** In the timed part, an unseen surface is worth this much of a seen one. */
const unseen = 1e-3;
/**
 * Share of the time left that showing a plane may take, by what earlier ones took: without a graphics card .1
 * to .8 s for 4 million texels.
 */
const showShare = 0.6;
/** Share of the throughput that a proxy counts on: a link that slows down a little makes none late. */
const proxyCertain = 0.9;
/** Where less than this share of the time is left, scale and planes are chosen anew. */
const sameTime = 0.8;
/** 1 - SSIM at which refining ends by default. */
const defaultRefineTo = 0.003;
/** Refining ends where so many rounds have brought nothing. */
const mostFruitlessRounds = 3;

/** Reads the documents that decisions about textures are made from. */
export async function openTextureLoad(load: LoadContext, scale: ShownScale,
    source: ScaleSource): Promise<TextureLoad> {
  const data = await readPlaneData(load, source);
  return new TextureLoad(load, scale, source, new FragmentFetch(load, new ShownPlanes(load, data)));
}

/** The second part of a load, loaded on the way: chooses fragments, fetches them in time, refines. */
export class TextureLoad {
  private readonly planes_: ShownPlanes;
  private readonly inTime_: FetchInTime;
  private list_?: FragmentList;
  private alike_?: (scale: number) => number; // by the viewer's own JND
  private lookedS_ = 0; // when the proxy and the scale were compared last
  private had_?: PlaneComposer[]; // what the GPU has lost and is being made anew
  private restores_ = 0;
  private finer_ = Promise.resolve(); // the mesh that refining ends with
  private readonly lostProxies_ = new Set<number>();
  private fruitlessRounds_ = 0; // rounds of refining that brought nothing, one after the other

  constructor(private readonly load_: LoadContext, private readonly scale_: ShownScale,
      private readonly source_: ScaleSource, private readonly fetching_: FragmentFetch) {
    this.planes_ = fetching_.planes;
    this.inTime_ = new FetchInTime(load_, fetching_);
    scale_.scaleFor = (...of) => this.scaleFor_(...of);
    scale_.behind = () => this.releaseIfBetter_();
    if (scale_.held) load_.events.on('fragment', () => this.releaseInTime_());
  }

  planes(): PlaneComposer[] {
    return this.planes_.all();
  }
  pending(): number {
    return this.fetching_.pending();
  }
  throughputBytesS(): number | undefined {
    return this.inTime_.throughputBytesS();
  }
  showInNewMaterials(): void {
    this.planes_.showInNewMaterials();
  }
  readPlane(base: number): Uint8Array | undefined {
    return this.planes_.readPlane(base);
  }
  lose(): void {
    this.planes_.lose();
  }
  dispose(): void {
    this.fetching_.dispose();
  }

  // ---- in time

  /** Scale and textures within the time. */
  async timedPart(): Promise<void> {
    const { load_: load, fetching_: fetching } = this;
    const { reader, options } = load;
    load.beta0 = throughputBytesS(load);
    if (options.policy === 'thesis') this.inTime_.printed = await import('../decide/thesis_list');
    if (options.jnd !== undefined)
      this.alike_ = await (await import('../decide/thesis_list')).coarsestAlike(load);
    let choice = await this.choice_();
    for (let leftS = this.inTime_.leftS(); leftS > 0 && choice.flip !== undefined; ) {
      // Behind a proxy that looks better than scales do in the time, the rest is refining.
      if (await this.showBetterProxies_(choice.flip)) return this.endTimed_();
      if (this.inTime_.leftS() > sameTime * leftS || !this.scale_.held) break;
      leftS = this.inTime_.leftS();
      choice = await this.choice_(); // what was tried has taken time
    }
    const { scale, planes: chosen } = choice;
    if (scale !== this.scale_.shown) load.enter('mesh');
    const meshBytes = this.source_.bytesOf(scale);
    const mesh = this.scale_.load(scale);
    // Picture and fragments stand without the mesh, too.
    const meshShown = mesh.shown.catch((error: unknown) => this.scale_.lost(error, scale));
    const { shown } = await this.showPlanes_(chosen, scale);
    this.list_ = await fetching.listOf(scale, unseen, this.scale_.surface());
    // A mesh that takes less than a round trip leaves the link to the textures. A longer one is waited for;
    // coarser scales show on its way.
    if (meshBytes > load.beta0 * reader.client.latencyS)
      await Promise.race([mesh.arrived, this.timer_(meshShare)]);
    load.enter('textures');
    await this.fetchTimed_(this.list_);
    await shown;
    await fetching.composed();
    // refining asks for them, too
    await this.useRest_().catch((error: unknown) => load.fail(error, 'finer planes'));
    throwIfAborted(load.signal);
    const skipped = this.skippedFragments_();
    await Promise.race([meshShown, this.timer_(1)]);
    this.releaseIfBetter_();
    this.endTimed_(skipped);
  }
  private endTimed_(skipped = 0): void {
    const { load_: load } = this;
    load.emit('deadline', { limit: load.limitS, actual: load.elapsedS(), skipped });
  }
  /** Shows larger proxies where scales look worse in the time. True: that was the time. */
  private async showBetterProxies_(flip: number): Promise<boolean> {
    const { scale_, load_: load, inTime_: inTime, lostProxies_: lost } = this;
    const { beta0, reader: { manifest, client }, view: { display: { heightPx } } } = load;
    const { proxy } = scale_;
    const better = { flip: flip - worthwhileFlip, fits: (k: number) => fits(load, k) && !lost.has(k) };
    const link = { bytesS: proxyCertain * beta0, rttS: client.latencyS };
    const isFree = (): boolean => scale_.held && load.override.scale === undefined && !inTime.printed;
    const next = (): number =>
      proxyAhead(manifest, proxy.shown, heightPx, { ...link, leftS: inTime.leftS() }, better);
    for (let k; isFree() && (k = next()) >= 0; )
      try {
        await load.untilLimit((signal) => proxy.show(k, proxy.fetch(k, signal)));
      } catch (error) {
        throwIfAborted(load.signal);
        lost.add(k); // the smaller one stays
        load.fail(error, 'proxy');
      }
    return isFree() && (inTime.leftS() <= 0 || proxyLoss(manifest, proxy.shown, heightPx).flip < better.flip);
  }
  /** Shows the previews of these planes beside a scale. The second promise is that the scene has changed. */
  private async showPlanes_(chosen: readonly PlaneChoice[],
      scale: number): Promise<{ shown: Promise<unknown> }> {
    const { planes_: planes, fetching_: fetching, load_: { signal } } = this;
    // Coverage that no material asks for is not fetched.
    const choices = planes.fitting(chosen, scale)
      .filter(({ base }) => planes.textures[base].role !== 'alpha' || planes.isUsed(base));
    const [showing] = await Promise.all([planes.show(choices),
      fetching.transfers.prepare(choices.map((c) => c.plane), signal)]);
    return showing;
  }
  /** The scale takes the proxy's place once the scale is predicted to look better. */
  private releaseIfBetter_(): void {
    const { list_: list, scale_: scale, planes_: planes,
      load_: { override, view: { display: { heightPx } }, reader: { manifest } } } = this;
    if (!list || !scale.held || scale.shown < 0) return;
    this.lookedS_ = nowS();
    const losses = lossesOf(list, list.fragments.map((f) => planes.rungOf(f)));
    const flip = pictureFlip(planes.data.quality, heightPx, scale.shown, losses);
    if (override.scale === scale.shown || flip <= proxyLoss(manifest, scale.proxy.shown, heightPx).flip)
      scale.release();
  }
  private releaseInTime_(): void {
    if (this.scale_.held && nowS() > this.lookedS_ + lookEachS) this.releaseIfBetter_();
  }
  private async fetchTimed_(list: FragmentList): Promise<void> {
    const { load_: load } = this;
    for (const o of list.offers) load.expectedBytes += o.plannedBytes;
    const fragmentsS = this.inTime_.leftS() - composeS;
    const given = load.override.rung !== undefined;
    if (given || !Number.isFinite(fragmentsS))
      while (given === (load.override.rung !== undefined) && (await this.refineSome_(true)));
    else if (fragmentsS > 0 && !load.pool.isUnavailable && list.offers.length > 0)
      await this.inTime_.run(list, fragmentsS);
  }
  /** All that was chosen came early: planes with more texels take the rest, each with fragments of it. */
  private async useRest_(): Promise<void> {
    const { load_: load, planes_: planes, fetching_: fetching, inTime_: inTime } = this;
    if (load.options.turn || !inTime.hasPlan) return; // other models wait for the link
    for (;;) {
      const scale = Math.max(this.scale_.shown, 0);
      const finer =
        planes.nextFiner(scale, showShare * (inTime.leftS() - composeS - load.reader.client.rttS));
      if (!finer) return;
      await this.prepare_([finer]);
      await Promise.race([(await planes.show([finer])).shown, this.timer_(1)]);
      if (!planes.showing(finer)) return; // could not be shown
      this.list_ = await fetching.listOf(scale, unseen, this.scale_.surface());
      await inTime.spendRest(this.list_);
      await fetching.composed();
    }
  }
  /** Number of fragments whose previews are shown. */
  private skippedFragments_(): number {
    const { tables } = this.planes_.data;
    const skippedOf = ({ plane, rungs }: PlaneComposer): number =>
      tables[plane]!.order.filter((f) => rungs[f] < 0).length;
    return this.planes().reduce((n, p) => n + skippedOf(p), 0);
  }
  /** Resolves after a share of the time left. */
  private timer_(share: number): Promise<void> {
    return sleepS(clamp(share * this.inTime_.leftS(), 0, longestTimerS));
  }
  /** The scale that is enough at a displayed height, or the finest that its pictures may ask for. */
  private scaleFor_(heightPx: number, part: VisiblePart | undefined, finest = false): number {
    const { options: { rule = 'flip' }, memoryBytes, reader: { manifest } } = this.load_;
    const isSeen = !part?.clipped || part.widthPx * part.heightPx > 0;
    const scale = finest && isSeen && rule === 'flip' && !this.alike_
      ? finestShown(manifest.scales, heightPx) : selectScale(manifest, heightPx, part, rule);
    return scaleWithin(manifest.scales, this.alike_?.(scale) ?? scale, memoryBytes);
  }
  /** Scale and planes for the display, or those that look best in the time. */
  private async choice_(): Promise<{ scale: number; planes: PlaneChoice[]; flip?: number }> {
    const { load_: load, planes_: planes, fetching_: fetching } = this;
    const { override, options, limitS, beta0, reader: { client }, view: { display } } = load;
    const wanted = override.scale ?? this.scaleFor_(display.heightPx, display.part);
    const finest = this.scaleFor_(display.heightPx, display.part, true);
    await planes.considerCompression(Math.min(wanted, finest));
    if (options.fullSize || !Number.isFinite(limitS) || override.rung !== undefined) {
      const endsHere = options.autoRefine === false; // else refining ends with the finer one
      return { scale: endsHere ? this.refinedScale_(wanted) : wanted, planes: planes.forDisplay() };
    }
    /** Seconds that so many bytes of mesh take when nothing shares the link. */
    const meshS = (bytes: number): number => (bytes > 0 ? bytes / beta0 + client.latencyS : 0);
    const limitAfterMeshS = (scale: number): number =>
      this.inTime_.leftS() - composeS - meshS(this.source_.bytesOf(scale));
    const { printed } = this.inTime_;
    let listed: Partial<ListOptions> | undefined;
    const spend = printed && ((...of: Parameters<typeof printed.thesisTextures>) => {
      const textures = printed.thesisTextures(...of);
      listed = textures.options;
      return textures;
    });
    const steps = choiceInTime(planes.data, {
      displayedPx: display.heightPx, wanted, finest,
      only: override.scale !== undefined || !!printed, textures: spend,
      connections: client.options.connections,
      memoryBytes: load.memoryBytes, ways: planes.ways,
      afterMesh: (scale) => ({ plan: this.inTime_.planOptions(limitAfterMeshS(scale)), linkBytesS: beta0 }),
    });
    for (;;) {
      const { done, value } = steps.next();
      if (done) {
        fetching.listOptions = listed ?? { groupWeights: value!.list.groupWeights };
        return value!;
      }
      await nextTurn(); // the page goes on meanwhile
      throwIfAborted(load.signal);
    }
  }

  // ---- refining

  /** Fetches what camera and display can show, until nothing is left or somebody asks for another turn. */
  async refine(again: () => boolean): Promise<void> {
    const { planes_: planes, scale_: { wanted } } = this;
    this.fetching_.fates.allowLostAgain();
    // Behind a proxy that took the whole time.
    if (planes.all().length === 0) {
      await planes.considerCompression(wanted);
      await (await this.showPlanes_(planes.forDisplay(), wanted)).shown;
    }
    await this.showFinerPlanes_();
    while (!again() && (await this.refineSome_()));
    if (!again()) await this.fetching_.composed();
    this.releaseIfBetter_();
    if (again()) return;
    const finer = this.refinedScale_();
    if (finer !== this.scale_.wanted) this.finer_ = this.scale_.follow(finer);
    // A mesh on its way keeps no other view waiting.
    let isThere = false;
    void this.finer_.then(() => (isThere = true));
    while (!isThere && !again()) await Promise.race([this.finer_, sleepS(lookEachS)]);
    this.releaseIfBetter_();
  }
  /** The scale that refining ends with, within the memory that planes leave. */
  private refinedScale_(enough = this.scale_.wanted): number {
    const { planes_: { data }, load_: { override, memoryBytes, view: { display } } } = this;
    const { heightPx, part } = display;
    const finest = this.scaleFor_(heightPx, part, true);
    if (override.scale !== undefined || finest === this.scaleFor_(heightPx, part)) return enough;
    const roomBytes = memoryBytes - gpuBytes([], [], this.planes_.all());
    const fitting = data.manifest.scales.find((s) => s.scale >= finest && scaleBytes(s) <= roomBytes);
    return Math.min(enough, refinedScale(data, heightPx, fitting?.scale ?? enough));
  }
  /**
   * After the GPU has lost everything, or has refused something: shows previews within the memory that there
   * is now, then fetches the fragments that were there. True: the picture is coarser than before.
   */
  async restore(): Promise<boolean> {
    const { planes_: planes, scale_: scale, fetching_: fetching } = this;
    const turn = ++this.restores_;
    const before = (this.had_ ??= planes.all());
    const coarserScale = this.followMemory_();
    const choices = planes.fitting(before, scale.wanted);
    const had = new Map(before.map((p) => [p.base, p]));
    const coarser = choices.filter(({ base, plane }) => had.get(base)!.plane !== plane);
    await this.prepare_(coarser);
    await planes.showAnew(choices);
    const wishes = choices.flatMap(({ base, plane }) => {
      const { plane: was, rungs } = had.get(base)!;
      if (was === plane) return [...rungs].map((rung, fragment) => ({ plane, fragment, rung, offer: 0 }));
      // Other fragments, and other rungs: each at the best quality of those that were there.
      const { tables } = planes.data;
      const { order, rungQuality } = tables[plane]!;
      const quality = tables[was]!.rungQuality[Math.max(...rungs)];
      if (!quality) return []; // nothing but the preview was there
      const rung = rungQuality.filter((q) => q < quality).length;
      return [...order].map(
        (fragment) => ({ plane, fragment, rung: Math.min(rung, rungQuality.length - 1), offer: 0 }));
    });
    await fetching.fetch(wishes.filter((w) => w.rung >= 0));
    await fetching.composed();
    if (turn === this.restores_) this.had_ = undefined; // or the GPU has lost it once more
    return (await coarserScale) || coarser.length > 0;
  }
  /** Shows a coarser scale where the memory has no room for the one that is wanted. False: there is room. */
  private async followMemory_(): Promise<boolean> {
    const { scale_: scale, source_: source, load_: { memoryBytes, override, reader: { manifest } } } = this;
    const within = scaleWithin(manifest.scales, scale.wanted, memoryBytes);
    source.leaveGpu();
    if (scale.wanted < 0 || within === scale.wanted || override.scale !== undefined) return false;
    await scale.follow(within);
    source.leaveGpu();
    return true;
  }
  private async showFinerPlanes_(): Promise<void> {
    const finer = this.planes_.finer(Math.max(this.scale_.shown, 0));
    if (finer.length === 0) return;
    await this.prepare_(finer);
    await (await this.planes_.show(finer)).shown;
  }
  private async prepare_(choices: readonly PlaneChoice[]): Promise<void> {
    const asked = choices.map((c) => c.plane);
    await this.planes_.readTables(asked);
    await this.fetching_.transfers.prepare(asked, this.load_.signal);
  }
  /** Fetches some wanted fragments, `all` or those that are seen. False: nothing is left, or of use. */
  private async refineSome_(all = this.load_.override.rung !== undefined ||
      this.fetching_.wholeRungs()): Promise<boolean> {
    const { load_: load, fetching_: fetching } = this;
    await sleepS(0);
    if (load.pool.isUnavailable) return false;
    if (all) await fetching.composed(); // a fragment must not come behind the one that replaces it
    // fragments that are not seen are not fetched
    const list = await fetching.listOf(Math.max(this.scale_.shown, 0), 0, this.scale_.surface());
    this.list_ = list;
    const enough = load.options.refineTo ?? defaultRefineTo;
    const wishes = all ? allWishes(list, load.override.rung, fetching)
      : bestWishes(list, refineBytes, enough, this.planes_.data, fetching);
    const before = fetching.fates.losses;
    const asked = wishes.length > 0;
    if (asked) this.fruitlessRounds_ = (await fetching.fetch(wishes)) > 0 ? 0 : this.fruitlessRounds_ + 1;
    await fetching.composed(asked && !all ? mostPending : 0);
    // A fragment that was lost on the way leaves lower rungs to ask for.
    if (asked ? this.fruitlessRounds_ < mostFruitlessRounds : fetching.fates.losses > before) return true;
    this.fruitlessRounds_ = 0;
    return false;
  }
}
