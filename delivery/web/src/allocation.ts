import { exp, log } from './portable_math';
import { PlaneTables, fragmentCount, rungCount } from './tables';

// From feature counts to the quality that a fragment is asked to have (thesis 3.2-3.3), and what a budget is best
// spent on: the same as format/allocation.cpp, format/rate_distortion.cpp and format/size_curve.cpp, bit for bit.

const clamp = (v: number, least: number, most: number): number => Math.min(Math.max(v, least), most);

/** What a client must have of a fragment to show it at a rung; 0 when it is not stored there. */
export function bytesToShow(t: PlaneTables, rung: number, fragment: number): number {
  const n = fragmentCount(t);
  const own = t.sizeBytes[rung * n + fragment];
  if (!t.incremental || own === 0) return own;
  let bytes = 0;
  for (let r = 0; r <= rung; ++r) bytes += t.sizeBytes[r * n + fragment];
  return bytes;
}

/** g(Q) = -ln(IJG's scale of the quantisers): grows with quality, by ln 2 where the quantisers halve. */
export function logQuantiser(quality: number): number {
  const q = clamp(quality, 1, 100);
  return -log(Math.max(q < 50 ? 50 / q : 2 - q / 50, 0.01));
}

const qualityOfScale = (scale: number): number => (scale > 1 ? 50 / scale : 100 - 50 * scale);

/** eta_i (3.1) of one scale: feature counts min-max over covered fragments; 0 for the others. [F] */
export function etaOf(t: PlaneTables, scale: number): Float32Array {
  const n = fragmentCount(t);
  const features = t.features.subarray(scale * n, (scale + 1) * n);
  let low = 0xffffffff;
  let high = 0;
  for (let f = 0; f < n; ++f) {
    if (t.coveredTexels[f] === 0) continue;
    low = Math.min(low, features[f]);
    high = Math.max(high, features[f]);
  }
  const eta = new Float32Array(n);
  if (high <= low) return eta;
  for (let f = 0; f < n; ++f) if (t.coveredTexels[f] > 0) eta[f] = (features[f] - low) / (high - low);
  return eta;
}

/** The default Gamma: mean of eta over covered fragments. */
export function meanEta(t: PlaneTables, scale: number): number {
  const eta = etaOf(t, scale);
  let sum = 0;
  let covered = 0;
  for (let f = 0; f < eta.length; ++f) {
    if (t.coveredTexels[f] === 0) continue;
    sum += eta[f];
    ++covered;
  }
  return covered > 0 ? sum / covered : 0;
}

/** q_i(x, y): the quality that the tables' allocation asks for, clipped. [F] */
export function qualityOf(t: PlaneTables, scale: number, gamma: number): Float32Array {
  const result = etaOf(t, scale);
  const middle = t.quality[scale];
  const g = logQuantiser(middle);
  for (let f = 0; f < result.length; ++f) {
    const away = result[f] - gamma;
    const q = t.allocation === 0 ? middle + away * t.qualityWidth : qualityOfScale(exp(-(g + away * t.logWidth)));
    result[f] = clamp(Math.fround(q), t.qualityMin, t.qualityMax);
  }
  return result;
}

/** Index of the rung whose quality is nearest in log-quantiser space (ties: the lower). */
export function nearestRung(t: PlaneTables, quality: number): number {
  const g = logQuantiser(quality);
  let best = 0;
  let bestDistance = Infinity;
  for (let r = 0; r < rungCount(t); ++r) {
    const distance = Math.abs(logQuantiser(t.rungQuality[r]) - g);
    if (distance < bestDistance) {
      best = r;
      bestDistance = distance;
    }
  }
  return best;
}

/**
 * What a fragment's quality is worth: its surface fraction, with the area per texel capped at the 99th percentile of
 * all covered texels. [F]
 */
export function surfaceWeights(t: PlaneTables): Float32Array {
  const densities: { areaPerTexel: number; texels: number; fragment: number }[] = [];
  let texels = 0;
  for (let f = 0; f < fragmentCount(t); ++f) {
    const covered = t.coveredTexels[f];
    if (covered === 0) continue;
    densities.push({ areaPerTexel: t.surfaceFraction[f] / covered, texels: covered, fragment: f });
    texels += covered;
  }
  const weights = new Float32Array(fragmentCount(t));
  densities.sort((a, b) => a.areaPerTexel - b.areaPerTexel);
  let below = 0;
  let cap = 0;
  for (const d of densities) {
    if (100 * below >= 99 * texels) break;
    below += d.texels;
    cap = d.areaPerTexel;
  }
  for (const d of densities) weights[d.fragment] = Math.min(d.areaPerTexel, cap) * d.texels;
  return weights;
}

/** One fragment as the rate-distortion choice sees it. Way 0 is skipping (0 bytes). */
export interface RdCurve {
  bytes: number[];
  /** Same length; whole numbers of at most 2^46. */
  loss: number[];
}

interface Step {
  slope: number;
  curve: number;
  way: number;
  bytes: number;
}

/** Walks along the lower convex hull of a curve from way 0; the slopes fall. */
function addSteps(curve: RdCurve, index: number, steps: Step[]): void {
  for (let at = 0; ; ) {
    let best: Step = { slope: 0, curve: index, way: 0, bytes: 0 };
    for (let way = 1; way < curve.bytes.length; ++way) {
      if (curve.bytes[way] <= curve.bytes[at] || curve.loss[way] >= curve.loss[at]) continue;
      const bytes = curve.bytes[way] - curve.bytes[at];
      const slope = (curve.loss[at] - curve.loss[way]) / bytes;
      if (slope > best.slope || (slope === best.slope && bytes > best.bytes)) best = { slope, curve: index, way, bytes };
    }
    if (best.way === 0) return;
    steps.push(best);
    at = best.way;
  }
}

/** Per curve the way to show it, so that least is lost within the budget (section 8, Rate-distortion). */
export function spendBytes(curves: readonly RdCurve[], budgetBytes: number): number[] {
  const steps: Step[] = [];
  curves.forEach((curve, c) => addSteps(curve, c, steps));
  steps.sort((a, b) => b.slope - a.slope);
  const way = new Array<number>(curves.length).fill(0);
  const ended = new Array<boolean>(curves.length).fill(false);
  let left = budgetBytes;
  for (const step of steps) {
    if (ended[step.curve]) continue;
    if (step.bytes > left) {
      ended[step.curve] = true;
      continue;
    }
    left -= step.bytes;
    way[step.curve] = step.way;
  }
  return way;
}

/** The curves of a plane's stored fragments, in index order; weights default to surfaceWeights(). */
export function rdCurves(t: PlaneTables, weights: Float32Array = surfaceWeights(t), share = 1): RdCurve[] {
  let largest = 0;
  for (const f of t.order) largest = Math.max(largest, weights[f]);
  const fragments = fragmentCount(t);
  const curves: RdCurve[] = [];
  for (const f of Array.from(t.order).sort((a, b) => a - b)) {
    const unit = largest > 0 ? Math.floor((weights[f] / largest) * share * 1048576 + 0.5) : 0;
    const loss = (dssim: number): number => Math.floor(unit * (dssim * 16777216));
    const curve: RdCurve = { bytes: [0], loss: [loss(t.skipDssim.length === 0 ? 1 : t.skipDssim[f])] };
    for (let r = 0; r < rungCount(t); ++r) {
      const at = r * fragments + f;
      curve.bytes.push(bytesToShow(t, r, f));
      curve.loss.push(t.sizeBytes[at] > 0 ? loss(t.dssim[at]) : curve.loss[0]);
    }
    curves.push(curve);
  }
  return curves;
}

/** The rung of every fragment (-1 skipped) that loses least for at most `budgetBytes`. [F] */
export function allocateRd(t: PlaneTables, budgetBytes: number, weights?: Float32Array): Int16Array {
  const ways = spendBytes(rdCurves(t, weights), budgetBytes);
  const rungs = new Int16Array(fragmentCount(t)).fill(-1);
  Array.from(t.order)
    .sort((a, b) => a - b)
    .forEach((f, k) => (rungs[f] = ways[k] - 1));
  return rungs;
}

/** The rung of every fragment at a scale and Gamma (default: mean of eta); -1 for those that are not stored. [F] */
export function rungsOf(t: PlaneTables, scale: number, gamma: number): Int16Array {
  const quality = qualityOf(t, scale, gamma);
  const rungs = new Int16Array(fragmentCount(t)).fill(-1);
  let bytes = 0;
  for (const f of t.order) {
    rungs[f] = nearestRung(t, quality[f]);
    bytes += bytesToShow(t, rungs[f], f);
  }
  return t.allocation < 2 ? rungs : allocateRd(t, bytes);
}

// ISO/IEC 10918-1, table K.1: what IJG's scale multiplies; the order does not matter here.
const lumaQuantisers = [
  16, 11, 10, 16, 24, 40, 51, 61, 12, 12, 14, 19, 26, 58, 60, 55, 14, 13, 16, 24, 40, 57, 69, 56, 14, 17, 22, 29, 51,
  87, 80, 62, 18, 22, 37, 56, 68, 109, 103, 77, 24, 35, 55, 64, 81, 104, 113, 92, 49, 64, 78, 87, 103, 121, 120, 101,
  72, 92, 95, 98, 112, 100, 103, 99,
];

/** Log of the mean of 1 / (step + 1): how fine a whole quality quantises. Strictly rising. */
function finenessAt(quality: number): number {
  const percent = quality < 50 ? Math.trunc(5000 / quality) : 200 - 2 * quality;
  let sum = 0;
  for (const q of lumaQuantisers) sum += 1 / (clamp(Math.trunc((q * percent + 50) / 100), 1, 255) + 1);
  return log(sum / 64);
}
function fineness(quality: number): number {
  const q = clamp(quality, 1, 100);
  const below = Math.trunc(q);
  const low = finenessAt(below);
  const part = q - below;
  return part > 0 ? low + part * (finenessAt(below + 1) - low) : low;
}

/** Slope of the monotone cubic (Fritsch and Butland 1984) at an inner knot. */
function knotSlope(widthBefore: number, secantBefore: number, widthAfter: number, secantAfter: number): number {
  if (secantBefore * secantAfter <= 0) return 0;
  const a = 2 * widthAfter + widthBefore;
  const b = widthAfter + 2 * widthBefore;
  return (a + b) / (a / secantBefore + b / secantAfter);
}

/** Value at `at` between the knots k and k + 1. */
function hermite(x: number[], y: number[], k: number, at: number): number {
  const secant = (i: number): number => (y[i + 1] - y[i]) / (x[i + 1] - x[i]);
  const slope = (i: number): number => {
    if (i === 0) return secant(0);
    if (i + 1 === x.length) return secant(i - 1);
    return knotSlope(x[i] - x[i - 1], secant(i - 1), x[i + 1] - x[i], secant(i));
  };
  const h = x[k + 1] - x[k];
  const t = (at - x[k]) / h;
  return (
    y[k] * ((1 + 2 * t) * (1 - t) * (1 - t)) +
    h * slope(k) * (t * (1 - t) * (1 - t)) +
    y[k + 1] * (t * t * (3 - 2 * t)) +
    h * slope(k + 1) * (t * t * (t - 1))
  );
}

/** Where a quality lies on the plane's axis: its fineness at rungs and without knots. */
function axisAt(t: PlaneTables, quality: number): number {
  const above = t.rungQuality.findIndex((q) => q > quality);
  if (t.knotQuality.length === 0 || above <= 0) return fineness(quality);
  let [a, b, aPosition, bPosition] = [t.rungQuality[above - 1], t.rungQuality[above], 0, 1];
  const low = fineness(a);
  const high = fineness(b);
  t.knotQuality.forEach((q, k) => {
    if (q > a && q <= quality) [a, aPosition] = [q, t.knotPosition[k]];
    if (q < b && q > quality) [b, bPosition] = [q, t.knotPosition[k]];
  });
  const from = fineness(a);
  const part = (fineness(quality) - from) / (fineness(b) - from);
  return low + (aPosition + part * (bPosition - aPosition)) * (high - low);
}

/** Bytes that a fragment would have at a quality that no rung has; exact at rungs, 0 when it is not stored. */
export function interpolatedBytes(t: PlaneTables, fragment: number, quality: number): number {
  const x: number[] = [];
  const y: number[] = [];
  for (let r = 0; r < rungCount(t); ++r) {
    const bytes = bytesToShow(t, r, fragment);
    if (bytes <= 0) continue;
    if (quality === t.rungQuality[r]) return bytes;
    x.push(fineness(t.rungQuality[r]));
    y.push(log(bytes));
  }
  if (x.length === 0) return 0;
  const at = axisAt(t, quality);
  if (at <= x[0]) return exp(y[0]);
  if (at >= x[x.length - 1]) return exp(y[y.length - 1]);
  let k = 0;
  while (x[k + 1] <= at) ++k;
  return exp(hermite(x, y, k, at));
}
