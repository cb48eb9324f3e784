import { transferRate } from '../http/throughput';
import { clamp, sumOf } from './numbers';
import { PlannedBytes, type PricedBytes, pricedBytes } from './plan_bytes';
import type { FragmentOffer, HtcStep, TimePlanOptions } from './plan_types';
import { exp, log } from './portable_math';
import { bytesAtRung, cheapestRung, costAt, lowestShown, meanOffer } from './rung_choice';

// Harmonic Time Compensation (thesis ch. 4 and Appendix A, as corrected): a list of fragments is transferred so that
// the whole ends at the time limit T_0, though throughput moves. The same decisions, bit for bit, as
// delivery/cpp/decide/harmonic_time.h. The plan does no I/O and knows no clock. HarmonicTimePlan is this plan with checked arguments.

const windowFactor = 1.5;
const tripSamples = 64; // a window that follows every swing makes them worse
const guardSamples = 20;
const breakFactor = 4; // a link this many times faster or slower is another link
const largestExponent = 12;
const elasticity = 2.5; // of the price by bytes, on ladders of photographs
const spareExponent = 1;
const lateFactor = 1.2;

/** Options with those that were left out. */
function completed(options: TimePlanOptions): Required<TimePlanOptions> {
  const {
    timeLimitS, initialBytesS, rttS, guard = 1.5, priceKappa = 10, leastInFlight = 2, mostInFlight = 64,
    // Counted as a delay, the round trip would starve the fragments that come next.
    latencyS = Math.min(rttS, timeLimitS / 2), waitS = 0, lowestRung = lowestShown, skips = true,
    rate = transferRate(initialBytesS),
    // With several requests in flight completions come in bunches: only sums over some of them say anything.
    estimate = () => rate.recentBytesS(), tripS = () => rttS,
  } = options;
  return { ...options, guard, priceKappa, leastInFlight, mostInFlight, latencyS, waitS, lowestRung, skips, rate, estimate, tripS };
}

/** Decides fragment by fragment what to ask for. The list is taken by falling eta (ties: index). Nothing is checked. */
export class UncheckedPlan {
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
  private readonly priced_?: PricedBytes;
  private readonly planned_: PlannedBytes; // d_g by the policy's plan
  private nowS_ = 0;
  private lastDoneS_ = 0;

  constructor(
    private readonly offers_: readonly FragmentOffer[],
    options: TimePlanOptions,
  ) {
    this.options_ = completed(options);
    const { policy, timeLimitS, initialBytesS, lowestRung } = this.options_;
    this.remaining_ = [...offers_.keys()].sort((a, b) => offers_[b].eta - offers_[a].eta);
    for (let i = 1; i < offers_.length + 2; ++i) this.harmonic_.push(this.harmonic_[i - 1] + 1 / i);
    this.lowest_ = offers_.map((f) => lowestRung(f, false));
    this.lowestLimited_ = offers_.map((f) => lowestRung(f, true));
    this.smallest_ = new PlannedBytes(offers_.map((f, i) => f.bytes[this.lowest_[i]]));
    this.limited_ = new PlannedBytes(offers_.map((f, i) => f.bytes[this.lowestLimited_[i]]));
    if (policy === 'price' || policy === 'guard') this.priced_ = pricedBytes(offers_, this.lowest_, timeLimitS * initialBytesS);
    const leastLoss = policy === 'guard' ? this.priced_?.bytes.each : undefined;
    this.planned_ = new PlannedBytes(offers_.map((f, i) => (leastLoss ? Math.max(leastLoss[i], this.smallest_.each[i]) : f.plannedBytes)));
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
   * The next request, while the window has room; skipped fragments are decided on the way. undefined: nothing more to
   * issue now (wait for a completion) or at all. `nowS` >= 0 counts from the first request.
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
  /**
   * A request has ended, in any order; times must not fall. Not `well`: the request was given up, its time is spent, its fragment
   * counts as skipped.
   */
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
      position: this.steps.length + 1, offer, rung, bytes: bytesAtRung(this.offers_[offer], rung), creditS, thetaS, targetBytes, throughputBytesS,
      issuedS: this.nowS_, doneS: -1, spacingS: 0, residualS: 0,
    };
    this.remaining_.splice(this.remaining_.indexOf(offer), 1);
    for (const bytes of [this.smallest_, this.limited_, this.priced_?.bytes, this.planned_]) bytes?.issue(offer);
    this.steps.push(step);
    return step;
  }
  private chooseOffer_(creditS: number): number {
    const { policy, order, initialBytesS } = this.options_;
    const byPrice = policy === 'price';
    if (this.steps.length === 0 && !byPrice) return meanOffer(this.offers_, policy === 'thesis');
    const finest = byPrice || order === 'finest' || (order === 'credit' ? creditS <= 0 : this.throughputBytesS() <= initialBytesS);
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
  /** dT is spread over what is to come, the share 1 / (chi zeta) for each, chi = 2 for the position after the last issued one. */
  private spread_(residualS: number): void {
    const left = this.remaining_.length;
    if (left > 0) this.credits_.push({ value: residualS / (this.harmonic_[left + 1] - 1), issued: this.steps.length }); // 1/2 + ... + 1/(left + 1)
  }

  // ---- the link

  private inFlightBytes_(): number {
    return sumOf(this.inFlight_.map((s) => s.bytes));
  }
  /**
   * Bytes that can still arrive in time besides those in flight. A request now is answered a round trip later, whether
   * or not enough is in flight until then.
   */
  private roomBytes_(beta = this.options_.rate.recentBytesS(), leftS = this.options_.timeLimitS - this.nowS_): number {
    return Math.max(0, Math.min(beta * leftS - this.inFlightBytes_(), beta * (leftS - this.options_.latencyS)));
  }
  private windowOpen_(): boolean {
    const { leastInFlight, mostInFlight, timeLimitS, latencyS, tripS, rate } = this.options_;
    const n = this.inFlight_.length;
    if (n < leastInFlight || n >= mostInFlight) return n < leastInFlight;
    // Transfers in flight take all the time that is left: a request now could only be late.
    if (timeLimitS - this.nowS_ > latencyS && this.roomBytes_() <= 0) return false;
    // Counted in fragments of the planned size: counted in bytes, many small ones would be in flight when there is little
    // time, and those are received side by side and late.
    const fragmentBytes = this.planned_.total / this.offers_.length;
    return n < leastInFlight + (windowFactor * (rate.recentBytesS(tripSamples) * tripS())) / fragmentBytes;
  }
  /**
   * Throughput of the link in the time left: the mean over as long a time until now, so that shorter bursts do not count. But a link
   * that stalls, falls or comes back by more than breakFactor does not return to its mean.
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
    const { policy, waitS, guard } = this.options_;
    if (policy === 'proportional') return this.proportionalShare_(offer, this.throughputBytesS());
    if (policy === 'static' || policy === 'price' || this.steps.length === 0) return this.planned_.each[offer]; // F-bar has the quality Q_i
    const target = this.throughputBytesS() * (thetaS - waitS);
    if (policy !== 'guard') return target;
    const even = this.proportionalShare_(offer, this.lastingBytesS_());
    return clamp(target, even / guard, even * guard);
  }
  private priceNow_({ price, bytes }: PricedBytes): number {
    const { timeLimitS, priceKappa } = this.options_;
    const plannedS = bytes.total > 0 ? timeLimitS * ((bytes.total - bytes.left) / bytes.total) : 0;
    // Bytes in flight have been issued but not paid for yet.
    const lag = this.nowS_ - (plannedS - this.inFlightBytes_() / this.throughputBytesS());
    const leftS = Math.max(timeLimitS - this.nowS_, 1e-3 * timeLimitS);
    // A lag alone asks for too much after a stall: the price is no higher than the remaining bytes need.
    const ratio = bytes.left / Math.max(this.roomBytes_(undefined, timeLimitS - (timeLimitS - leftS)), 1);
    const enough = spareExponent + elasticity * log(Math.max(ratio, 1));
    return price * exp(clamp((priceKappa * lag) / leftS, -largestExponent, Math.min(enough, largestExponent)));
  }
  private maySkip_(roomBytes: number): boolean {
    const { policy, skips, timeLimitS, latencyS } = this.options_;
    // A stall that is over looks like a slow link until something has been transferred. A fragment that is skipped on such evidence is
    // lost for good: never two in a row are skipped, unless the rest could not arrive in time.
    const careless = policy === 'htc' || policy === 'static' || this.smallest_.left > roomBytes;
    return skips && (timeLimitS - this.nowS_ <= latencyS || (careless && this.steps.at(-1)?.bytes !== 0));
  }
  private rungOf_(offer: number, target: number): number {
    const f = this.offers_[offer];
    const roomBytes = this.roomBytes_();
    const skip = this.maySkip_(roomBytes);
    if (this.options_.policy === 'price')
      return cheapestRung(f, this.lowest_[offer], skip, lateFactor * roomBytes, costAt(this.priceNow_(this.priced_!)));
    const limits = this.limited_.left <= roomBytes;
    return cheapestRung(f, (limits ? this.lowestLimited_ : this.lowest_)[offer], skip && !limits, Infinity, (b) => Math.abs(target - b));
  }
}
