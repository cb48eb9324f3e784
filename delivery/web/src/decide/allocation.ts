import { type PlaneTables, fragmentCount } from '../format/tables';
import { clamp, positive, sumOf } from './numbers';
import { exp, log } from './portable_math';

// From feature counts to the quality that a fragment is asked to have (thesis 3.2-3.3):
// format/rules/allocation.cpp, bit for bit.

/** g(Q) = -ln(IJG's scale of the quantisers): grows with quality, by ln 2 where the quantisers halve. */
export function logQuantiser(quality: number): number {
  const q = clamp(quality, 1, 100);
  return -log(Math.max(q < 50 ? 50 / q : 2 - q / 50, 0.01));
}

const qualityOfScale = (scale: number): number => (scale > 1 ? 50 / scale : 100 - 50 * scale);

/** [F]: eta_i (3.1) of a scale: min-max of counts over covered fragments, else 0. */
function densityOf(t: PlaneTables, row: number): Float32Array {
  const covered = positive(t.coveredTexels);
  const features = (f: number): number => t.features[row * fragmentCount(t) + f];
  const rising = covered.map(features).sort((a, b) => a - b);
  const [low, high] = [rising[0], rising[rising.length - 1]];
  const eta = new Float32Array(fragmentCount(t));
  if (high > low) for (const f of covered) eta[f] = (features(f) - low) / (high - low);
  return eta;
}

/** [F]: eta_i (3.1) of a scale; in allocation 3 its VQP. */
export function etaOf(t: PlaneTables, row: number): Float32Array {
  const eta = densityOf(t, row);
  if (t.allocation !== 3) return eta;
  const finest = densityOf(t, 0);
  return eta.map((own, f) => clamp(t.vqp[f] + t.densityWeight * (own - finest[f]), 0, 1));
}

/** The default Gamma: mean of eta over covered fragments. */
export function meanEta(t: PlaneTables, row: number): number {
  return sumOf(etaOf(t, row)) / Math.max(positive(t.coveredTexels).length, 1);
}

/** q_i(x, y): the quality that the tables' allocation asks for, clipped. [F] */
export function qualityOf(t: PlaneTables, row: number, gamma: number): Float32Array {
  const result = etaOf(t, row);
  const middle = t.quality[row];
  const g = logQuantiser(middle);
  for (let f = 0; f < result.length; ++f) {
    const away = result[f] - gamma;
    const q = t.allocation % 3 === 0 ? middle + away * t.qualityWidth
      : qualityOfScale(exp(-(g + away * t.logWidth)));
    result[f] = clamp(Math.fround(q), t.qualityMin, t.qualityMax);
  }
  return result;
}
