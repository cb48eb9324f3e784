import { PackageData } from '../format/package_data';
import type { QualityTable } from '../format/quality_table';
import { fragmentCount } from '../format/tables';
import { logQuantiser } from './allocation';
import { PlaneChoice, roleWeight } from './fragment_list';
import { clamp } from './numbers';
import { surfaceWeights } from './rate_distortion';

const belowLowest = 2; // the line through the two lowest rungs goes on for so many of their steps

/** On a line through the values at the two points of a rising axis around `at`; `least` of their distance below the first. */
function interpolated(axis: readonly number[], at: number, least: number, value: (i: number) => number): number {
  let i = 0;
  while (i + 2 < axis.length && axis[i + 1] < at) ++i;
  const next = Math.min(i + 1, axis.length - 1);
  const part = next > i ? clamp((at - axis[i]) / (axis[next] - axis[i]), least, 1) : 0;
  return (1 - part) * value(i) + part * value(next);
}

/**
 * SSIM of the rendered object for a scale and a mean quality of its textures: bilinear in the package's measured table
 * (scale number, log-quantiser of the quality), and below its lowest quality on the same line.
 */
export function predictedSsim({ scales, rungs, ssim }: QualityTable, scale: number, quality: number): number {
  const axis = rungs.map(logQuantiser);
  const ofScale = (s: number): number =>
    // Textures of which little more than a preview has come are worse than the lowest rung.
    interpolated(axis, logQuantiser(quality), -belowLowest, (r) => ssim[s * rungs.length + r]);
  return Math.max(0, interpolated(scales, scale, 0, ofScale));
}

/**
 * The uniform quality whose textures lose as much as these do: by interpolation over the uniform rungs' losses, of those planes whose role
 * weighs most, base colours where there are some.
 */
export function equivalentQuality(data: PackageData, planes: readonly PlaneChoice[], textureDssim: number): number {
  const weightOf = ({ plane }: PlaneChoice): number => roleWeight(data.textures[plane].role);
  const heaviest = Math.max(...planes.map(weightOf));
  let weight = 0;
  let rungs: number[] = [];
  let losses: number[] = [];
  for (const choice of planes) {
    const t = data.tables[choice.plane];
    if (!t || weightOf(choice) < heaviest) continue;
    if (rungs.length === 0) {
      rungs = [...t.rungQuality];
      losses = rungs.map(() => 0);
    }
    if (t.rungQuality.length !== rungs.length) continue;
    const weights = surfaceWeights(t);
    for (const f of t.order) {
      weight += weights[f];
      rungs.forEach((_, r) => (losses[r] += Math.fround(weights[f] * t.dssim[r * fragmentCount(t) + f]))); // a product of floats there
    }
  }
  if (!(weight > 0)) return 100;
  const [first, ...curve] = losses.map((loss, r) => ({ quality: rungs[r], loss: loss / weight }));
  if (textureDssim >= first.loss) return Math.max(1, (first.quality * first.loss) / Math.max(textureDssim, 1e-9));
  let above = first;
  for (const at of curve) {
    const span = above.loss - at.loss;
    if (textureDssim >= at.loss) return above.quality + (span > 0 ? (above.loss - textureDssim) / span : 1) * (at.quality - above.quality);
    above = at;
  }
  return above.quality;
}
