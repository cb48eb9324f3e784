import type { FragmentList } from '../decide/fragment_list';
import { spendBytes } from '../decide/rate_distortion';
import type { PackageData } from '../format/package_data';
import type { FragmentFates } from './fragment_fates';
import type { ShownPlanes } from './shown_planes';
import type { Wish } from './transfers';

/** Fragments that are there, and fragments on their way. */
export interface HeldFragments {
  planes: ShownPlanes;
  fates: FragmentFates;
}

/** Upgrades that save most for these bytes, by plane and importance. Fragments under way count as if they had come. */
export function upgradeWishes({ offers, fragments }: FragmentList, mostBytes: number, { planes, fates }: HeldFragments): Wish[] {
  const curves = offers.map(({ bytes, loss }, offer) => {
    const f = fragments[offer];
    let from = bytes.length - 1;
    while (from > planes.rungOf(f) && !fates.isComing(f, from)) --from;
    const may = (rung: number): boolean => rung > from && !fates.isRefused(f, rung);
    return { bytes: [0, ...bytes.map((b, rung) => (may(rung) ? b : Infinity))], loss: [loss[from + 1], ...loss.slice(1)] };
  });
  const ways = spendBytes(curves, mostBytes);
  return fragments.map((f, offer): Wish => ({ ...f, offer, rung: ways[offer] - 1 })).filter((w) => w.rung >= 0);
}

/** Every fragment at this rung (left out: the highest), or at the next rung below that can be had. */
export function allWishes({ offers, fragments }: FragmentList, only: number | undefined, { planes, fates }: HeldFragments): Wish[] {
  const wishes = fragments.map((f, offer): Wish => {
    let rung = Math.min(only ?? Infinity, offers[offer].bytes.length - 1);
    while (fates.isRefused(f, rung)) --rung;
    return { ...f, rung, offer, replaces: only !== undefined };
  });
  return wishes.filter((w) => w.rung >= 0 && (w.replaces ? planes.rungOf(w) !== w.rung : planes.rungOf(w) < w.rung));
}

/** Upgrades that save most for these bytes, to where a fragment's 1 - SSIM is no more than `enoughDssim`. The list's offers are cut off there. */
export function bestWishes(list: FragmentList, mostBytes: number, enoughDssim: number, { tables }: PackageData, held: HeldFragments): Wish[] {
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
