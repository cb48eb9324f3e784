import { clamp, sumOf } from './numbers';
import { exp, log } from './portable_math';
import { TransferRate, transferRate } from '../http/throughput';

// Harmonic Time Compensation (thesis ch. 4 and Appendix A, as corrected): a list of fragments is transferred so that
// the whole ends at the time limit T_0, though throughput moves. The same decisions, bit for bit, as
// delivery/cpp/harmonic_time: it does no I/O and knows no clock. What is offered to others is HarmonicTimePlan.

/** One fragment as the plan sees it. */
export interface FragmentOffer {
  /** By rung, lowest first; at least one, all > 0. */
  bytes: number[];
  /** [rungs + 1] what is lost when it is skipped, then by rung; any unit, >= 0. */
  loss: number[];
  /** Feature density times weights; orders the list. */
  eta: number;
  /** d_g > 0: what it gets by Eq. 3.2. */
  plannedBytes: number;
  /** Limits of quality, see HtcOptions.hardLimits. */
  lowRung: number;
  highRung: number;
}

/**
 * How rungs are chosen. htc: the method. guard: the method over the plan of least loss instead of Eq. 3.2's, with
 * sizes kept within a factor of that plan's share of what the link gives in the time left. price: one price of bytes in
 * units of loss that rises when the plan is late. proportional: sizes scaled by what is left of time over what is left
 * to send. static: the planned sizes, whatever happens.
 */
export type Policy = 'htc' | 'guard' | 'price' | 'proportional' | 'static';
/** Which end of the list is next: by the sign of the next credit, by the last throughput against beta_0, or the finest. */
export type HtcOrder = 'credit' | 'beta0' | 'finest';

/** A decision and what became of it. */
export interface HtcStep {
  /** k = 1 .. n in the order of decisions. */
  position: number;
  offer: number;
  /** -1 = skipped */
  rung: number;
  bytes: number;
  /** credit_k and theta_k = theta_g + credit_k. */
  creditS: number;
  thetaS: number;
  /** d_k asked for. */
  targetBytes: number;
  /** beta_{k-1} it was asked with. */
  throughputBytesS: number;
  issuedS: number;
  /** -1: in flight */
  doneS: number;
  /** gamma_k: since the completion before. */
  spacingS: number;
  /** dT_k = theta_k - gamma_k */
  residualS: number;
}

/** What a plan is made for; from `guard` on what only studies choose otherwise, see HtcOptions. */
export interface TimePlanOptions {
  policy: Policy;
  order: HtcOrder;
  timeLimitS: number;
  initialBytesS: number;
  rttS: number;
  guard?: number;
  priceKappa?: number;
  /** Requests in flight: so many always, as many as the link needs, and never more. */
  leastInFlight?: number;
  mostInFlight?: number;
  /** At the start, in which nothing can arrive; and of every transfer by itself. */
  latencyS?: number;
  waitS?: number;
  lowestRung?: (f: FragmentOffer, limits: boolean) => number;
  skips?: boolean;
  rate?: TransferRate;
  estimate?: () => number;
}

/** Decides fragment by fragment what to ask for. */
export interface TimePlan {
  /** Decisions so far, skipped fragments included. */
  readonly steps: readonly HtcStep[];
  /**
   * The next request, while the window has room; skipped fragments are decided on the way. undefined: nothing more to
   * issue now (wait for a completion) or at all. `nowS` >= 0 counts from the first request.
   */
  next(nowS: number): HtcStep | undefined;
  /**
   * A request has ended, in any order; times must not fall. Not `well`: it was given up, its time is spent, its fragment counts as
   * skipped.
   */
  ended(step: HtcStep, nowS: number, well: boolean): void;
  /** All decided, and nothing in flight. */
  finished(): boolean;
  /** As it is estimated now. */
  throughputBytesS(): number;
}

const windowFactor = 1.5;
const tripSamples = 64; // a window that follows every swing makes them worse
const guardSamples = 20;
const breakFactor = 4; // a link this many times faster or slower is another link
const largestExponent = 12;
const elasticity = 2.5; // of the price by bytes, on ladders of photographs
const spareExponent = 1;
const lateFactor = 1.2;

/** The lowest rung worth asking for: one that shows more than the preview does. */
function lowestShown(f: FragmentOffer, limits: boolean): number {
  const low = limits ? Math.min(f.lowRung, f.bytes.length - 1) : 0;
  for (let r = low; r < f.bytes.length && !(r > f.highRung); ++r) if (f.loss[r + 1] < f.loss[0]) return r;
  return low;
}

/** What showing a fragment costs, and what it then loses. */
type Cost = (bytes: number, loss: number) => number;

/** The rung from `low` on that costs least (ties: the first), of those that have so few bytes; -1: skipping does. */
function cheapestRung({ bytes, loss, highRung }: FragmentOffer, low: number, skip: boolean, mostBytes: number, cost: Cost): number {
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

/** 0 where it is skipped. */
export const bytesAtRung = (f: FragmentOffer, rung: number): number => (rung < 0 ? 0 : f.bytes[rung]);

/** The fragment with eta nearest the mean (ties: the first). */
function meanOffer(offers: readonly FragmentOffer[]): number {
  const mean = sumOf(offers.map((f) => f.eta)) / offers.length;
  const away = (i: number): number => Math.abs(offers[i].eta - mean);
  return offers.reduce((best, _, i) => (away(i) < away(best) ? i : best), 0);
}

/** Bytes of a kind: of each offer, of all, and of those that are not issued yet. */
interface Counted {
  each: number[];
  total: number;
  left: number;
}
function counted(each: number[]): Counted {
  const total = sumOf(each);
  return { each, total, left: total };
}

/** The list is taken by falling eta (ties: index). Nothing is checked. */
export function timePlan(offers: readonly FragmentOffer[], options: TimePlanOptions): TimePlan {
  const {
    policy, order, timeLimitS: limitS, initialBytesS, rttS, guard = 1.5, priceKappa = 10, leastInFlight = 2, mostInFlight = 64,
    // Counted as a delay it would starve the fragments that come next.
    latencyS = Math.min(rttS, limitS / 2), waitS = 0, lowestRung = lowestShown, skips = true,
    rate = transferRate(initialBytesS),
    // With several requests in flight completions come in bunches: only sums over some of them say anything.
    estimate = () => rate.recentBytesS(),
  } = options;
  const byPrice = policy === 'price';
  const byGuard = policy === 'guard';
  const steps: HtcStep[] = [];
  const waiting: HtcStep[] = []; // in flight, as they were issued
  const remaining = [...offers.keys()].sort((a, b) => offers[b].eta - offers[a].eta);
  const credits: { value: number; issued: number }[] = [];
  const harmonic = [0];
  for (let i = 1; i < offers.length + 2; ++i) harmonic.push(harmonic[i - 1] + 1 / i);
  let [nowS, lastDoneS] = [0, 0];

  const [lowest, lowestLimited] = [false, true].map((limits) => offers.map((f) => lowestRung(f, limits)));
  const smallest = counted(offers.map((f, i) => f.bytes[lowest[i]]));
  const limited = counted(offers.map((f, i) => f.bytes[lowestLimited[i]]));

  const budget = limitS * initialBytesS;
  const costAt = (price: number): Cost => (bytes, loss) => loss + price * bytes;
  const bytesAt = (price: number): number[] => {
    const cost = costAt(price);
    return offers.map((f, i) => bytesAtRung(f, cheapestRung(f, lowest[i], true, budget, cost)));
  };
  // The price at which the plan for beta_0 spends T_0 x beta_0: bisection on its logarithm.
  let [low, high] = [-60, 60];
  for (let i = 0; i < 60 && (byPrice || byGuard); ++i) {
    const middle = (low + high) / 2;
    if (sumOf(bytesAt(exp(middle))) > budget) low = middle;
    else high = middle;
  }
  const price = exp(high);
  const priced = counted(bytesAt(price));
  // d_g by the policy's plan
  const planned = counted(offers.map((f, i) => (byGuard ? Math.max(priced.each[i], smallest.each[i]) : f.plannedBytes)));

  const inFlightBytes = (): number => sumOf(waiting.map((s) => s.bytes));
  /**
   * Bytes that can still arrive in time besides those in flight. What is asked for now arrives a round trip later, whether
   * or not enough is in flight until then.
   */
  const room = (beta = rate.recentBytesS(), leftS = limitS - nowS): number =>
    Math.max(0, Math.min(beta * leftS - inFlightBytes(), beta * (leftS - latencyS)));

  const windowOpen = (): boolean => {
    const n = waiting.length;
    if (n < leastInFlight || n >= mostInFlight) return n < leastInFlight;
    // What is in flight takes all the time that is left: what is asked for now could only be late.
    if (limitS - nowS > latencyS && room() <= 0) return false;
    // Counted in fragments of the planned size: counted in bytes, many small ones would be in flight when there is little
    // time, and those are received side by side and late.
    const fragmentBytes = planned.total / offers.length;
    return n < leastInFlight + (windowFactor * (rate.recentBytesS(tripSamples) * rttS)) / fragmentBytes;
  };

  const chosenOffer = (creditS: number): number => {
    if (steps.length === 0 && !byPrice) return meanOffer(offers);
    const finest = byPrice || order === 'finest' || (order === 'credit' ? creditS <= 0 : estimate() <= initialBytesS);
    return remaining.at(finest ? 0 : -1)!;
  };

  /**
   * What the link will give in the time left: its mean over as long a time until now, so that bursts shorter than that do
   * not count; but a link that stalls, falls or comes back by more than breakFactor does not return to its mean.
   */
  const lastingBytesS = (): number => {
    const recent = rate.recentBytesS(guardSamples);
    const mean = nowS < limitS ? rate.meanBytesS(limitS - nowS) : recent;
    return recent * breakFactor > mean && recent < breakFactor * mean ? mean : recent;
  };

  const targetOf = (offer: number, thetaS: number): number => {
    const bytes = planned.each[offer];
    const inProportion = (beta: number): number => bytes * (room(beta) / Math.max(planned.left, 1));
    if (policy === 'proportional') return inProportion(estimate());
    if (policy === 'static' || byPrice || steps.length === 0) return bytes; // F-bar has the quality Q_i
    const target = estimate() * (thetaS - waitS);
    if (policy === 'htc') return target;
    const even = inProportion(lastingBytesS());
    return clamp(target, even / guard, even * guard);
  };

  const priceNow = (): number => {
    const plannedS = priced.total > 0 ? limitS * ((priced.total - priced.left) / priced.total) : 0;
    // What is in flight has been issued but not paid for yet.
    const lag = nowS - (plannedS - inFlightBytes() / estimate());
    const leftS = Math.max(limitS - nowS, 1e-3 * limitS);
    // A lag alone asks for too much after a stall: no higher price than what is left can be sent at.
    const ratio = priced.left / Math.max(room(undefined, limitS - (limitS - leftS)), 1);
    const enough = spareExponent + elasticity * log(Math.max(ratio, 1));
    return price * exp(clamp((priceKappa * lag) / leftS, -largestExponent, Math.min(enough, largestExponent)));
  };

  const rungOf = (offer: number, target: number): number => {
    const f = offers[offer];
    const bytes = room();
    // A stall that is over looks like a slow link until something has been transferred: what is skipped on such evidence is
    // lost for good, so never two in a row; but of what could not arrive in time all.
    const careless = policy === 'htc' || policy === 'static' || smallest.left > bytes;
    const skip = skips && (limitS - nowS <= latencyS || (careless && steps.at(-1)?.bytes !== 0));
    if (byPrice) return cheapestRung(f, lowest[offer], skip, lateFactor * bytes, costAt(priceNow()));
    const limits = limited.left <= bytes;
    return cheapestRung(f, (limits ? lowestLimited : lowest)[offer], skip && !limits, Infinity, (b) => Math.abs(target - b));
  };

  // dT is spread over what is to come, the share 1 / (chi zeta) for each, chi = 2 for the position after the last issued one.
  const spread = (residualS: number): void => {
    const left = remaining.length;
    if (left > 0) credits.push({ value: residualS / (harmonic[left + 1] - 1), issued: steps.length }); // 1/2 + ... + 1/(left + 1)
  };

  return {
    steps,
    next(atS) {
      nowS = atS;
      while (remaining.length > 0 && windowOpen()) {
        const creditS = credits.reduce((sum, c) => sum + c.value / (steps.length - c.issued + 2), 0);
        const offer = chosenOffer(creditS);
        const thetaS = (limitS - latencyS) * (planned.each[offer] / planned.total) + creditS;
        const throughputBytesS = estimate();
        const targetBytes = targetOf(offer, thetaS);
        const rung = rungOf(offer, targetBytes);
        const step: HtcStep = {
          position: steps.length + 1, offer, rung, bytes: bytesAtRung(offers[offer], rung), creditS, thetaS, targetBytes, throughputBytesS,
          issuedS: nowS, doneS: -1, spacingS: 0, residualS: 0,
        };
        remaining.splice(remaining.indexOf(offer), 1);
        for (const c of [smallest, limited, priced, planned]) c.left -= c.each[offer];
        steps.push(step);
        if (rung >= 0) {
          waiting.push(step);
          return step;
        }
        // No transfer: it takes no time and says nothing of the link.
        step.doneS = nowS;
        spread((step.residualS = thetaS));
      }
      return undefined;
    },
    ended(step, atS, well) {
      step.doneS = atS;
      step.spacingS = Math.max(0, atS - Math.max(lastDoneS, latencyS));
      // The link was idle only while nothing that was asked for could have been on its way.
      if (well) rate.add(step.bytes, atS - Math.max(lastDoneS, waiting[0].issuedS + rttS));
      else step.rung = -1;
      waiting.splice(waiting.indexOf(step), 1);
      lastDoneS = atS;
      spread((step.residualS = step.thetaS - step.spacingS));
    },
    finished: () => remaining.length + waiting.length === 0,
    throughputBytesS: estimate,
  };
}
