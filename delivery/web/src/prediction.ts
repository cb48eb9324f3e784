import { logQuantiser, surfaceWeights } from './allocation';
import { PackageData, PlaneChoice, roleWeight } from './fragment_list';
import type { QualityTable } from './quality_table';
import { fragmentCount, rungCount } from './tables';

const belowLowest = 2; // the line through the two lowest rungs goes on for so many of their steps

/** Where `at` lies between the values of an axis: index and fraction to the next. */
function place(values: readonly number[], at: number, least: number, axis: (v: number) => number): [number, number] {
  let i = 0;
  while (i + 2 < values.length && axis(values[i + 1]) < at) ++i;
  const a = axis(values[i]);
  const b = axis(values[Math.min(i + 1, values.length - 1)]);
  return [i, b > a ? Math.min(Math.max((at - a) / (b - a), least), 1) : 0];
}

/**
 * SSIM of the rendered object for a scale and a mean quality of its textures: bilinear in the package's measured table
 * (scale number, log-quantiser of the quality), and below its lowest quality on the same line.
 */
export function predictedSsim(table: QualityTable, scale: number, quality: number): number {
  if (table.scales.length === 0 || table.rungs.length === 0) return 0;
  const [s, u] = place(table.scales, scale, 0, (v) => v);
  // Textures of which little more than a preview has come are worse than the lowest rung.
  const [r, v] = place(table.rungs, logQuantiser(Math.min(Math.max(quality, 1), 100)), -belowLowest, logQuantiser);
  const s1 = Math.min(s + 1, table.scales.length - 1);
  const r1 = Math.min(r + 1, table.rungs.length - 1);
  const at = (i: number, j: number): number => table.ssim[i * table.rungs.length + j];
  const ssim = (1 - u) * ((1 - v) * at(s, r) + v * at(s, r1)) + u * ((1 - v) * at(s1, r) + v * at(s1, r1));
  return Math.max(0, ssim);
}

/** The uniform quality whose textures lose as much as these do: by interpolation over the uniform rungs' losses. */
export function equivalentQuality(data: PackageData, planes: readonly PlaneChoice[], textureDssim: number): number {
  let weight = 0;
  let quality: number[] = [];
  let loss: number[] = [];
  for (const p of planes) {
    const t = data.tables[p.plane];
    if (!t || roleWeight(data.textures[p.plane].role) < 1) continue;
    if (quality.length === 0) {
      quality = Array.from(t.rungQuality);
      loss = quality.map(() => 0);
    }
    if (rungCount(t) !== quality.length) continue;
    const weights = surfaceWeights(t);
    for (const f of t.order) {
      weight += weights[f];
      for (let r = 0; r < quality.length; ++r) loss[r] += Math.fround(weights[f] * t.dssim[r * fragmentCount(t) + f]); // a product of floats there
    }
  }
  if (quality.length === 0 || !(weight > 0)) return 100;
  const curve = quality.map((q, r): [number, number] => [q, loss[r] / weight]);
  if (textureDssim >= curve[0][1]) return Math.max(1, (curve[0][0] * curve[0][1]) / Math.max(textureDssim, 1e-9));
  for (let r = 1; r < curve.length; ++r) {
    if (textureDssim < curve[r][1]) continue;
    const span = curve[r - 1][1] - curve[r][1];
    const u = span > 0 ? (curve[r - 1][1] - textureDssim) / span : 1;
    return curve[r - 1][0] + u * (curve[r][0] - curve[r - 1][0]);
  }
  return curve[curve.length - 1][0];
}
