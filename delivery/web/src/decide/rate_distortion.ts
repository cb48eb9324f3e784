import { PlaneTables, bytesToShow, fragmentCount, rungCount } from '../format/tables';
import { positive, sumOf } from './numbers';

// How a budget of bytes is best spent: format/rules/rate_distortion.cpp, bit for bit.

/**
 * Weight of a fragment's quality: its surface fraction, with the area per texel capped at the 99th percentile of
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
    const curve: RdCurve = { bytes: [0], loss: [loss(t.skipDssim[f])] };
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
