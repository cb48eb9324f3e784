import type { Mesh, Object3D } from 'three';
import { type FragmentList, type ListOptions, fragmentList } from '../decide/fragment_list';
import { spendBytes } from '../decide/rate_distortion';
import { isAbort, throwIfAborted } from '../format/errors';
import type { PackageData } from '../format/tables';
import { nextTurn, sleepS } from '../http/requests';
import type { Levels } from '../worker/protocol';
import { FragmentFates } from './fragment_fates';
import type { LoadContext } from './load_context';
import type { ShownPlanes } from './shown_planes';
import { Transfers, type Wish } from './transfers';
import { type LookedSurface, seenShares } from './visible_fragments';

/** Fragments that are there, and fragments on their way. */
export interface HeldFragments {
  planes: ShownPlanes;
  fates: FragmentFates;
}

/** Upgrades that save most for these bytes. Fragments under way count as if they had come. */
export function upgradeWishes({ offers, fragments }: FragmentList, mostBytes: number,
    { planes, fates }: HeldFragments): Wish[] {
  const curves = offers.map(({ bytes, loss }, offer) => {
    const f = fragments[offer];
    let from = bytes.length - 1;
    while (from > planes.rungOf(f) && !fates.isComing(f, from)) --from;
    const may = (rung: number): boolean => rung > from && !fates.isRefused(f, rung);
    return { bytes: [0, ...bytes.map((b, rung) => (may(rung) ? b : Infinity))],
      loss: [loss[from + 1], ...loss.slice(1)] };
  });
  const ways = spendBytes(curves, mostBytes);
  return fragments.map((f, offer): Wish => ({ ...f, offer, rung: ways[offer] - 1 }))
    .filter((w) => w.rung >= 0);
}

/** Every fragment at this rung (left out: the highest), or at the next rung below that can be had. */
export function allWishes({ offers, fragments }: FragmentList, only: number | undefined,
    { planes, fates }: HeldFragments): Wish[] {
  const wishes = fragments.map((f, offer): Wish => {
    let rung = Math.min(only ?? Infinity, offers[offer].bytes.length - 1);
    while (fates.isRefused(f, rung)) --rung;
    return { ...f, rung, offer, replaces: only !== undefined };
  });
  return wishes.filter((w) => w.rung >= 0 &&
    (w.replaces ? planes.rungOf(w) !== w.rung : planes.rungOf(w) < w.rung));
}

/** Upgrades that save most for these bytes, until 1 - SSIM is at most `enoughDssim`. Cuts the offers. */
export function bestWishes(list: FragmentList, mostBytes: number, enoughDssim: number,
    { tables }: PackageData, held: HeldFragments): Wish[] {
  list.offers.forEach((o, i) => {
    const { plane, fragment } = list.fragments[i];
    const { rungQuality, dssim, columns, rows } = tables[plane]!;
    const good = (r: number): boolean => dssim[r * columns * rows + fragment] <= enoughDssim;
    const enough = [...rungQuality.keys()].findIndex(good) + 1 || rungQuality.length;
    o.bytes = o.bytes.slice(0, enough);
  });
  const wishes = upgradeWishes(list, mostBytes, held);
  return wishes.length > 0 ? wishes : upgradeWishes(list, Infinity, held).slice(0, 1);
}

/** Bytes of a request. */
export const requestBytes = 256 << 10;
const gapBytes = 1024;

/** The fragments of a load: which may be fetched, fetching them, and what became of them. */
export class FragmentFetch {
  readonly fates = new FragmentFates();
  readonly transfers: Transfers;
  /** How fragments are listed besides scale and display. */
  listOptions: Partial<ListOptions> = {};

  constructor(private readonly load_: LoadContext, readonly planes: ShownPlanes) {
    this.transfers = new Transfers(load_.reader, planes.textures, load_.pool, {
      decoded: (wish, levels) => void this.show_(wish, levels),
      lost: (wish, error) => this.lost(wish, error),
      blocks: (wish) => planes.blocksOf(wish),
    });
  }

  /** Fragments whose transfer, decoding or upload is under way. */
  pending(): number {
    return this.transfers.pending + this.planes.pending;
  }
  /** Waits until all fragments that have come, but so many, are in their textures. */
  async composed(but = 0): Promise<void> {
    for (; this.pending() > but; await sleepS(0.004)) throwIfAborted(this.load_.signal);
    if (but > 0) return;
    this.planes.finishMips();
    // of blocks a worker makes them
    for (; this.pending() > 0; await sleepS(0.004)) throwIfAborted(this.load_.signal);
  }
  /** Whether rungs come as a whole: from a tree without files of fragments. */
  wholeRungs(): boolean {
    const [first] = this.planes.all();
    return this.load_.reader.form === 'files' && !!first && !this.transfers.filesOf(first.plane).complete;
  }

  /**
   * The list of the fragments of the planes shown, with the bytes that fetching takes. A fragment's losses
   * count by the share that the camera sees of `surface`, which is in the object or would be, and by `unseen`
   * at least; with a gaze, by the acuity of the eye, too.
   */
  async listOf(scale: number, unseen: number, surface: Object3D): Promise<FragmentList> {
    const { planes, transfers, load_: { view, options } } = this;
    const seen = new Map<number, Float32Array | undefined>();
    const looked = new Map<number, Float32Array>();
    const gaze = view.camera && options.gaze?.();
    const gazeWeights = gaze && (await import('./gaze_weights')).gazeWeights;
    for (const { plane } of planes.all()) {
      await nextTurn(); // the page goes on in between
      seen.set(plane, this.shares_(plane, surface));
      if (gazeWeights) looked.set(plane, gazeWeights(planes.textures[plane], this.lookedAt_(plane, surface),
        view.camera!, options.renderer, gaze));
    }
    const list = fragmentList(planes.data, planes.all(),
      { scale, displayedPx: view.display.heightPx, ...this.listOptions });
    list.offers.forEach((offer, i) => {
      const { plane, fragment } = list.fragments[i];
      offer.bytes = offer.bytes.map((b, r) => transfers.bytesOf(plane, r, fragment) || b);
      const attention = looked.get(plane)?.[fragment] ?? 1;
      const weight = attention * Math.max(unseen, seen.get(plane)?.[fragment] ?? 1);
      offer.loss = offer.loss.map((l) => l * weight);
      offer.eta *= weight;
    });
    return list;
  }
  /** Share of each fragment that the camera sees; undefined without a camera. */
  private shares_(plane: number, surface: Object3D): Float32Array | undefined {
    const { camera } = this.load_.view;
    return camera && seenShares(this.planes.textures[plane], this.lookedAt_(plane, surface), camera);
  }
  /** `surface` is in the object, or would be. */
  private lookedAt_(plane: number, surface: Object3D): LookedSurface {
    const { object } = this.load_;
    return { object: surface, shows: this.showsOf_(plane),
      within: surface === object || surface.parent ? undefined : object };
  }
  /** Whether a mesh has the plane's image. */
  private showsOf_(plane: number): (mesh: Mesh) => boolean {
    const slots = this.load_.materials.slots.filter((s) => s.image === this.planes.textures[plane].image);
    return (mesh) => [mesh.material].flat().some((m) => slots.some((s) => s.material === m));
  }

  /** Fetches fragments; gives the number that have come. */
  async fetch(wishes: readonly Wish[], until = this.load_.signal): Promise<number> {
    for (const w of wishes) this.fates.asked(w, w.rung);
    let arrived = 0;
    const lost = (wish: Wish, error: unknown): void => this.lost(wish, error);
    await this.transfers.fetch(wishes, { gapBytes, mostBytes: requestBytes, signal: until }, () => ++arrived,
      lost);
    throwIfAborted(this.load_.signal);
    return arrived;
  }
  lost(wish: Wish, error: unknown): void {
    this.fates.ended(wish, wish.rung);
    if (isAbort(error) || this.load_.pool.isUnavailable) return;
    this.fates.failed(wish, wish.rung, error);
    this.load_.fail(error, `fragment ${wish.fragment} of plane ${wish.plane} at rung ${wish.rung}`);
  }
  private async show_(wish: Wish, levels: Levels): Promise<void> {
    const { plane, fragment, rung, replaces } = wish;
    const load = this.load_;
    const to = this.planes.showing(wish);
    const better = (there: number): boolean =>
      rung > there || (!!replaces && load.override.rung !== undefined);
    const shown = to && !load.signal.aborted &&
      (await this.planes.upload(to, levels, fragment, rung, better));
    levels.forEach((b) => b.close?.());
    this.fates.ended(wish, rung);
    if (shown) load.emit('fragment', { plane, fragment, rung });
  }
  dispose(): void {
    this.planes.dispose();
    this.transfers.dispose();
  }
}
