import {
  leastWeight, lossUnit, reweightings, worthwhileFinerFlip, worthwhilePart,
} from '../format/shared_numbers';
import type { QualityTable } from '../format/quality_table';
import { FragmentList, ListOptions, fragmentList, lossesOf } from './fragment_list';
import { pow } from './portable_math';
import { spendBytes } from './rate_distortion';
import { PerGroup, PlaneChoice, TextureLoss, everyGroup, pictureFlip,
  planesForDisplay } from './texture_loss';

// delivery/cpp/decide/texture_budget.cpp, bit for bit.

/** How bytes are best spent on textures. */
export interface TextureSpending {
  planes: PlaneChoice[];
  list: FragmentList;
  /** Rungs by offer; -1 = skipped. */
  rungs: number[];
  /** Of each group by itself. */
  losses: PerGroup;
  /** Of the picture with the scale. */
  flip: number;
}
/** Options that have to be said. */
export type SpendingOptions = Partial<ListOptions> & Pick<ListOptions, 'scale'>;

/** Spends the bytes on these planes. */
export function spendOn(loss: TextureLoss, planes: PlaneChoice[], options: SpendingOptions,
    budget: number): TextureSpending {
  const { data, displayedPx } = loss;
  const list = fragmentList(data, planes, { ...options, displayedPx }, loss);
  const curves =
    list.offers.map((f) => ({ bytes: [0, ...f.bytes], loss: f.loss.map((l) => Math.floor(l * lossUnit)) }));
  const rungs = spendBytes(curves, budget).map((way) => way - 1);
  const losses = lossesOf(list, rungs);
  return { planes, list, rungs, losses, flip: pictureFlip(data.quality, displayedPx, options.scale, losses) };
}

/** The slopes of the predicted FLIP by the groups' losses. */
function slopesOf({ exponent }: QualityTable, { flip, losses }: TextureSpending): PerGroup {
  if (!(flip > 0)) return everyGroup(1);
  return losses.map((loss) =>
    Math.max(leastWeight, pow(Math.max(loss / flip, 1e-9), exponent - 1))) as unknown as PerGroup;
}

/**
 * The best textures for so many bytes of fragments, step by step, so that a page can breathe; the last value
 * is the result. Planes may be coarser than the display asks for, so that few bytes are not spread over too
 * many texels, or finer, so that bytes that are left are not lost. Fragments share the bytes by rate and
 * distortion. What counts is the FLIP that is predicted of the picture. Needs the tables of all planes.
 */
export function* budgetSteps(loss: TextureLoss, options: SpendingOptions,
    bytes: number): Generator<TextureSpending> {
  const { data, displayedPx } = loss;
  const tried = new Set<string>();
  /** undefined: these planes were tried. Levels beyond the ladder's ends stand for the same planes. */
  const spend = (levels: PerGroup): TextureSpending | undefined => {
    const planes = planesForDisplay(data, displayedPx, levels);
    const name = `${planes.map((p) => p.plane)}`;
    if (tried.has(name)) return undefined;
    tried.add(name);
    return spendOn(loss, planes, options, bytes);
  };
  let from: PerGroup | undefined = everyGroup(0);
  let best = spend(from)!;
  // One level coarser, of all groups together, then of each; then one level finer.
  const steps = [1, -1].flatMap((by) => [[by, by, by], [by, 0, 0], [0, by, 0], [0, 0, by]]);
  while (from) {
    // Downhill.
    const at: PerGroup = from;
    from = undefined;
    let withoutFiner = best.flip;
    for (const step of steps) {
      const to = at.map((level, g) => level + step[g]) as unknown as PerGroup;
      yield best;
      const now = spend(to);
      // Finer planes take memory: they have to look better, not only as good, but not by so much each.
      const finer = step.includes(-1);
      const least = Math.min(worthwhileFinerFlip, worthwhilePart * withoutFiner);
      if (!now || now.flip >= best.flip || (finer && now.flip >= withoutFiner - least)) continue;
      best = now;
      if (!finer) withoutFiner = now.flip;
      from = to;
    }
  }
  for (let i = 0; i < reweightings && data.quality.exponent > 1; ++i) {
    yield best;
    const now = spendOn(loss, best.planes, { ...options, groupWeights: slopesOf(data.quality, best) }, bytes);
    if (now.flip >= best.flip) break;
    best = now;
  }
  yield best;
}
