import { sumOf } from './numbers';
import type { FragmentOffer } from './plan_types';
import { exp } from './portable_math';
import { bytesAtRung, cheapestRung, costAt } from './rung_choice';

/** Bytes of one kind: of each offer, of all, and of those that are not issued yet. */
export class PlannedBytes {
  readonly total: number;
  left: number;

  constructor(readonly each: readonly number[]) {
    this.total = this.left = sumOf(each);
  }
  /** An offer is issued. */
  issue(offer: number): void {
    this.left -= this.each[offer];
  }
}

/** Price of bytes in units of loss at which a budget is spent with the least loss, and the bytes of each offer then. */
export interface PricedBytes {
  price: number;
  bytes: PlannedBytes;
}

/** The price at which a plan of least loss spends the budget: bisection on the logarithm of the price. `lowest`: rungs by offer. */
export function pricedBytes(offers: readonly FragmentOffer[], lowest: readonly number[], budget: number): PricedBytes {
  const bytesAt = (price: number): number[] => {
    const cost = costAt(price);
    return offers.map((f, i) => bytesAtRung(f, cheapestRung(f, lowest[i], true, budget, cost)));
  };
  let [low, high] = [-60, 60];
  for (let i = 0; i < 60; ++i) {
    const middle = (low + high) / 2;
    if (sumOf(bytesAt(exp(middle))) > budget) low = middle;
    else high = middle;
  }
  const price = exp(high);
  return { price, bytes: new PlannedBytes(bytesAt(price)) };
}
