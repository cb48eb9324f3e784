import type { TransferRate } from '../http/throughput';

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
  /** Limits of quality, see HtcOptions.hardLimits. */
  lowRung: number;
  highRung: number;
}

/**
 * How rungs are chosen. htc: the method. guard: the method over the plan of least loss instead of Eq. 3.2's, with
 * sizes kept within a factor of that plan's share of what the link gives in the time left. price: one price of bytes in
 * units of loss that rises when the plan is late. proportional: sizes scaled by what is left of time over what is left
 * to send. static: the planned sizes, whatever happens. thesis: htc with times as printed, T_0 d_g / (T_0 beta_0), whose etas count from
 * Gamma, so that the fragment with eta nearest 0 comes first.
 */
export type Policy = 'htc' | 'guard' | 'price' | 'proportional' | 'static' | 'thesis';
/** Which end of the list is next: by the sign of the next credit, by the last throughput against beta_0, or the finest. */
export type HtcOrder = 'credit' | 'beta0' | 'finest';
/** The order of a client that is told the policy alone. With guard what shows most comes first. */
export const defaultOrder = (policy: Policy): HtcOrder => (policy === 'guard' ? 'finest' : 'credit');

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

/** Options of a plan; those from `guard` on only studies choose otherwise, see HtcOptions. */
export interface TimePlanOptions {
  policy: Policy;
  order: HtcOrder;
  timeLimitS: number;
  initialBytesS: number;
  rttS: number;
  guard?: number;
  priceKappa?: number;
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
