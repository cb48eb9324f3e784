import type { HarmonicTimePlan } from '../harmonic_time';
import { log } from '../portable_math';

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
