import { breakFactor, guardSamples, tripSamples, windowFactor } from '../format/shared_numbers';
import { type TransferRate, transferRate } from '../http/throughput';
import { clamp, sumOf } from './numbers';
import { exp } from './portable_math';

// Harmonic Time Compensation (thesis ch. 4 and Appendix A, as corrected): a list of fragments is transferred
// so that the whole ends at the time limit T_0, though throughput moves. Each fragment has its share of the
// time by the bytes that a plan made before the first request gives it. What one transfer takes less or more
// than its share is spread over the next ones with weights 1/2, 1/3, .. The same decisions, bit for bit, as
// delivery/cpp/decide/harmonic_time.h. It does no I/O, knows no clock, checks no argument.

/** One fragment as the plan sees it. */
export interface FragmentOffer {
  /** Bytes by rung, lowest first; at least one, all > 0. */
  bytes: number[];
  /** [rungs + 1] loss when the fragment is skipped, then by rung; any unit, >= 0. */
  loss: number[];
  /** Feature density times weights; orders the list. */
  eta: number;
  /** d_g > 0: bytes of the fragment by Eq. 3.2. */
  plannedBytes: number;
  /** Limits of quality: lowRung is kept while there is time enough for it, highRung always. */
  lowRung: number;
  highRung: number;
}

/**
 * How rungs are chosen. guard: the method over the plan of least loss, with sizes kept within a factor of
 * that plan's share of what the link gives in the time left. thesis: the method as printed over the plan of
 * Eq. 3.2, with times T_0 d_g / (T_0 beta_0). Its etas count from Gamma, so that the fragment with eta
 * nearest 0 comes first.
 */
export type Policy = 'guard' | 'thesis';
/** The next end of the list: the finest (guard), by throughput over beta_0 (as printed), or by credit. */
export type HtcOrder = 'finest' | 'beta0' | 'credit';

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
  /** beta_{k-1}: throughput that the decision supposes. */
  throughputBytesS: number;
  issuedS: number;
  /** -1: in flight */
  doneS: number;
  /** gamma_k: since the completion before. */
  spacingS: number;
  /** dT_k = theta_k - gamma_k */
  residualS: number;
}

/** Time and link of a plan: T_0, beta_0 and the round trip. */
export interface PlanLimits {
  timeLimitS: number;
  initialBytesS: number;
  rttS: number;
}
/** Options of a plan. Those that may be left out have the values of the policy guard. */
export interface TimePlanOptions extends PlanLimits {
  policy: Policy;
  order: HtcOrder;
  /** Least and most requests in flight; between them, as many as the link needs. */
  leastInFlight?: number;
  mostInFlight?: number;
  /** Time at the start in which nothing can arrive; and waiting time of every transfer by itself. */
  latencyS?: number;
  waitS?: number;
  lowestRung?: (f: FragmentOffer, limits: boolean) => number;
  skips?: boolean;
  /** Seconds from a request to its answer as they are now, for the requests in flight; left out: rttS. */
  tripS?: () => number;
  rate?: TransferRate;
  estimate?: () => number;
}

const guard = 1.5;

// ---- rungs of one fragment

/** The lowest rung worth asking for: one that shows more than the preview does. */
function lowestShown(f: FragmentOffer, limits: boolean): number {
  const low = limits ? Math.min(f.lowRung, f.bytes.length - 1) : 0;
  for (let r = low; r < f.bytes.length && !(r > f.highRung); ++r) if (f.loss[r + 1] < f.loss[0]) return r;
  return low;
}

/** The rung from `low` on, of at most `mostBytes`, with the least `cost`; -1: skipping costs least. */
function cheapestRung({ bytes, loss, highRung }: FragmentOffer, low: number, skip: boolean, mostBytes: number,
    cost: (bytes: number, loss: number) => number): number {
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

/** Bytes by offer in the plan of least loss, by bisection on the price of bytes. `lowest`: rungs. */
function bytesOfLeastLoss(offers: readonly FragmentOffer[], lowest: number[], budget: number): number[] {
  const bytesAt = (price: number): number[] => {
    const cost = (bytes: number, loss: number): number => loss + price * bytes;
    return offers.map((f, i) => bytesAtRung(f, cheapestRung(f, lowest[i], true, budget, cost)));
  };
  let [low, high] = [-60, 60];
  for (let i = 0; i < 60; ++i) {
    const middle = (low + high) / 2;
    if (sumOf(bytesAt(exp(middle))) > budget) low = middle;
    else high = middle;
  }
  return bytesAt(exp(high));
}

/** Bytes of one kind: of each offer, of all, and of those that are not issued yet. */
class PlannedBytes {
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

// ---- the plan

/** Options with those that were left out. */
function completed(options: TimePlanOptions): Required<TimePlanOptions> {
  const {
    timeLimitS, initialBytesS, rttS, leastInFlight = 2, mostInFlight = 64,
    // Counted as a delay, the round trip would starve the fragments that come next.
    latencyS = Math.min(rttS, timeLimitS / 2), waitS = 0, lowestRung = lowestShown, skips = true,
    rate = transferRate(initialBytesS),
    // With several requests in flight completions come in bunches: only sums over some of them say anything.
    estimate = () => rate.recentBytesS(), tripS = () => rttS,
  } = options;
  const chosen = { leastInFlight, mostInFlight, latencyS, waitS, lowestRung, skips, rate, estimate, tripS };
  return { ...options, ...chosen };
}

/**
 * Decides fragment by fragment what to ask for: call next() until it gives nothing, and ended() for every
 * request. The list is taken by falling eta (ties: index).
 */
export class HarmonicTimePlan {
  /** Decisions so far, skipped fragments included. */
  readonly steps: HtcStep[] = [];
  private readonly options_: Required<TimePlanOptions>;
  private readonly inFlight_: HtcStep[] = []; // as they were issued
  private readonly remaining_: number[]; // offers, by falling eta
  private readonly credits_: { value: number; issued: number }[] = [];
  private readonly harmonic_ = [0]; // H_0 .. H_{n+1}
  private readonly lowest_: number[]; // rungs by offer
  private readonly lowestLimited_: number[];
  private readonly smallest_: PlannedBytes; // of the lowest rungs
  private readonly limited_: PlannedBytes;
  private readonly planned_: PlannedBytes; // d_g by the policy's plan
  private nowS_ = 0;
  private lastDoneS_ = 0;

  constructor(private readonly offers_: readonly FragmentOffer[], options: TimePlanOptions) {
    this.options_ = completed(options);
    const { policy, timeLimitS, initialBytesS, lowestRung } = this.options_;
    this.remaining_ = [...offers_.keys()].sort((a, b) => offers_[b].eta - offers_[a].eta);
    for (let i = 1; i < offers_.length + 2; ++i) this.harmonic_.push(this.harmonic_[i - 1] + 1 / i);
    this.lowest_ = offers_.map((f) => lowestRung(f, false));
    this.lowestLimited_ = offers_.map((f) => lowestRung(f, true));
    this.smallest_ = new PlannedBytes(offers_.map((f, i) => f.bytes[this.lowest_[i]]));
    this.limited_ = new PlannedBytes(offers_.map((f, i) => f.bytes[this.lowestLimited_[i]]));
    const leastLoss =
      policy === 'guard' && bytesOfLeastLoss(offers_, this.lowest_, timeLimitS * initialBytesS);
    const plannedOf = (f: FragmentOffer, i: number): number =>
      leastLoss ? Math.max(leastLoss[i], this.smallest_.each[i]) : f.plannedBytes;
    this.planned_ = new PlannedBytes(offers_.map(plannedOf));
  }

  /** All decided, and nothing in flight. */
  finished(): boolean {
    return this.remaining_.length + this.inFlight_.length === 0;
  }
  /** Throughput as the plan estimates it now. */
  throughputBytesS(): number {
    return this.options_.estimate();
  }

  /**
   * The next request, while the window has room; skipped fragments are decided on the way. undefined: nothing
   * more to issue now (wait for a completion) or at all. `nowS` >= 0 counts from the first request.
   */
  next(nowS: number): HtcStep | undefined {
    this.nowS_ = nowS;
    while (this.remaining_.length > 0 && this.windowOpen_()) {
      const step = this.decideNext_();
      if (step.rung >= 0) {
        this.inFlight_.push(step);
        return step;
      }
      // A skipped fragment takes no time and says nothing about the link.
      step.doneS = nowS;
      this.spread_((step.residualS = step.thetaS));
    }
    return undefined;
  }
  /** A request has ended, in any order; times never fall. Not `well`: its fragment counts as skipped. */
  ended(step: HtcStep, nowS: number, well: boolean): void {
    const { latencyS, rttS, rate } = this.options_;
    step.doneS = nowS;
    step.spacingS = Math.max(0, nowS - Math.max(this.lastDoneS_, latencyS));
    // The link was idle only while no answer could have been on its way.
    const seconds = nowS - Math.max(this.lastDoneS_, this.inFlight_[0].issuedS + rttS);
    this.inFlight_.splice(this.inFlight_.indexOf(step), 1);
    if (well) rate.add(step.bytes, seconds, this.inFlight_.length, this.inFlightBytes_());
    else step.rung = -1;
    this.lastDoneS_ = nowS;
    this.spread_((step.residualS = step.thetaS - step.spacingS));
  }

  /** Decides about one more fragment. */
  private decideNext_(): HtcStep {
    const creditS = this.creditS_();
    const offer = this.chooseOffer_(creditS);
    const thetaS = this.thetaOf_(offer) + creditS;
    const throughputBytesS = this.throughputBytesS();
    const targetBytes = this.targetOf_(offer, thetaS);
    const rung = this.rungOf_(offer, targetBytes);
    const step: HtcStep = {
      position: this.steps.length + 1, offer, rung, bytes: bytesAtRung(this.offers_[offer], rung),
      creditS, thetaS, targetBytes, throughputBytesS,
      issuedS: this.nowS_, doneS: -1, spacingS: 0, residualS: 0,
    };
    this.remaining_.splice(this.remaining_.indexOf(offer), 1);
    for (const bytes of [this.smallest_, this.limited_, this.planned_]) bytes.issue(offer);
    this.steps.push(step);
    return step;
  }
  private chooseOffer_(creditS: number): number {
    const { policy, order, initialBytesS } = this.options_;
    if (this.steps.length === 0) return meanOffer(this.offers_, policy === 'thesis');
    const finest =
      order === 'finest' || (order === 'credit' ? creditS <= 0 : this.throughputBytesS() <= initialBytesS);
    return this.remaining_.at(finest ? 0 : -1)!;
  }

  // ---- time

  /** theta_g */
  private thetaOf_(offer: number): number {
    const { policy, timeLimitS, latencyS, initialBytesS } = this.options_;
    const all = policy === 'thesis' ? timeLimitS * initialBytesS : this.planned_.total;
    return (timeLimitS - latencyS) * (this.planned_.each[offer] / all);
  }
  /** Credit of the position after the last issued one, from the residuals so far. */
  private creditS_(): number {
    return this.credits_.reduce((sum, c) => sum + c.value / (this.steps.length - c.issued + 2), 0);
  }
  /** dT is spread: share 1 / (chi zeta) for each, chi = 2 for the position after the last issued one. */
  private spread_(residualS: number): void {
    const left = this.remaining_.length;
    if (left === 0) return;
    const zeta = this.harmonic_[left + 1] - 1; // 1/2 + ... + 1/(left + 1)
    this.credits_.push({ value: residualS / zeta, issued: this.steps.length });
  }

  // ---- the link

  private inFlightBytes_(): number {
    return sumOf(this.inFlight_.map((s) => s.bytes));
  }
  /** Bytes that can still arrive in time besides those in flight; an answer takes a round trip. */
  private roomBytes_(beta = this.options_.rate.recentBytesS()): number {
    const { timeLimitS, latencyS } = this.options_;
    const leftS = timeLimitS - this.nowS_;
    return Math.max(0, Math.min(beta * leftS - this.inFlightBytes_(), beta * (leftS - latencyS)));
  }
  private windowOpen_(): boolean {
    const { leastInFlight, mostInFlight, timeLimitS, latencyS, tripS, rate } = this.options_;
    const n = this.inFlight_.length;
    if (n < leastInFlight || n >= mostInFlight) return n < leastInFlight;
    // Transfers in flight take all the time that is left: a request now could only be late.
    if (timeLimitS - this.nowS_ > latencyS && this.roomBytes_() <= 0) return false;
    // Counted in fragments of the planned size: counted in bytes, many small ones would be in flight when
    // there is little time, and those are received side by side and late.
    const fragmentBytes = this.planned_.total / this.offers_.length;
    return n < leastInFlight + (windowFactor * (rate.recentBytesS(tripSamples) * tripS())) / fragmentBytes;
  }
  /**
   * Throughput of the link in the time left: the mean over as long a time until now, so that shorter bursts
   * do not count. But a link that stalls, falls or comes back by more than breakFactor does not return to its
   * mean.
   */
  private lastingBytesS_(): number {
    const { rate, timeLimitS } = this.options_;
    const recent = rate.recentBytesS(guardSamples);
    const mean = this.nowS_ < timeLimitS ? rate.meanBytesS(timeLimitS - this.nowS_) : recent;
    return recent * breakFactor > mean && recent < breakFactor * mean ? mean : recent;
  }

  // ---- bytes and rungs

  /** An offer's part of what can still arrive, as its planned bytes are a part of what is not issued. */
  private proportionalShare_(offer: number, beta: number): number {
    return this.planned_.each[offer] * (this.roomBytes_(beta) / Math.max(this.planned_.left, 1));
  }
  /** d_k */
  private targetOf_(offer: number, thetaS: number): number {
    const { policy, waitS } = this.options_;
    if (this.steps.length === 0) return this.planned_.each[offer]; // F-bar has the quality Q_i
    const target = this.throughputBytesS() * (thetaS - waitS);
    if (policy !== 'guard') return target;
    const even = this.proportionalShare_(offer, this.lastingBytesS_());
    return clamp(target, even / guard, even * guard);
  }
  private maySkip_(roomBytes: number): boolean {
    const { skips, timeLimitS, latencyS } = this.options_;
    // A stall that is over looks like a slow link until something has been transferred. A fragment that is
    // skipped on such evidence is lost for good: none is skipped while the smallest rungs of all could arrive
    // in time, and never two in a row.
    const needed = this.smallest_.left > roomBytes && this.steps.at(-1)?.bytes !== 0;
    return skips && (timeLimitS - this.nowS_ <= latencyS || needed);
  }
  private rungOf_(offer: number, target: number): number {
    const f = this.offers_[offer];
    const roomBytes = this.roomBytes_();
    const skip = this.maySkip_(roomBytes);
    const limits = this.limited_.left <= roomBytes;
    const low = (limits ? this.lowestLimited_ : this.lowest_)[offer];
    return cheapestRung(f, low, skip && !limits, Infinity, (bytes) => Math.abs(target - bytes));
  }
}
