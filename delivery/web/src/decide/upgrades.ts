import type { FragmentOffer } from './harmonic_time';

/** An upgrade of a fragment to a higher rung, which may be fetched after the deadline. */
export interface Upgrade {
  offer: number;
  rung: number;
  bytes: number;
  gainPerByte: number;
}

/** Rungs that are not to be had. */
export type RefusedRung = (offer: number, rung: number) => boolean;

/**
 * Upgrades of fragments in order of loss saved per byte (ties: offer), each from the rung before to the one that saves most. `rungs` by
 * offer, -1 = skipped. With `incremental` rungs only the missing bytes count.
 */
export function upgradesInOrder(
  offers: readonly FragmentOffer[],
  rungs: readonly number[],
  incremental = false,
  refused?: RefusedRung,
): Upgrade[] {
  const all: [worth: number, upgrade: Upgrade][] = [];
  offers.forEach(({ bytes: sizes, loss }, offer) => {
    // No upgrade of a fragment comes before that to the rung that it starts from, whatever rounding says of their worth.
    for (let [rung, worth] = [rungs[offer], Infinity]; ; ) {
      let best: Upgrade | undefined;
      let bytes = 0;
      for (let r = rung + 1; r < sizes.length; ++r) {
        bytes = sizes[r] + (incremental ? bytes : 0);
        const gainPerByte = (loss[rung + 1] - loss[r + 1]) / bytes;
        if (gainPerByte > (best?.gainPerByte ?? 0) && !refused?.(offer, r)) best = { offer, rung: r, bytes, gainPerByte };
      }
      if (!best) return;
      worth = Math.min(worth, best.gainPerByte);
      all.push([worth, best]);
      rung = best.rung;
    }
  });
  return all.sort((a, b) => b[0] - a[0]).map(([, upgrade]) => upgrade); // stable: by offer, then by rung
}
