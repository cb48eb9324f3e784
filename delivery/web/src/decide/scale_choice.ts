import { farFromPlanned, fewerBytes, finerLeaves, finerPays, worthwhileFlip } from '../format/shared_numbers';
import { PackageData } from '../format/tables';
import { FragmentList, lossesOf } from './fragment_list';
import { type BytesOf, planesWithin } from './gpu_memory';
import { scaleBytes } from './gpu_size';
import type { TimePlanOptions } from './harmonic_time';
import { geometryFlip } from './prediction';
import { groupBytes, groupedList } from './request_groups';
import { Simulated, simulate } from './simulation';
import { TextureSpending, budgetSteps, spendOn } from './texture_budget';
import { PlaneChoice, TextureLoss, pictureFlip, textureFlip } from './texture_loss';

/** A scale and textures as they can be had in a time. */
export interface InTime extends Simulated {
  scale: number;
  planes: PlaneChoice[];
  list: FragmentList;
  /** Predicted FLIP of the lit picture: 0 = equal to S_0 with the source's texels, 1 = the most. */
  flip: number;
  /** What it would be of S_0 with these textures. */
  textureFlip: number;
  /** Seconds of the time that are left after the mesh; none where it comes too late. */
  leftS: number;
}
/** Display, scales and link that a choice is made for. */
export interface InTimeRequest {
  displayedPx: number;
  /** The scale that is enough. */
  wanted: number;
  /** The finest that takes its place where time is left and the picture is much better; left out: none. */
  finest?: number;
  /** Only this one. */
  only?: boolean;
  connections: number;
  /** GPU memory for mesh and textures; left out: any. */
  memoryBytes?: number;
  /** Ways to store texels, the best first; left out: RGBA. */
  ways?: readonly BytesOf[];
  /** The plan of what comes after a scale's mesh (limit <= 0: no time is left), and its link. */
  afterMesh(scale: number): { plan: TimePlanOptions; linkBytesS: number };
  /** Chooses what bytes are spent on in the place of rate and distortion. */
  textures?: (loss: TextureLoss, scale: number,
    bytes: number) => { planes: PlaneChoice[]; list: FragmentList };
}

/** FLIP of the picture where all that was planned comes. */
interface Planned {
  planned: number;
}

/** Memory for the textures beside a scale. */
function texturesWithin({ data: { manifest } }: TextureLoss, { memoryBytes = Infinity }: InTimeRequest,
    scale: number): number {
  const mesh = manifest.scales.find((s) => s.scale === scale);
  return memoryBytes - (mesh ? scaleBytes(mesh) : 0);
}

/** Textures for so many bytes beside one scale, and what comes of them in the time. */
function* texturesFor(loss: TextureLoss, request: InTimeRequest, scale: number, bytes: number,
    { plan, linkBytesS }: ReturnType<InTimeRequest['afterMesh']>): Generator<void, InTime & Planned> {
  const { timeLimitS, initialBytesS, rttS } = plan;
  const { textures } = request;
  let planned = 1;
  let spent: Pick<TextureSpending, 'list' | 'planes'> | undefined = textures?.(loss, scale, bytes);
  if (!spent) {
    let best: TextureSpending;
    for (best of budgetSteps(loss, { scale }, Math.floor(bytes))) yield;
    const { planes, list: { groupWeights } } = best!;
    const within = planesWithin(loss, planes, texturesWithin(loss, request, scale), request.ways);
    if (within.some(({ plane }, i) => plane !== planes[i].plane))
      best = spendOn(loss, within, { scale, groupWeights }, Math.floor(bytes));
    planned = (spent = best!).flip;
  }
  const { list, planes } = spent;
  // In groups, as loads ask for them.
  const { offers, groups } = groupedList(list, textures ? 0 : groupBytes(initialBytesS, rttS, timeLimitS),
    initialBytesS * timeLimitS);
  const played = simulate(offers, plan, { bytesS: linkBytesS, rttS, connections: request.connections });
  const rungs = played.rungs.flatMap((rung, i) => groups[i].map(() => rung));
  yield;
  const losses = lossesOf(list, rungs);
  const { data: { quality }, displayedPx } = loss;
  return { ...played, scale, planes, list, flip: pictureFlip(quality, displayedPx, scale, losses),
    textureFlip: textureFlip(quality, losses), leftS: timeLimitS, rungs, planned };
}
/** Textures beside one scale; the generator gives the page a turn between its steps. */
function* texturesInTime(loss: TextureLoss, request: InTimeRequest, scale: number): Generator<void, InTime> {
  const link = request.afterMesh(scale);
  const bytes = Math.max(0, link.plan.timeLimitS) * link.plan.initialBytesS;
  const first = yield* texturesFor(loss, request, scale, bytes, link);
  // A transfer spends bytes less well than a plan that knows them: then fewer texels look better in the time.
  if (first.flip <= farFromPlanned * first.planned) return first;
  const again = yield* texturesFor(loss, request, scale, fewerBytes * bytes, link);
  return again.flip < first.flip ? again : first;
}

/**
 * The scale of finest .. end - 1 that looks best in the time, if it looks better than `enough` does: than a
 * scale that is enough for the display by much.
 */
function* betterScale(loss: TextureLoss, request: InTimeRequest, finest: number, end: number,
    enough?: InTime): Generator<void, InTime | undefined> {
  const { data: { manifest, quality }, displayedPx } = loss;
  const leastLeftS = enough ? finerLeaves * enough.leftS : 0;
  let best = enough;
  for (const { scale } of manifest.scales) {
    if (scale < finest || scale >= end) continue;
    // A mesh that comes too late is no picture in the time.
    const most: number = !best || best.leftS <= 0 ? Infinity
      : best === enough ? finerPays * best.flip : best.flip - worthwhileFlip;
    // With the source's texels.
    if (geometryFlip(quality, displayedPx, scale) >= most) continue;
    const now = yield* texturesInTime(loss, request, scale);
    if (most === Infinity || (now.flip < most && now.leftS > 0 && now.leftS >= leastLeftS)) best = now;
  }
  return best;
}

/**
 * The scale that is enough, or a coarser one where a simulation of both shows a better picture in the time or
 * where the mesh comes too late, or a finer one where time is left; with the textures that go with it:
 * delivery/cpp/client/delivery_plan.h. A generator, so that a page can breathe between its steps. undefined:
 * the package has no such scale.
 */
export function* choiceInTime(data: PackageData,
    request: InTimeRequest): Generator<void, InTime | undefined> {
  const { wanted, only, finest = wanted } = request;
  const loss = new TextureLoss(data, request.displayedPx);
  const best = yield* betterScale(loss, request, wanted, only ? wanted + 1 : Infinity);
  // Where textures are not all that is off.
  return !only && best?.scale === wanted && best.leftS > 0 && best.textureFlip < finerPays * best.flip
    ? yield* betterScale(loss, request, finest, wanted, best) : best;
}

/** FLIP of a scale beside S_0 at which refining takes no finer one. */
const refinedFlip = 0.01;

/**
 * What passes for S_0 still differs from it: from `finest` on the coarsest scale that hardly does, else
 * `finest`.
 */
export function refinedScale({ manifest: { scales }, quality }: PackageData, displayedPx: number,
    finest: number): number {
  const alike = scales.filter(
    ({ scale }) => scale >= finest && geometryFlip(quality, displayedPx, scale) <= refinedFlip);
  return alike.at(-1)?.scale ?? finest;
}
