import type { PlaneTables } from '../format/tables';
import { positive, sumOf } from './numbers';

// How a budget of bytes is best spent: format/rules/allocation.cpp, bit for bit.

/** [F] Weights of quality: surface fraction, with area per texel capped at its 99th percentile. */
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
        if (more > 0 && (slope > best.slope || (slope === best.slope && more > best.bytes)))
          best = { slope, curve, way, bytes: more };
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
