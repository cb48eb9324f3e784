import type { FragmentOffer } from './harmonic_time';

/** What may be fetched after the deadline: an upgrade of a fragment to a higher rung. */
export interface Upgrade {
  offer: number;
  rung: number;
  bytes: number;
  gainPerByte: number;
}

/** Rungs that are not to be had. */
export type RefusedRung = (offer: number, rung: number) => boolean;

/** The upgrade that saves most loss per byte, from this rung on; gain 0 when none saves any. */
function bestUpgrade(f: FragmentOffer, offer: number, rung: number, incremental: boolean, refused?: RefusedRung): Upgrade {
  let best: Upgrade = { offer, rung, bytes: 0, gainPerByte: 0 };
  let bytes = 0;
  for (let r = rung + 1; r < f.bytes.length; ++r) {
    bytes = incremental ? bytes + f.bytes[r] : f.bytes[r];
    if (refused?.(offer, r)) continue;
    const gainPerByte = (f.loss[rung + 1] - f.loss[r + 1]) / bytes;
    if (gainPerByte > best.gainPerByte) best = { offer, rung: r, bytes, gainPerByte };
  }
  return best;
}

const before = (a: Upgrade, b: Upgrade): boolean =>
  a.gainPerByte !== b.gainPerByte ? a.gainPerByte > b.gainPerByte : a.offer < b.offer;

/** A binary heap; no two of its elements are equal in order, so that what comes out is determined. */
class Heap {
  private readonly items_: Upgrade[] = [];
  get size(): number {
    return this.items_.length;
  }
  push(item: Upgrade): void {
    let at = this.items_.push(item) - 1;
    while (at > 0) {
      const parent = (at - 1) >> 1;
      if (!before(item, this.items_[parent])) break;
      this.items_[at] = this.items_[parent];
      at = parent;
    }
    this.items_[at] = item;
  }
  pop(): Upgrade {
    const top = this.items_[0];
    const last = this.items_.pop()!;
    const n = this.items_.length;
    if (n === 0) return top;
    let at = 0;
    for (let child = 1; child < n; child = 2 * at + 1) {
      if (child + 1 < n && before(this.items_[child + 1], this.items_[child])) ++child;
      if (!before(this.items_[child], last)) break;
      this.items_[at] = this.items_[child];
      at = child;
    }
    this.items_[at] = last;
    return top;
  }
}

/**
 * Upgrades of fragments in order of loss saved per byte, each from the rung before. `rungs` by offer, -1 = skipped.
 * With `incremental` rungs only the missing bytes count.
 */
export function upgradesInOrder(
  offers: readonly FragmentOffer[],
  rungs: readonly number[],
  incremental = false,
  refused?: RefusedRung,
): Upgrade[] {
  const heap = new Heap();
  const push = (offer: number, rung: number): void => {
    const u = bestUpgrade(offers[offer], offer, rung, incremental, refused);
    if (u.gainPerByte > 0) heap.push(u);
  };
  offers.forEach((_, i) => push(i, rungs[i]));
  const order: Upgrade[] = [];
  while (heap.size > 0) {
    const u = heap.pop();
    order.push(u);
    push(u.offer, u.rung);
  }
  return order;
}
