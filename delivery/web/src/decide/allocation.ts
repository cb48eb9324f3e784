import { clamp, sumOf } from './numbers';
import { exp, log } from './portable_math';
import { PlaneTables, fragmentCount, rungCount } from '../format/tables';

// From feature counts to the quality that a fragment is asked to have (thesis 3.2-3.3), and what a budget is best
// spent on: the same as format/allocation.cpp, format/rate_distortion.cpp and format/size_curve.cpp, bit for bit.

/** Every index of a typed array with a value > 0. */
const positive = (values: Uint32Array): number[] => [...values.keys()].filter((i) => values[i] > 0);

/** What a client must have of a fragment to show it at a rung; 0 when it is not stored there. */
export function bytesToShow(t: PlaneTables, rung: number, fragment: number): number {
  const own = (r: number): number => t.sizeBytes[r * fragmentCount(t) + fragment];
  let bytes = own(rung);
  if (t.incremental && bytes > 0) for (let r = 0; r < rung; ++r) bytes += own(r);
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
  const covered = positive(t.coveredTexels);
  const features = (f: number): number => t.features[scale * fragmentCount(t) + f];
  const rising = covered.map(features).sort((a, b) => a - b);
  const [low, high] = [rising[0], rising[rising.length - 1]];
  const eta = new Float32Array(fragmentCount(t));
  if (high > low) for (const f of covered) eta[f] = (features(f) - low) / (high - low);
  return eta;
}

/** The default Gamma: mean of eta over covered fragments. */
export function meanEta(t: PlaneTables, scale: number): number {
  return sumOf(etaOf(t, scale)) / Math.max(positive(t.coveredTexels).length, 1);
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
export function surfaceWeights({ coveredTexels, surfaceFraction }: PlaneTables): Float32Array {
  const area = (f: number): number => surfaceFraction[f] / coveredTexels[f]; // per texel
  const covered = positive(coveredTexels).sort((a, b) => area(a) - area(b));
  const texels = sumOf(coveredTexels);
  let [below, cap] = [0, 0];
  for (const f of covered) {
    if (100 * below >= 99 * texels) break;
    below += coveredTexels[f];
    cap = area(f);
  }
  const weights = new Float32Array(coveredTexels.length);
  for (const f of covered) weights[f] = Math.min(area(f), cap) * coveredTexels[f];
  return weights;
}

/** One fragment as the rate-distortion choice sees it. Way 0 is skipping (0 bytes). */
export interface RdCurve {
  bytes: number[];
  /** Same length; whole numbers of at most 2^46. */
  loss: number[];
}

/** Per curve the way to show it, so that least is lost within the budget (section 8, Rate-distortion). */
export function spendBytes(curves: readonly RdCurve[], budgetBytes: number): number[] {
  const steps: { slope: number; curve: number; way: number; bytes: number }[] = [];
  // Along the lower convex hull of each curve from way 0; the slopes fall.
  curves.forEach(({ bytes, loss }, curve) => {
    for (let at = 0; ; ) {
      let best = { slope: 0, curve, way: 0, bytes: Infinity };
      bytes.forEach((all, way) => {
        const more = all - bytes[at];
        const slope = (loss[at] - loss[way]) / more;
        if (more > 0 && (slope > best.slope || (slope === best.slope && more > best.bytes))) best = { slope, curve, way, bytes: more };
      });
      if (best.way === 0) return;
      steps.push(best);
      at = best.way;
    }
  });
  const ways = curves.map(() => 0);
  const full = new Set<number>();
  for (const { curve, way, bytes } of steps.sort((a, b) => b.slope - a.slope)) {
    if (bytes > budgetBytes) full.add(curve);
    if (full.has(curve)) continue;
    budgetBytes -= bytes;
    ways[curve] = way;
  }
  return ways;
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

/** Log of the mean of 1 / (step + 1), by whole quality: how fine it quantises. Strictly rising. */
const finenessOfWhole = /* @__PURE__ */ Array.from({ length: 101 }, (_, quality) => {
  const percent = quality < 50 ? Math.trunc(5000 / quality) : 200 - 2 * quality;
  const step = (q: number): number => clamp(Math.trunc((q * percent + 50) / 100), 1, 255);
  return log(sumOf(lumaQuantisers.map((q) => 1 / (step(q) + 1))) / 64);
});
function fineness(quality: number): number {
  const q = clamp(quality, 1, 100);
  const below = Math.trunc(q);
  const low = finenessOfWhole[below];
  return q > below ? low + (q - below) * (finenessOfWhole[below + 1] - low) : low;
}

/** The monotone cubic (Fritsch and Butland 1984) through points, between the k-th and the next. */
function hermite(x: readonly number[], y: readonly number[], k: number, at: number): number {
  const width = (i: number): number => x[i + 1] - x[i];
  const secant = (i: number): number => (y[i + 1] - y[i]) / width(i);
  const slope = (i: number): number => {
    if (i === 0) return secant(0);
    if (i + 1 === x.length) return secant(i - 1);
    const [before, after] = [secant(i - 1), secant(i)];
    if (before * after <= 0) return 0;
    const a = 2 * width(i) + width(i - 1);
    const b = width(i) + 2 * width(i - 1);
    return (a + b) / (a / before + b / after);
  };
  const h = width(k);
  const t = (at - x[k]) / h;
  const rest = 1 - t;
  return (
    y[k] * ((1 + 2 * t) * rest * rest) +
    h * slope(k) * (t * rest * rest) +
    y[k + 1] * (t * t * (3 - 2 * t)) +
    h * slope(k + 1) * (t * t * (t - 1))
  );
}

/** Where a quality lies on the plane's axis: its fineness at rungs and without knots. */
function axisAt({ rungQuality, knotQuality, knotPosition }: PlaneTables, quality: number): number {
  const above = rungQuality.findIndex((q) => q > quality);
  if (knotQuality.length === 0 || above <= 0) return fineness(quality);
  const [first, last] = [rungQuality[above - 1], rungQuality[above]];
  let [from, to] = [{ q: first, at: 0 }, { q: last, at: 1 }];
  knotQuality.forEach((q, k) => {
    const knot = { q, at: knotPosition[k] };
    if (q > first && q <= quality) from = knot;
    if (q > quality && q < to.q) to = knot;
  });
  const start = fineness(from.q);
  const part = (fineness(quality) - start) / (fineness(to.q) - start);
  const low = fineness(first);
  return low + (from.at + part * (to.at - from.at)) * (fineness(last) - low);
}

/** Bytes that a fragment would have at a quality that no rung has; exact at rungs, 0 when it is not stored. */
export function interpolatedBytes(t: PlaneTables, fragment: number, quality: number): number {
  const stored = [...t.rungQuality].map((q, r) => ({ q, bytes: bytesToShow(t, r, fragment) })).filter(({ bytes }) => bytes > 0);
  const exact = stored.find(({ q }) => q === quality);
  if (exact || stored.length === 0) return exact?.bytes ?? 0;
  const x = stored.map(({ q }) => fineness(q));
  const y = stored.map(({ bytes }) => log(bytes));
  const at = clamp(axisAt(t, quality), x[0], x[x.length - 1]);
  let k = 0;
  while (k + 2 < x.length && x[k + 1] <= at) ++k;
  return exp(at > x[0] ? hermite(x, y, k, at) : y[0]);
}
