import { FragmentOffer, HarmonicTimePlan, HtcStep, TimePlanOptions, bytesAtRung } from './harmonic_time';
import { LinkOptions, linkModel } from './network_model';
import { sumOf } from './numbers';

// delivery/cpp/simulate/simulation.h for one server on a link of constant rate: the same arithmetic, the same bits.

/** The course of a plan over a link. */
export interface Simulated {
  /** Rungs by offer; -1 = skipped. */
  rungs: number[];
  bytes: number;
  /** Sum of the offers' losses as shown. */
  loss: number;
  /** End, seconds after the first request. */
  endS: number;
}
/** Plays a plan over a link. A limit <= 0 leaves no time: nothing is transferred. */
export function simulate(offers: readonly FragmentOffer[], options: TimePlanOptions, link: LinkOptions): Simulated {
  const rungs = offers.map(() => -1);
  let endS = 0;
  if (options.timeLimitS > 0) {
    const plan = new HarmonicTimePlan(offers, options);
    const model = linkModel<HtcStep>(link);
    for (;;) {
      for (let s = plan.next(model.nowS); s; s = plan.next(model.nowS)) model.request(s, s.bytes);
      const step = model.advance();
      if (!step) break;
      endS = model.nowS;
      plan.ended(step, endS, true);
    }
    for (const s of plan.steps) rungs[s.offer] = s.rung;
  }
  const bytes = sumOf(offers.map((f, i) => bytesAtRung(f, rungs[i])));
  return { rungs, bytes, endS, loss: sumOf(offers.map((f, i) => f.loss[rungs[i] + 1])) };
}
