import { FragmentList, PackageData, PlaneChoice } from './fragment_list';
import { equivalentQuality, predictedSsim } from './prediction';
import type { QualityTable } from './quality_table';

/** A coarser scale has to look better by this much of SSIM. */
const worthwhile = 1e-4;

/** A finer scale that gains less of SSIM, rendered and compared with the source, is not worth its bytes. */
const seenSsim = 0.004;

/**
 * From a scale that the step function finds good enough to a finer one, as long as the package's measured table says
 * that each is seen to be better: the rules speak of distances, and shading tells more. The table holds for objects
 * that are displayed at least as high as its pictures.
 */
export function finerWhereSeen(table: QualityTable, scale: number, displayedPx: number): number {
  const best = (i: number): number => table.ssim[(i + 1) * table.rungs.length - 1];
  let i = table.scales.indexOf(scale);
  if (i < 0 || displayedPx < table.sizePx) return scale;
  while (i > 0 && best(i - 1) - best(i) >= seenSsim) --i;
  return table.scales[i];
}

/** What the textures lose when so many bytes are spent in proportion to the planned sizes. */
function lossFor(list: FragmentList, bytes: number): number {
  let planned = 0;
  for (const o of list.offers) planned += o.plannedBytes;
  const factor = Math.max(0, bytes) / Math.max(planned, 1);
  let loss = 0;
  for (const o of list.offers) {
    const target = o.plannedBytes * factor;
    let best = 0;
    let distance = target;
    o.bytes.forEach((b, r) => {
      if (Math.abs(target - b) >= distance) return;
      distance = Math.abs(target - b);
      best = r + 1;
    });
    loss += o.loss[best];
  }
  return list.totalWeight > 0 ? loss / list.totalWeight : 0;
}

/**
 * The wanted scale, or a coarser one whose smaller mesh leaves more for the texture and looks better in the time: the
 * measured table's SSIM for the scale and the quality of textures that `textureBytes` buy.
 */
export function chooseScale(
  data: PackageData,
  quality: QualityTable,
  list: FragmentList,
  planes: readonly PlaneChoice[],
  wanted: number,
  textureBytes: (scale: number) => number,
): number {
  let best = wanted;
  let bestSsim = -1;
  for (const { scale } of data.manifest.scales) {
    if (scale < wanted) continue;
    const bytes = textureBytes(scale);
    const coarsest = scale === data.manifest.scales[data.manifest.scales.length - 1].scale;
    if (bytes < 0 && !coarsest) continue; // not even the mesh comes in time
    const ssim = predictedSsim(quality, scale, equivalentQuality(data, planes, lossFor(list, bytes)));
    if (bestSsim < 0 || ssim > bestSsim + worthwhile) {
      best = scale;
      bestSsim = ssim;
    }
  }
  return best;
}
