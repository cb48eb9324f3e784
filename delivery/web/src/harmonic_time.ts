import { exp, log } from './portable_math';
import { Throughput, ThroughputOptions } from './throughput';

// Harmonic Time Compensation (thesis ch. 4 and Appendix A, as corrected): a list of fragments is transferred so that
// the whole ends at the time limit T_0, though throughput moves. The same decisions, bit for bit, as
// delivery/cpp/harmonic_time: it does no I/O and knows no clock.

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

/** Of a HarmonicTimePlan. */
export interface HtcOptions {
  policy: Policy;
  order: HtcOrder;
  /** T_0, of the fragments alone. */
  timeLimitS: number;
  /** initialBytesS is beta_0. */
  throughput: ThroughputOptions;
  rttS: number;
  /** Requests in flight; 0 = until 1.5 x throughput x round trip, at least 2. */
  window: number;
  maxInFlight: number;
  /**
   * true: never below lowRung, nothing skipped, as in the thesis. false: so while the time is enough for it, then the
   * bottom of the ladder, then skipping.
   */
  hardLimits: boolean;
  /** Factor of guard, > 1. */
  guard: number;
  /** How fast price's price rises with delay. */
  priceKappa: number;
}

/** Those of delivery/cpp. */
export function defaultHtcOptions(): HtcOptions {
  return {
    policy: 'htc',
    order: 'credit',
    timeLimitS: 5,
    throughput: { estimator: 'last', samples: 10, ewma: 0.2, smallBytes: 4000, initialBytesS: 1e5 },
    rttS: 0,
    window: 0,
    maxInFlight: 64,
    hardLimits: false,
    guard: 1.5,
    priceKappa: 10,
  };
}

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

const windowFactor = 1.5;
const tripSamples = 64; // a window that follows every swing makes them worse
const windowSamples = 10;
const guardSamples = 20;
const breakFactor = 4; // a link this many times faster or slower is another link
const largestExponent = 12;
// A stall that is over looks like a slow link until something has been transferred: what is skipped on such evidence is
// lost for good.
const mostSkipsInARow = 1;
const elasticity = 2.5; // of the price by bytes, on ladders of photographs
const spareExponent = 1;
const lateFactor = 1.2;
const anyRung = 0xffff;

const clamp = (v: number, least: number, most: number): number => (v < least ? least : most < v ? most : v);

function require(good: boolean, what: string): void {
  if (!good) throw new RangeError(what);
}

function check(offers: readonly FragmentOffer[], o: HtcOptions): void {
  require(offers.length < 1 << 24, 'HarmonicTimePlan: fewer than 2^24 fragments');
  require(o.timeLimitS > 0 && o.timeLimitS <= 1e6, 'HarmonicTimePlan: time limit in (0, 1e6] s');
  require(o.throughput.initialBytesS > 0, 'HarmonicTimePlan: initial throughput > 0');
  require(o.rttS >= 0 && o.rttS < 1e4, 'HarmonicTimePlan: round trip in [0, 1e4) s');
  require(o.window >= 0 && o.maxInFlight >= 1 && o.guard > 1, 'HarmonicTimePlan: window, guard');
  for (const f of offers) {
    require(f.bytes.length > 0 && f.loss.length === f.bytes.length + 1, 'FragmentOffer: a loss per rung and one more');
    require(f.plannedBytes > 0 && f.plannedBytes < 1e12, 'FragmentOffer: planned bytes > 0');
    for (const b of f.bytes) require(b > 0, 'FragmentOffer: bytes > 0');
    for (const l of f.loss) require(l >= 0 && l < 1e300, 'FragmentOffer: loss >= 0');
    require(Number.isFinite(f.eta), 'FragmentOffer: eta');
  }
}

/** The fragment with eta nearest the mean (ties: the first). */
function meanFragment(offers: readonly FragmentOffer[]): number {
  let sum = 0;
  for (const f of offers) sum += f.eta;
  const mean = sum / Math.max(offers.length, 1);
  let best = 0;
  for (let i = 1; i < offers.length; ++i)
    if (Math.abs(offers[i].eta - mean) < Math.abs(offers[best].eta - mean)) best = i;
  return best;
}

const highest = (f: FragmentOffer): number => Math.min(f.highRung ?? anyRung, f.bytes.length - 1);

/** The lowest rung worth asking for: unless limits are hard, one that shows more than the preview does. */
function lowest(f: FragmentOffer, limits: boolean, hard: boolean): number {
  const low = limits ? Math.min(f.lowRung, f.bytes.length - 1) : 0;
  if (hard) return low;
  for (let r = low; r <= highest(f); ++r) if (f.loss[r + 1] < f.loss[0]) return r;
  return low;
}

/**
 * Decides fragment by fragment what to ask for: call next() until it gives nothing, and completed() or failed() for every request.
 */
export class HarmonicTimePlan {
  /** Decisions so far, skipped fragments included. */
  readonly steps: HtcStep[] = [];
  private readonly throughput_: Throughput;
  private readonly harmonic_: number[];
  private readonly credits_: { value: number; issued: number }[] = [];
  private readonly sorted_: number[];
  private readonly stepOfOffer_: number[];
  private readonly taken_: boolean[];
  private left_ = 0;
  private right_: number;
  private readonly mean_: number;
  private planned_: number[]; // d_g in bytes by offer, by the policy's plan
  private plannedTotal_ = 0;
  private plannedLeft_ = 0;
  private smallestLeft_ = 0;
  private lowLeft_ = 0;
  private price0_ = 0;
  private priceTotal_ = 0;
  private priceDone_ = 0;
  private readonly priceBytes_: number[] = [];
  private inFlight_ = 0;
  private inFlightBytes_ = 0;
  private skipsInARow_ = 0;
  private readonly waiting_ = new Set<HtcStep>(); // in flight
  private latencyS_ = 0; // at the start, in which nothing can arrive
  private lastDoneS_ = 0;
  private unspent_ = 0;

  /** The list is taken by falling eta (ties: index). RangeError for values out of range. */
  constructor(
    readonly offers: readonly FragmentOffer[],
    private readonly options_: HtcOptions,
  ) {
    check(offers, options_);
    const n = offers.length;
    this.throughput_ = new Throughput(options_.throughput);
    this.harmonic_ = new Array<number>(n + 2).fill(0);
    for (let i = 1; i < n + 2; ++i) this.harmonic_[i] = this.harmonic_[i - 1] + 1 / i;
    this.sorted_ = offers.map((_, i) => i).sort((a, b) => offers[b].eta - offers[a].eta);
    this.stepOfOffer_ = new Array<number>(n).fill(n);
    this.taken_ = new Array<boolean>(n).fill(false);
    this.right_ = n;
    this.mean_ = meanFragment(offers);
    this.planned_ = offers.map((f) => f.plannedBytes);
    const hard = options_.hardLimits;
    for (const f of offers) {
      this.plannedTotal_ += f.plannedBytes;
      this.smallestLeft_ += f.bytes[lowest(f, hard, hard)];
      this.lowLeft_ += f.bytes[lowest(f, true, hard)];
    }
    this.plannedLeft_ = this.plannedTotal_;
    // Nothing can arrive in the first round trip. Counted as a delay it would starve the fragments that come next; with
    // one request at a time every fragment has a round trip of its own.
    if (options_.window !== 1) this.latencyS_ = Math.min(options_.rttS, options_.timeLimitS / 2);
    if (options_.policy === 'price' || options_.policy === 'guard') this.planPrices_();
    if (options_.policy === 'guard') this.planForLeastLoss_();
  }

  get allIssued(): boolean {
    return this.steps.length === this.offers.length;
  }
  get finished(): boolean {
    return this.allIssued && this.inFlight_ === 0;
  }
  /** Pi: T_0 less the time taken. Once finished. */
  get surplusS(): number {
    return this.options_.timeLimitS - this.lastDoneS_;
  }
  get unspentS(): number {
    return this.unspent_;
  }
  /** A limit under 30 round trips cannot be met well. */
  get tooShortForRtt(): boolean {
    return this.options_.timeLimitS < 30 * this.options_.rttS;
  }
  /** Chosen rung by offer; -1 skipped or not decided. */
  rungs(): number[] {
    const rungs = new Array<number>(this.offers.length).fill(-1);
    for (const s of this.steps) rungs[s.offer] = s.rung;
    return rungs;
  }

  // The price at which the plan for beta_0 spends T_0 x beta_0: bisection on its logarithm.
  private planPrices_(): void {
    const budget = this.options_.timeLimitS * this.options_.throughput.initialBytesS;
    const rungBytes = (f: FragmentOffer, price: number): number => {
      const rung = this.cheapestRungOf_(f, price, true, budget);
      return rung < 0 ? 0 : f.bytes[rung];
    };
    const bytesAt = (price: number): number => {
      let sum = 0;
      for (const f of this.offers) sum += rungBytes(f, price);
      return sum;
    };
    let low = -60;
    let high = 60;
    for (let i = 0; i < 60; ++i) {
      const middle = (low + high) / 2;
      if (bytesAt(exp(middle)) > budget) low = middle;
      else high = middle;
    }
    this.price0_ = exp(high);
    for (const f of this.offers) {
      this.priceBytes_.push(rungBytes(f, this.price0_));
      this.priceTotal_ += this.priceBytes_[this.priceBytes_.length - 1];
    }
  }

  private planForLeastLoss_(): void {
    const hard = this.options_.hardLimits;
    this.planned_ = this.offers.map((f, i) => Math.max(this.priceBytes_[i], f.bytes[lowest(f, hard, hard)]));
    this.plannedTotal_ = 0;
    for (const b of this.planned_) this.plannedTotal_ += b;
    this.plannedLeft_ = this.plannedTotal_;
  }

  throughputBytesS(): number {
    // With several requests in flight completions come in bunches: only sums over some of them say anything.
    if (this.options_.window !== 1 && this.options_.throughput.estimator === 'last')
      return this.throughput_.recentBytesS(windowSamples);
    return this.throughput_.bytesS();
  }

  private windowOpen_(nowS: number): boolean {
    if (this.options_.window > 0) return this.inFlight_ < this.options_.window;
    if (this.inFlight_ < 2) return true;
    if (this.inFlight_ >= this.options_.maxInFlight) return false;
    // What is in flight takes all the time that is left: what is asked for now could only be late.
    const leftS = this.options_.timeLimitS - nowS;
    if (leftS > this.latencyS_ && this.roomBytes_(this.throughput_.recentBytesS(windowSamples), nowS) <= 0) return false;
    // Counted in fragments of the planned size: counted in bytes, many small ones would be in flight when there is little
    // time, and those are received side by side and late.
    const fragmentBytes = this.plannedTotal_ / this.offers.length;
    const tripBytes = this.throughput_.recentBytesS(tripSamples) * this.options_.rttS;
    return this.inFlight_ < 2 + (windowFactor * tripBytes) / fragmentBytes;
  }

  /**
   * The next request, while the window has room; skipped fragments are decided on the way. undefined: nothing more to
   * issue now (wait for a completion) or at all. `nowS` >= 0 counts from the first request.
   */
  next(nowS: number): HtcStep | undefined {
    while (!this.allIssued && this.windowOpen_(nowS)) {
      const position = this.steps.length + 1;
      const creditS = this.creditAt_(position);
      const offer = this.chooseOffer_(creditS);
      const f = this.offers[offer];
      const thetaS = this.thetaOf_(offer) + creditS;
      const throughputBytesS = this.throughputBytesS();
      const targetBytes = this.targetOf_(offer, thetaS, nowS);
      const rung = this.rungOf_(offer, targetBytes, nowS);
      const step: HtcStep = {
        position, offer, rung, bytes: rung < 0 ? 0 : f.bytes[rung], creditS, thetaS, targetBytes, throughputBytesS,
        issuedS: nowS, doneS: -1, spacingS: 0, residualS: 0,
      };
      this.take_(offer);
      this.stepOfOffer_[offer] = this.steps.length;
      this.steps.push(step);
      if (rung < 0) {
        // No transfer: it takes no time and says nothing of the link.
        step.doneS = nowS;
        step.residualS = step.thetaS;
        ++this.skipsInARow_;
        this.spread_(step.residualS);
        continue;
      }
      this.skipsInARow_ = 0;
      this.waiting_.add(step);
      ++this.inFlight_;
      this.inFlightBytes_ += step.bytes;
      return step;
    }
    return undefined;
  }

  private chooseOffer_(credit: number): number {
    const inOrder = this.options_.policy === 'price';
    if (this.steps.length === 0 && !inOrder) return this.mean_;
    let finest = true;
    if (!inOrder && this.options_.order === 'credit') finest = credit <= 0;
    if (!inOrder && this.options_.order === 'beta0')
      finest = this.throughputBytesS() <= this.options_.throughput.initialBytesS;
    let { left_: left, right_: right } = this;
    while (left < right && this.taken_[this.sorted_[left]]) ++left;
    while (left < right && this.taken_[this.sorted_[right - 1]]) --right;
    return this.sorted_[finest ? left : right - 1];
  }

  private take_(offer: number): void {
    const f = this.offers[offer];
    this.taken_[offer] = true;
    while (this.left_ < this.right_ && this.taken_[this.sorted_[this.left_]]) ++this.left_;
    while (this.left_ < this.right_ && this.taken_[this.sorted_[this.right_ - 1]]) --this.right_;
    this.plannedLeft_ -= this.planned_[offer];
    const hard = this.options_.hardLimits;
    this.smallestLeft_ -= f.bytes[lowest(f, hard, hard)];
    this.lowLeft_ -= f.bytes[lowest(f, true, hard)];
    if (this.priceBytes_.length > 0) this.priceDone_ += this.priceBytes_[offer];
  }

  private thetaOf_(offer: number): number {
    return (this.options_.timeLimitS - this.latencyS_) * (this.planned_[offer] / this.plannedTotal_);
  }

  // credit_i: the share 1 / (chi zeta), chi = 2 for the position after the last issued one, of every dT so far.
  private creditAt_(position: number): number {
    let credit = 0;
    for (const c of this.credits_) credit += c.value / (position - c.issued + 1);
    return credit;
  }

  private spread_(residualS: number): void {
    const issued = this.steps.length;
    const left = this.offers.length - issued;
    if (left === 0) {
      this.unspent_ += residualS;
      return;
    }
    const zeta = this.harmonic_[left + 1] - 1; // 1/2 + ... + 1/(left + 1)
    this.credits_.push({ value: residualS / zeta, issued });
  }

  /**
   * Bytes that can still arrive in time besides those in flight. What is asked for now arrives a round trip later, whether
   * or not enough is in flight until then.
   */
  private roomBytes_(beta: number, nowS: number): number {
    const leftS = this.options_.timeLimitS - nowS;
    return Math.max(0, Math.min(beta * leftS - this.inFlightBytes_, beta * (leftS - this.latencyS_)));
  }

  /** What a plan in proportion to the planned sizes gives, as a factor of them. */
  private proportionalShare_(nowS: number, beta: number): number {
    return this.roomBytes_(beta, nowS) / Math.max(this.plannedLeft_, 1);
  }

  /**
   * What the link will give in the time left: its mean over as long a time until now, so that bursts shorter than that do
   * not count; but a link that stalls, falls or comes back by more than breakFactor does not return to its mean.
   */
  private lastingBytesS_(nowS: number): number {
    const recent = this.throughput_.recentBytesS(guardSamples);
    const leftS = this.options_.timeLimitS - nowS;
    if (leftS <= 0) return recent;
    const mean = this.throughput_.meanBytesS(leftS);
    return recent * breakFactor > mean && recent < breakFactor * mean ? mean : recent;
  }

  private targetOf_(offer: number, thetaS: number, nowS: number): number {
    const planned = this.planned_[offer];
    const { policy } = this.options_;
    if (policy === 'static' || policy === 'price') return planned;
    if (policy === 'proportional') return planned * this.proportionalShare_(nowS, this.throughputBytesS());
    if (this.steps.length === 0) return planned; // F-bar has the quality Q_i
    // Alone in flight it has to wait for a round trip first.
    const wait = this.options_.window === 1 ? this.options_.rttS : 0;
    const target = this.throughputBytesS() * (thetaS - wait);
    if (policy === 'htc') return target;
    const even = planned * this.proportionalShare_(nowS, this.lastingBytesS_(nowS));
    return clamp(target, even / this.options_.guard, even * this.options_.guard);
  }

  private limitsCanHold_(nowS: number): boolean {
    if (this.options_.hardLimits) return true;
    return this.lowLeft_ <= this.roomBytes_(this.throughput_.recentBytesS(windowSamples), nowS);
  }

  private maySkip_(nowS: number): boolean {
    if (this.options_.hardLimits) return false;
    if (this.options_.timeLimitS - nowS <= this.latencyS_) return true; // it could not arrive in time
    if (this.skipsInARow_ >= mostSkipsInARow) return false;
    if (this.options_.policy === 'htc' || this.options_.policy === 'static') return true;
    return this.smallestLeft_ > this.roomBytes_(this.throughput_.recentBytesS(windowSamples), nowS);
  }

  private rungOf_(offer: number, target: number, nowS: number): number {
    const f = this.offers[offer];
    const skip = this.maySkip_(nowS);
    if (this.options_.policy !== 'price') {
      const limits = this.limitsCanHold_(nowS);
      return this.nearestRungOf_(f, target, limits, skip && !limits);
    }
    const room = this.roomBytes_(this.throughput_.recentBytesS(windowSamples), nowS);
    return this.cheapestRungOf_(f, this.priceAt_(nowS), skip, lateFactor * room);
  }

  private nearestRungOf_(f: FragmentOffer, target: number, limits: boolean, maySkip: boolean): number {
    const low = lowest(f, limits, this.options_.hardLimits);
    let best = maySkip ? -1 : low;
    let distance = Math.abs(target - (best < 0 ? 0 : f.bytes[best]));
    for (let r = low; r <= highest(f); ++r) {
      const d = Math.abs(target - f.bytes[r]);
      if (d < distance) {
        distance = d;
        best = r;
      }
    }
    return best;
  }

  private cheapestRungOf_(f: FragmentOffer, price: number, maySkip: boolean, mostBytes: number): number {
    const hard = this.options_.hardLimits;
    const low = lowest(f, hard, hard);
    let best = maySkip ? -1 : low;
    let cost = maySkip ? f.loss[0] : f.loss[low + 1] + price * f.bytes[low];
    for (let r = low; r <= highest(f); ++r) {
      if (f.bytes[r] > mostBytes) continue;
      const c = f.loss[r + 1] + price * f.bytes[r];
      if (c < cost) {
        cost = c;
        best = r;
      }
    }
    return best;
  }

  // A lag alone asks for too much after a stall: no higher price than what is left can be sent at.
  private mostExponent_(leftS: number): number {
    const beta = this.throughput_.recentBytesS(windowSamples);
    const room = this.roomBytes_(beta, this.options_.timeLimitS - leftS);
    const ratio = (this.priceTotal_ - this.priceDone_) / Math.max(room, 1);
    const enough = spareExponent + elasticity * log(Math.max(ratio, 1));
    return Math.min(enough, largestExponent);
  }

  private priceAt_(nowS: number): number {
    const limit = this.options_.timeLimitS;
    const plannedS = this.priceTotal_ > 0 ? limit * (this.priceDone_ / this.priceTotal_) : 0;
    // What is in flight has been issued but not paid for yet.
    const lag = nowS - (plannedS - this.inFlightBytes_ / this.throughputBytesS());
    const left = Math.max(limit - nowS, 1e-3 * limit);
    return this.price0_ * exp(clamp((this.options_.priceKappa * lag) / left, -largestExponent, this.mostExponent_(left)));
  }

  /** The request for this offer has ended. Completions may come in any order; times must not fall. */
  completed(offer: number, nowS: number): void {
    this.finish_(this.stepOf_(offer), nowS, true);
  }
  /** The request failed and was given up: its time is spent, its fragment counts as skipped. */
  failed(offer: number, nowS: number): void {
    const step = this.stepOf_(offer);
    this.finish_(step, nowS, false);
    step.rung = -1;
  }
  private stepOf_(offer: number): HtcStep {
    const step = this.steps[this.stepOfOffer_[offer]];
    require(step !== undefined, 'HarmonicTimePlan: not issued');
    return step;
  }

  private finish_(step: HtcStep, nowS: number, sample: boolean): void {
    require(step.doneS < 0 && nowS >= this.lastDoneS_, 'HarmonicTimePlan: completed twice, or time runs back');
    step.doneS = nowS;
    step.spacingS = Math.max(0, nowS - Math.max(this.lastDoneS_, this.latencyS_));
    step.residualS = step.thetaS - step.spacingS;
    // The link was idle only while nothing that was asked for could have been on its way.
    let firstIssuedS = step.issuedS;
    for (const s of this.waiting_) firstIssuedS = Math.min(firstIssuedS, s.issuedS);
    this.waiting_.delete(step);
    if (sample) this.throughput_.add(step.bytes, nowS - Math.max(this.lastDoneS_, firstIssuedS + this.options_.rttS));
    this.lastDoneS_ = nowS;
    --this.inFlight_;
    this.inFlightBytes_ -= step.bytes;
    this.spread_(step.residualS);
  }
}

/** The bounds of the thesis for a finished serial run, and what really holds (Appendix A). */
export interface HtcTheorem {
  surplusS: number;
  lastResidualS: number;
  correctedBoundS: number;
  publishedBoundS: number;
}
/** For plans with one request at a time in which nothing failed. */
export function theoremOf(plan: HarmonicTimePlan): HtcTheorem {
  const { steps } = plan;
  const n = steps.length;
  if (n === 0) return { surplusS: 0, lastResidualS: 0, correctedBoundS: 0, publishedBoundS: 0 };
  const last = steps[n - 1];
  let correctedBoundS = Math.abs(last.thetaS);
  if (last.bytes > 0) {
    const betaN = last.bytes / last.spacingS;
    correctedBoundS =
      Math.abs(last.thetaS) * Math.abs(last.throughputBytesS / betaN - 1) +
      Math.abs(last.targetBytes - last.bytes) / betaN;
  }
  let sum = 0;
  for (let k = 0; k + 1 < n; ++k) sum += steps[k].residualS;
  const mean = n > 1 ? sum / (n - 1) : 0;
  const logN = log(Math.max(n, 3));
  const publishedBoundS =
    last.residualS + (n > 1 ? steps[n - 2].residualS / 2 : 0) + (1.088 + log(logN)) * mean;
  return { surplusS: plan.surplusS, lastResidualS: last.residualS, correctedBoundS, publishedBoundS };
}
