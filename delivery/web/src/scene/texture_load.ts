import type { Mesh } from 'three';
import { FragmentList, PlaneChoice, fragmentList, fullSize, planesForDisplay } from '../decide/fragment_list';
import { clamp } from '../decide/numbers';
import { HtcStep, Policy, TimePlanOptions } from '../decide/plan_types';
import { spendBytes } from '../decide/rate_distortion';
import { groupBytes, groupedList, throughputOf } from '../decide/request_groups';
import { choiceInTime, finerWhereSeen } from '../decide/scale_choice';
import { UncheckedPlan } from '../decide/unchecked_plan';
import { VisiblePart, selectScale } from '../decide/viewing';
import { InputError, isAbort, throwIfAborted } from '../format/errors';
import { mostPreviewPx } from '../format/layout';
import { PackageData } from '../format/package_data';
import { TextureInfo, fullSizePlanes } from '../format/textures';
import { sleepS } from '../http/clock';
import { isForGood } from '../http/requests';
import type { PlaneComposer } from './composer';
import { LoadContext, hysteresis } from './load_context';
import { textureSet } from './texture_set';
import { timedFetch } from './timed_fetch';
import { Transfers, Wish } from './transfers';
import { seenShares } from './visibility';

/** What decoding and uploading take after the last byte: 4 ms, or 11, on a machine whose GPU is its processor. */
const composeS = 0.015;
/** Fragments that are this late, of the limit, are given up. */
const mostLate = 0.02;
/** Bytes of a request while refining, and of all that are made at once. */
const requestBytes = 256 << 10;
const refineBytes = 4 * requestBytes;
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
/** What the camera does not see is worth this much of what it sees, while there is time. */
const unseen = 1e-3;
const tellsApart = 0.003;
/** Refining ends where so many rounds have brought nothing. */
const mostBarren = 3;

/** A fragment at a rung: on its way, not to be had for now, or never. */
type Fate = 'comes' | 'lost' | 'gone';
const keyOf = (f: { plane: number; fragment: number }, rung: number): string => `${f.plane}/${f.fragment}/${rung}`;

/** What a load does once the first picture stands. */
export type TextureLoad = Awaited<ReturnType<typeof textureLoad>>;

/**
 * What a load does once the first picture stands: decides what to fetch, fetches it in time, refines. In a part of its
 * own that is loaded while the first picture comes, so that nobody waits for it. Reads first what decisions are made from.
 */
export async function textureLoad(load: LoadContext) {
  const { reader, options, pool, scales, signal, limitS } = load;
  const { client } = reader;
  let data = await documents();
  const { textures } = data;
  const quality = await reader.quality(signal);
  const fates = new Map<string, Fate>(); // by keyOf
  let losses = 0;
  let barren = 0; // rounds of refining that brought nothing, one after the other
  let plan: UncheckedPlan | undefined;
  const newSet = () => textureSet(options.renderer, textures, load.materials, pool);
  let set = newSet();
  const transfers = new Transfers(reader, textures, pool, {
    async decoded(wish, levels) {
      const { plane, fragment, rung, replaces } = wish;
      const to = planeOf(wish);
      const better = (there: number): boolean => rung > there || (!!replaces && load.override.rung !== undefined);
      const shown = to && !signal.aborted && (await set.upload(to, levels, fragment, rung, better));
      levels.forEach((b) => b.close());
      fates.delete(keyOf(wish, rung));
      if (shown) load.emit('fragment', { plane, fragment, rung });
    },
    lost,
  });

  // ---- what there is

  async function documents(): Promise<PackageData> {
    pool.start();
    const [whole] = await Promise.all([reader.prefetchDocuments(signal), scales.openStream()]);
    if (whole) return reader.data(undefined, signal);
    const all = await reader.textures(signal);
    const base = [...Array(fullSizePlanes(all)).keys()];
    const shown = planesFor(await reader.data(base, signal));
    // With the mips below, which a short time may ask for.
    const among = (t: TextureInfo): boolean => shown.some((c) => t.mip > 0 && t.base === c.base && t.mip >= all[c.plane].mip);
    return reader.data([...base, ...all.flatMap((t, p) => (among(t) ? [p] : []))], signal);
  }
  function planesFor(from: PackageData, displayedPx = load.view.display.heightPx): PlaneChoice[] {
    return options.fullSize ? fullSize(from.textures) : planesForDisplay(from, displayedPx);
  }
  /** Planes that the GPU can hold: a mip where it cannot; where there is none, what the mesh brought along stays. */
  function fitting(choices: readonly PlaneChoice[]): PlaneChoice[] {
    const most = options.renderer.capabilities.maxTextureSize;
    const fits = (t: TextureInfo): boolean => Math.max(t.widthPx, t.heightPx) <= most;
    return choices.flatMap(({ base, plane }) => {
      // Mips stand in falling order of their size.
      const taken = fits(textures[plane]) ? plane : textures.findIndex((t) => t.mip > 0 && t.base === base && fits(t));
      if (taken >= 0) return [{ base, plane: taken }];
      load.fail(new InputError('GPU', `texture plane ${plane}`, `at most ${most} px`, 'more'), 'textures');
      return [];
    });
  }
  const planes = (): PlaneComposer[] => [...set.planes.values()];
  const planeOf = (f: { plane: number }): PlaneComposer | undefined => planes().find((p) => p.plane === f.plane);
  const rungOf = (f: { plane: number; fragment: number }): number => planeOf(f)?.rungs[f.fragment] ?? -1;
  const refused = (f: { plane: number; fragment: number }, rung: number): boolean => (fates.get(keyOf(f, rung)) ?? 'comes') !== 'comes';
  const pending = (): number => transfers.pending + set.pending;
  /** Waits until all that has come (but so many) is in its texture. */
  async function composed(but = 0): Promise<void> {
    for (; pending() > but; await sleepS(0.004)) throwIfAborted(signal);
    if (but === 0) set.finish();
  }
  /**
   * The list of what may be fetched of the planes shown, with the bytes that fetching takes. Losses count by what the camera sees of a
   * fragment, the rest of it by `unseen`.
   */
  async function listOf(scale: number, unseen: number): Promise<FragmentList> {
    const seen = new Map<number, Float32Array | undefined>();
    for (const { plane } of planes()) {
      await sleepS(0); // the page goes on in between
      seen.set(plane, shares(plane));
    }
    const list = fragmentList(data, planes(), { scale });
    list.offers.forEach((offer, i) => {
      const { plane, fragment } = list.fragments[i];
      offer.bytes = offer.bytes.map((b, r) => transfers.bytesOf(plane, r, fragment) || b);
      offer.loss = offer.loss.map((l) => l * Math.max(unseen, seen.get(plane)?.[fragment] ?? 1));
    });
    return list;
  }
  /** Share of each fragment that the camera sees; undefined without a camera. */
  function shares(plane: number): Float32Array | undefined {
    const slots = load.materials.slots.filter((s) => s.image === textures[plane].image);
    const shows = (mesh: Mesh): boolean => [mesh.material].flat().some((m) => slots.some((s) => s.material === m));
    return load.view.camera && seenShares(textures[plane], load.object, load.view.camera, shows);
  }
  /** A rung comes as a whole, whatever is asked for: a tree without files of fragments. */
  function wholeRungs(): boolean {
    const [first] = planes();
    return reader.form === 'files' && !!first && !transfers.filesOf(first.plane).complete;
  }

  // ---- planes

  /**
   * Shows textures by these planes; those that the first GLB does not show begin with the package's preview. Fragments may come from
   * then on; `shown` resolves when the scene has changed.
   */
  async function showPlanes(choices: readonly PlaneChoice[], anew = false): Promise<{ shown: Promise<unknown> }> {
    const shown: Promise<void>[] = [];
    for (const choice of choices) {
      const { base, plane } = choice;
      const { role, widthPx, heightPx } = textures[plane];
      // A plane that cannot be shown leaves what the mesh brought along.
      const lostPlane = (error: unknown): void => load.fail(error, `texture plane ${plane}`);
      try {
        const needed = !set.planes.has(base) && (anew || role === 'alpha' || !set.isUsed(base));
        const preview = needed ? await previewOf(base) : undefined;
        throwIfAborted(signal); // what is shown from now on nobody would dispose of
        const tell = (): void => load.emit('plane', { base, plane, widthPx, heightPx });
        shown.push(set.show(choice, preview).then(tell, lostPlane).finally(() => preview?.close()));
      } catch (error) {
        lostPlane(error);
      }
      throwIfAborted(signal);
    }
    return { shown: Promise.all(shown) };
  }
  async function previewOf(base: number): Promise<ImageBitmap> {
    const streams = [await reader.preview(base, signal)];
    const most: [number, number] = [mostPreviewPx, mostPreviewPx];
    return (await pool.decode({ codec: 'jpeg', tables: new Uint8Array(0), streams, digests: [], complete: true, levels: 1, most }))[0];
  }
  /** Planes with more texels where the view has come nearer; never back, as what is there is there. */
  async function finerPlanes(): Promise<void> {
    const wanted = planesFor(data, load.view.display.heightPx / hysteresis).filter((c) => set.planes.has(c.base));
    const finer = fitting(wanted).filter((c) => set.planes.get(c.base)!.widthPx < textures[c.plane].widthPx);
    if (finer.length === 0) return;
    const asked = finer.map((c) => c.plane);
    data = await reader.data([...planes().map((p) => p.plane), ...asked], signal);
    await transfers.prepare(asked, signal);
    await (await showPlanes(finer)).shown;
  }

  // ---- fetching

  function lost(wish: Wish, error: unknown): void {
    const key = keyOf(wish, wish.rung);
    fates.delete(key);
    if (isAbort(error) || pool.none) return;
    ++losses;
    fates.set(key, isForGood(error) ? 'gone' : 'lost');
    load.fail(error, `fragment ${wish.fragment} of plane ${wish.plane} at rung ${wish.rung}`);
  }
  /** How many have come. */
  async function fetchWishes(wishes: readonly Wish[], until = signal): Promise<number> {
    for (const w of wishes) fates.set(keyOf(w, w.rung), 'comes');
    let arrived = 0;
    await transfers.fetch(wishes, { gapBytes, mostBytes: requestBytes, signal: until }, () => ++arrived, lost);
    throwIfAborted(signal);
    return arrived;
  }
  /** Upgrades that save most for these bytes, by plane and importance: over what there will be when all that is under way has come. */
  function upgrades({ offers, fragments }: FragmentList, most: number): Wish[] {
    const curves = offers.map(({ bytes, loss }, offer) => {
      const f = fragments[offer];
      let from = bytes.length - 1;
      while (from > rungOf(f) && fates.get(keyOf(f, from)) !== 'comes') --from;
      const may = (rung: number): boolean => rung > from && !refused(f, rung);
      return { bytes: [0, ...bytes.map((b, rung) => (may(rung) ? b : Infinity))], loss: [loss[from + 1], ...loss.slice(1)] };
    });
    const ways = spendBytes(curves, most);
    return fragments.map((f, offer): Wish => ({ ...f, offer, rung: ways[offer] - 1 })).filter((w) => w.rung >= 0);
  }
  /** Every fragment at its override's rung, or the highest; at the next below where that one cannot be had. */
  function everything({ offers, fragments }: FragmentList): Wish[] {
    const { rung: only } = load.override;
    const wishes = fragments.map((f, offer): Wish => {
      let rung = Math.min(only ?? Infinity, offers[offer].bytes.length - 1);
      while (refused(f, rung)) --rung;
      return { ...f, rung, offer, replaces: only !== undefined };
    });
    return wishes.filter((w) => w.rung >= 0 && (w.replaces ? rungOf(w) !== w.rung : rungOf(w) < w.rung));
  }
  /** What saves most, up to where nobody can tell the difference. */
  function best(list: FragmentList): Wish[] {
    list.offers.forEach((o, i) => {
      const { plane, fragment } = list.fragments[i];
      const { rungQuality, dssim, columns, rows } = data.tables[plane]!;
      const good = (r: number): boolean => dssim[r * columns * rows + fragment] <= (options.refineTo ?? tellsApart);
      const enough = [...rungQuality.keys()].findIndex(good) + 1 || rungQuality.length;
      o.bytes = o.bytes.slice(0, enough);
    });
    const wishes = upgrades(list, refineBytes);
    return wishes.length > 0 ? wishes : upgrades(list, Infinity).slice(0, 1);
  }
  /** Fetches some of what is still wanted, of everything or what the camera sees; false when there is nothing left, or no use in going on. */
  async function refineSome(all = load.override.rung !== undefined || wholeRungs()): Promise<boolean> {
    await sleepS(0);
    if (pool.none) return false;
    if (all) await composed(); // nothing comes behind what replaces it
    const list = await listOf(Math.max(load.shownScale, 0), 0); // what is not to be seen is not to be fetched
    const wishes = all ? everything(list) : best(list);
    const before = losses;
    const some = wishes.length > 0;
    if (some) barren = (await fetchWishes(wishes)) > 0 ? 0 : barren + 1;
    await composed(some && !all ? mostPending : 0);
    // What was lost on the way leaves lower rungs to ask for.
    if (some ? barren < mostBarren : losses > before) return true;
    barren = 0;
    return false;
  }

  // ---- in time

  const leftS = (): number => limitS - load.elapsedS();
  /** A share of the time left, for timers. */
  const timeS = (share: number): Promise<void> => sleepS(clamp(share * leftS(), 0, longestTimerS));
  function planOptions(timeLimitS: number): TimePlanOptions {
    const { policy, order = 'credit' } = options;
    return { policy: policy as Policy, order, timeLimitS, rttS: client.latencyS, initialBytesS: Math.max(1, load.beta0) };
  }
  /** The scale that is enough at a displayed height: by the rule, or finer where that was measured to be seen. */
  function scaleFor(heightPx: number, part: VisiblePart | undefined): number {
    const { rule = 'measured' } = options;
    const scale = selectScale(reader.manifest, heightPx, part, rule === 'measured' ? 'default' : rule);
    const hidden = part?.clipped && part.widthPx === 0;
    return quality && rule === 'measured' && !hidden ? finerWhereSeen(quality, scale, heightPx) : scale;
  }
  /** Scale and planes: those for the display, or what looks best in the time. */
  async function choice(): Promise<{ scale: number; planes: PlaneChoice[] }> {
    const { override, view: { display } } = load;
    const wanted = override.scale ?? scaleFor(display.heightPx, display.part);
    if (options.fullSize || !Number.isFinite(limitS) || override.rung !== undefined) return { scale: wanted, planes: planesFor(data) };
    /** What the mesh of a scale takes when nothing shares the link. */
    const meshS = (bytes: number): number => (bytes > 0 ? bytes / load.beta0 + client.latencyS : 0);
    const steps = choiceInTime(data, quality!, {
      displayedPx: display.heightPx, wanted, only: override.scale !== undefined, connections: client.options.connections,
      afterMesh: (scale) => ({ plan: planOptions(leftS() - composeS - meshS(scales.bytesOf(scale))), linkBytesS: load.beta0 }),
    });
    for (;;) {
      const { done, value } = steps.next();
      if (done) return value!;
      await sleepS(0); // the page goes on meanwhile
      throwIfAborted(signal);
    }
  }
  /** Scale and textures within the time. */
  async function timedPart(): Promise<void> {
    load.beta0 = options.beta0BytesS || throughputOf(reader.requests, client.latencyS);
    const { scale, planes: chosen } = await choice();
    if (scale !== load.shownScale) load.enter('mesh');
    const meshBytes = scales.bytesOf(scale);
    const mesh = load.showScale(scale);
    // Without it picture and fragments stand all the same.
    const meshShown = mesh.shown.catch((error: unknown) => load.lostScale(error, scale));
    // Coverage that no material asks for is not fetched.
    const choices = fitting(chosen).filter(({ base }) => textures[base].role !== 'alpha' || set.isUsed(base));
    const [{ shown }] = await Promise.all([showPlanes(choices), transfers.prepare(choices.map((c) => c.plane), signal)]);
    // A mesh that is only waited for leaves the link to the textures.
    // One that takes longer than it should has coarser scales to show on its way.
    if (meshBytes > load.beta0 * client.latencyS) await Promise.race([mesh.arrived, timeS(meshShare)]);
    load.enter('textures');
    const list = await listOf(scale, unseen);
    for (const o of list.offers) load.expectedBytes += o.plannedBytes;
    const fragmentsS = leftS() - composeS;
    const given = load.override.rung !== undefined;
    if (given || !Number.isFinite(fragmentsS)) while (given === (load.override.rung !== undefined) && (await refineSome(true)));
    else if (fragmentsS > 0 && !pool.none && list.offers.length > 0) await fetchInTime(list, fragmentsS);
    await shown;
    await composed();
    const skippedOf = ({ plane, rungs }: PlaneComposer): number => data.tables[plane]!.order.filter((f) => rungs[f] < 0).length;
    const skipped = planes().reduce((n, p) => n + skippedOf(p), 0);
    await Promise.race([meshShown, timeS(1)]);
    load.emit('deadline', { limit: limitS, actual: load.elapsedS(), skipped });
  }
  /** Harmonic Time Compensation: group by group, so that the last one comes at the limit. */
  async function fetchInTime(fragments: FragmentList, timeLimitS: number): Promise<void> {
    const bytesEach = wholeRungs() ? Infinity : groupBytes(load.beta0, client.latencyS, timeLimitS);
    const list = groupedList(fragments, bytesEach, load.beta0 * timeLimitS);
    plan = new UncheckedPlan(list.offers, planOptions(timeLimitS));
    const decided = (s: HtcStep): void => {
      const group = list.groups[s.offer];
      if (s.doneS < 0) for (const f of group) fates.set(keyOf(f, s.rung), 'comes');
      load.emit('decision', {
        position: s.position,
        ...group[0],
        fragments: group.map((f) => f.fragment),
        eta: list.offers[s.offer].eta,
        rung: s.rung,
        bytes: s.bytes,
        plannedSeconds: s.thetaS,
        ...(s.doneS >= 0 && s.rung >= 0 && { actualSeconds: s.spacingS, done: s.doneS }),
        creditSeconds: s.creditS,
        bytesPerSecond: s.throughputBytesS,
        issued: s.issuedS,
        skipped: s.rung < 0,
      });
    };
    await timedFetch(plan, list, transfers, signal, timeLimitS + mostLate * limitS, { decided, lost });
    if (!wholeRungs()) await spendRest(fragments);
  }
  /** What a plan leaves of the time, because rungs do not fit it to the byte, goes into upgrades: ever smaller requests. */
  async function spendRest(list: FragmentList): Promise<void> {
    for (;;) {
      const restS = leftS() - composeS;
      const afterS = restS - client.rttS; // nothing else is on its way
      if (afterS < leastRest * limitS) return;
      // More requests at once would wait for connections.
      const wishes = upgrades(list, certain * plan!.throughputBytesS() * afterS).slice(0, 2 * client.options.connections);
      const late = AbortSignal.timeout(Math.ceil(1000 * (restS + mostLate * limitS)));
      if (wishes.length === 0 || (await fetchWishes(wishes, AbortSignal.any?.([late, signal]) ?? late)) === 0) return;
    }
  }

  return {
    planes,
    pending,
    throughputBytesS: (): number | undefined => plan?.throughputBytesS(),
    adopt: (): void => set.adopt(),
    readPlane: (base: number): Uint8Array | undefined => set.planes.get(base)?.read(),
    timedPart,
    scaleFor,
    /** Fetches what the camera sees and the display can show, until there is nothing left or somebody asks for another turn. */
    async refine(again: () => boolean): Promise<void> {
      fates.forEach((fate, key) => fate === 'lost' && fates.delete(key)); // what could not be had for a while
      await finerPlanes();
      while (!again() && (await refineSome()));
      if (!again()) await composed();
    },
    /** The GPU has lost everything: previews, then the fragments that there were. */
    async restore(): Promise<void> {
      const before = planes();
      set.dispose();
      set = newSet();
      await (await showPlanes(before, true)).shown;
      const had = before.flatMap(({ plane, rungs }) => [...rungs].map((rung, fragment) => ({ plane, fragment, rung, offer: 0 })));
      await fetchWishes(had.filter((w) => w.rung >= 0));
      await composed();
    },
    dispose(): void {
      set.dispose();
      transfers.dispose();
    },
  };
}
