import { sumOf } from './numbers';
import type { FragmentOffer } from './plan_types';

/** The lowest rung worth asking for: one that shows more than the preview does. */
export function lowestShown(f: FragmentOffer, limits: boolean): number {
  const low = limits ? Math.min(f.lowRung, f.bytes.length - 1) : 0;
  for (let r = low; r < f.bytes.length && !(r > f.highRung); ++r) if (f.loss[r + 1] < f.loss[0]) return r;
  return low;
}

/** Cost of a fragment of so many bytes and so much loss. */
export type Cost = (bytes: number, loss: number) => number;

/** Cost where bytes have a price in units of loss. */
export const costAt = (price: number): Cost => (bytes, loss) => loss + price * bytes;

/** The rung from `low` on that costs least (ties: the first), among rungs of at most `mostBytes`; -1: skipping costs least. */
export function cheapestRung({ bytes, loss, highRung }: FragmentOffer, low: number, skip: boolean, mostBytes: number, cost: Cost): number {
  let best = skip ? -1 : low;
  let least = skip ? cost(0, loss[0]) : cost(bytes[low], loss[low + 1]);
  for (let r = low; r < bytes.length && !(r > highRung); ++r) {
    const now = bytes[r] <= mostBytes ? cost(bytes[r], loss[r + 1]) : Infinity;
    if (now >= least) continue;
    least = now;
    best = r;
  }
  return best;
}

/** Bytes at a rung; 0 where the fragment is skipped. */
export const bytesAtRung = (f: FragmentOffer, rung: number): number => (rung < 0 ? 0 : f.bytes[rung]);

/** The fragment with eta nearest the mean, or nearest 0 where etas count from Gamma (ties: the first). */
export function meanOffer(offers: readonly FragmentOffer[], fromGamma: boolean): number {
  const mean = fromGamma ? 0 : sumOf(offers.map((f) => f.eta)) / offers.length;
  const away = (i: number): number => Math.abs(offers[i].eta - mean);
  return offers.reduce((best, _, i) => (away(i) < away(best) ? i : best), 0);
}
