import { Throughput, ThroughputOptions } from '../http/throughput';
import { FragmentOffer, HtcOrder, HtcStep, Policy, TimePlanOptions } from './plan_types';
import { UncheckedPlan } from './unchecked_plan';

// UncheckedPlan as it is offered to others (delivery/cpp/decide/harmonic_time.h): arguments are checked, and there are the variants of the
// thesis that load() does not use.

export type { FragmentOffer, HtcOrder, HtcStep, Policy, TimePlanOptions };

/** Options of a HarmonicTimePlan. */
export interface HtcOptions {
  policy: Policy;
  order: HtcOrder;
  /** T_0, for the fragments alone. */
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

/** The options of delivery/cpp. */
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

function require(good: boolean, what: string): asserts good {
  if (!good) throw new RangeError(what);
}

function checkOptions(o: HtcOptions): void {
  require(o.timeLimitS <= 1e6, 'HarmonicTimePlan: time limit in (0, 1e6] s');
  require(o.throughput.initialBytesS > 0, 'HarmonicTimePlan: initial throughput > 0');
  require(o.rttS >= 0 && o.rttS < 1e4, 'HarmonicTimePlan: round trip in [0, 1e4) s');
  require(o.window >= 0 && o.maxInFlight >= 1 && o.guard > 1, 'HarmonicTimePlan: window, guard');
}
function checkOffers(offers: readonly FragmentOffer[]): void {
  require(offers.length < 1 << 24, 'HarmonicTimePlan: fewer than 2^24 fragments');
  for (const f of offers) {
    require(f.bytes.length > 0 && f.loss.length === f.bytes.length + 1, 'FragmentOffer: a loss per rung and one more');
    require(f.plannedBytes > 0 && f.plannedBytes < 1e12, 'FragmentOffer: planned bytes > 0');
    for (const b of f.bytes) require(b > 0, 'FragmentOffer: bytes > 0');
    for (const l of f.loss) require(l >= 0 && l < 1e300, 'FragmentOffer: loss >= 0');
    require(Number.isFinite(f.eta), 'FragmentOffer: eta');
  }
}

/** Options for one plan, whose transfers they count. A limit <= 0 is allowed; RangeError for other values out of range. */
export function planOptions(o: HtcOptions): TimePlanOptions {
  checkOptions(o);
  const serial = o.window === 1;
  const several = o.throughput.estimator === 'last' && !serial;
  const rate = new Throughput(several ? { ...o.throughput, estimator: 'harmonic', samples: 10 } : o.throughput);
  const { policy, order, timeLimitS, rttS, guard, priceKappa, maxInFlight } = o;
  const window = o.window > 0 ? { leastInFlight: o.window, mostInFlight: o.window } : { mostInFlight: maxInFlight };
  // With one request at a time every fragment has a round trip of its own.
  const trips = serial ? { latencyS: 0, waitS: rttS } : {};
  const limits = o.hardLimits ? { lowestRung: (f: FragmentOffer) => Math.min(f.lowRung, f.bytes.length - 1), skips: false } : {};
  return {
    policy, order, timeLimitS, rttS, initialBytesS: o.throughput.initialBytesS, guard, priceKappa, ...window, ...trips, ...limits,
    rate, estimate: () => rate.bytesS(),
  };
}

/**
 * Decides fragment by fragment what to ask for: call next() until it gives nothing, and completed() or failed() for every request.
 */
export class HarmonicTimePlan {
  /** Decisions so far, skipped fragments included. */
  readonly steps: readonly HtcStep[];
  private readonly plan_: UncheckedPlan;
  private lastDoneS_ = 0;
  private unspentS_ = 0;

  /** The list is taken by falling eta (ties: index). RangeError for values out of range. */
  constructor(
    readonly offers: readonly FragmentOffer[],
    private readonly options_: HtcOptions,
  ) {
    require(options_.timeLimitS > 0, 'HarmonicTimePlan: time limit in (0, 1e6] s');
    checkOffers(offers);
    this.plan_ = new UncheckedPlan(offers, planOptions(options_));
    this.steps = this.plan_.steps;
  }

  get allIssued(): boolean {
    return this.steps.length === this.offers.length;
  }
  get finished(): boolean {
    return this.plan_.finished();
  }
  /** Pi: T_0 less the time taken. Once finished. */
  get surplusS(): number {
    return this.options_.timeLimitS - this.lastDoneS_;
  }
  /** Residuals that no fragment was left to take. */
  get unspentS(): number {
    return this.unspentS_;
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
  /** Throughput as the plan estimates it now. */
  throughputBytesS(): number {
    return this.plan_.throughputBytesS();
  }

  /**
   * The next request, while the window has room; skipped fragments are decided on the way. undefined: nothing more to
   * issue now (wait for a completion) or at all. `nowS` >= 0 counts from the first request.
   */
  next(nowS: number): HtcStep | undefined {
    const before = this.allIssued;
    const step = this.plan_.next(nowS);
    if (!step && this.allIssued && !before) this.unspentS_ += this.steps[this.steps.length - 1].residualS; // of one that was skipped
    return step;
  }
  /** The request for this offer has ended. Completions may come in any order; times must not fall. */
  completed(offer: number, nowS: number): void {
    this.finish_(offer, nowS, true);
  }
  /** The request for this offer failed and was given up: its time is spent, its fragment counts as skipped. */
  failed(offer: number, nowS: number): void {
    this.finish_(offer, nowS, false);
  }
  private finish_(offer: number, nowS: number, well: boolean): void {
    const step = this.steps.find((s) => s.offer === offer);
    require(step !== undefined, 'HarmonicTimePlan: not issued');
    require(step.doneS < 0 && nowS >= this.lastDoneS_, 'HarmonicTimePlan: completed twice, or time runs back');
    this.plan_.ended(step, nowS, well);
    this.lastDoneS_ = nowS;
    if (this.allIssued) this.unspentS_ += step.residualS;
  }
}
