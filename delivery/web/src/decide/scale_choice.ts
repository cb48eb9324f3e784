import { PackageData } from '../format/package_data';
import type { QualityTable } from '../format/quality_table';
import { FragmentList, PlaneChoice, TextureSpending, budgetSteps, mipLoss, planesForDisplay } from './fragment_list';
import type { TimePlanOptions } from './plan_types';
import { equivalentQuality, predictedSsim } from './prediction';
import { Simulated, simulate } from './simulation';

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

/** A scale and textures as they can be had in a time. */
export interface InTime extends Simulated {
  scale: number;
  planes: PlaneChoice[];
  list: FragmentList;
  /** 1 - SSIM of the textures as displayed, and the picture's predicted SSIM. */
  textureDssim: number;
  ssim: number;
  /** No time is left after the mesh. */
  late: boolean;
}
/** Display, scales and link that a choice is made for. */
export interface InTimeRequest {
  displayedPx: number;
  /** The finest scale that is worth showing. */
  wanted: number;
  /** Only this one. */
  only?: boolean;
  connections: number;
  /** When a scale's mesh is chosen: the plan of what comes after it (limit <= 0: no time is left), and the link that is supposed. */
  afterMesh(scale: number): { plan: TimePlanOptions; linkBytesS: number };
}

/** Textures beside one scale; the generator gives the page a turn between its steps. */
function* texturesInTime(data: PackageData, quality: QualityTable, request: InTimeRequest, scale: number): Generator<void, InTime> {
  const { displayedPx, connections } = request;
  const { plan, linkBytesS } = request.afterMesh(scale);
  const { timeLimitS, initialBytesS, rttS } = plan;
  const budget = Math.floor(Math.max(0, timeLimitS) * initialBytesS);
  let spent: TextureSpending | undefined;
  for (spent of budgetSteps(data, displayedPx, { scale }, budget)) yield;
  const { list, planes } = spent!;
  const played = simulate(list.offers, plan, { bytesS: linkBytesS, rttS, connections });
  yield;
  const shown = list.totalWeight > 0 ? (played.loss + list.previewLoss) / list.totalWeight : 0;
  const textureDssim = 1 - (1 - shown) * (1 - mipLoss(data, planes, displayedPx));
  const ssim = predictedSsim(quality, scale, equivalentQuality(data, planesForDisplay(data, displayedPx), textureDssim));
  return { scale, planes, list, textureDssim, ssim, late: timeLimitS <= 0, ...played };
}

/**
 * The wanted scale, or a coarser one where a simulation of both shows a better picture in the time or where the wanted mesh
 * comes too late; with the textures that go with it: delivery/cpp/client/delivery_plan.h. A generator, so that a page can breathe between its steps. undefined:
 * the package has no such scale.
 */
export function* choiceInTime(data: PackageData, quality: QualityTable, request: InTimeRequest): Generator<void, InTime | undefined> {
  let best: InTime | undefined;
  for (const { scale } of data.manifest.scales) {
    if (scale < request.wanted || (request.only && scale !== request.wanted)) continue;
    // A mesh that comes too late is no picture in the time.
    const least: number = !best || best.late ? -1 : best.ssim + worthwhile;
    // With textures as good as the table knows them.
    if (!quality.rungs.some((q) => predictedSsim(quality, scale, q) > least)) continue;
    const now = yield* texturesInTime(data, quality, request, scale);
    if (now.ssim > least) best = now;
  }
  return best;
}
