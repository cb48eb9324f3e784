import { InputError } from '../format/errors';
import { type PackageData, bytesToShow, fragmentCount } from '../format/tables';
import { etaOf, meanEta, qualityOf } from './allocation';
import { FragmentOffer } from './harmonic_time';
import { interpolatedBytes } from './size_curve';
import { PerGroup, PlaneChoice, TextureLoss, everyGroup, groupIndex, tablesOf } from './texture_loss';

/** Plane and fragment of an offer of the list. */
export interface ListedFragment {
  plane: number;
  fragment: number;
}
/**
 * The F-list of a package at a scale: the stored fragments of all chosen planes in one list (thesis ch. 4). A
 * fragment's losses are its part of what its group of planes loses in lit pictures, times the group's weight.
 */
export interface FragmentList {
  offers: FragmentOffer[];
  /** Places by offer. */
  fragments: ListedFragment[];
  /** Number of the group by offer. */
  groups: number[];
  groupWeights: PerGroup;
  /** Loss of fragments that are not in the list because no rung shows more than the preview; unweighted. */
  previewLoss: PerGroup;
}
/** Options of fragmentList. */
export interface ListOptions {
  scale: number;
  /** Height of the object, > 0. */
  displayedPx: number;
  /** Gamma of q_i(x, y); -1 = the mean of eta. */
  gamma: number;
  qualityLow: number;
  qualityHigh: number;
  /** What a group's losses weigh beside the others', > 0. */
  groupWeights: PerGroup;
  /** Chapter 4's list as printed (policy thesis), of all fragments ordered by feature density alone. */
  printed?: (data: PackageData, list: FragmentList, options: ListOptions) => void;
}
/** S_0 at 1000 px, the mean of eta, the qualities of delivery/cpp. */
export const defaultListOptions: ListOptions = { scale: 0, displayedPx: 1000, gamma: -1, qualityLow: 5,
  qualityHigh: 100, groupWeights: everyGroup(1) };

/** `surface`: of the plane's group. */
function addPlane(loss: TextureLoss, plane: number, surface: number, options: ListOptions, list: FragmentList,
    previewLoss: number[]): void {
  const { data } = loss;
  const t = tablesOf(data, plane);
  const group = groupIndex(data, plane);
  const { weights, shown: losses } = loss.plane(plane);
  const row = data.manifest.scales.findIndex((s) => s.scale === options.scale);
  if (row < 0) throw new InputError('', `scale ${options.scale}`, 'a scale of the package', 'none');
  const eta = etaOf(t, row);
  const quality = qualityOf(t, row, options.gamma < 0 ? meanEta(t, row) : options.gamma);
  const { printed } = options;
  // Rungs whose quality is within the limits, as near as there are any.
  const rungs = [...t.rungQuality.keys()];
  const highRung = Math.max(t.rungQuality.filter((q) => q <= options.qualityHigh).length - 1, 0);
  const lowRung = Math.min(t.rungQuality.filter((q) => q < options.qualityLow).length, rungs.length - 1,
    highRung);
  for (const f of t.order) {
    const bytes = rungs.map((r) => bytesToShow(t, r, f));
    if (!bytes.every((b) => b > 0 && b <= 0xffffffff)) continue;
    const share = weights[f] / surface;
    const shown = [losses[f], ...rungs.map((r) => losses[(r + 1) * fragmentCount(t) + f])];
    if (!printed && !shown.some((c) => c < shown[0])) {
      previewLoss[group] += share * shown[0];
      continue;
    }
    const weighted = shown.map((c) => options.groupWeights[group] * share * c);
    list.fragments.push({ plane, fragment: f });
    list.groups.push(group);
    const plannedBytes = Math.max(1, interpolatedBytes(t, f, quality[f]));
    list.offers.push({ bytes, loss: weighted,
      eta: eta[f] * (printed ? 1 : weighted[0] - Math.min(...weighted)), plannedBytes, lowRung, highRung });
  }
}

/**
 * Ordered by plane and importance; offers carry feature density times what showing the fragment saves in lit
 * pictures. Needs the planes' tables, and those of the full-size planes. `loss` is for the options' displayed
 * height.
 */
export function fragmentList(data: PackageData, planes: readonly PlaneChoice[],
    options: Partial<ListOptions> = {},
    loss = new TextureLoss(data, options.displayedPx ?? defaultListOptions.displayedPx)): FragmentList {
  const all = { ...defaultListOptions, ...options };
  const previewLoss: [number, number, number] = [0, 0, 0];
  const list: FragmentList = { offers: [], fragments: [], groups: [], groupWeights: all.groupWeights,
    previewLoss };
  const weights = loss.weights(planes);
  // A group without any surface loses nothing, whatever its rungs.
  for (const { plane } of planes)
    addPlane(loss, plane, weights[groupIndex(data, plane)] || 1, all, list, previewLoss);
  all.printed?.(data, list, all);
  return list;
}

/** Loss of each group where the offers have these rungs; -1 = skipped. */
export function lossesOf({ offers, groups, groupWeights, previewLoss }: FragmentList,
    rungs: ArrayLike<number>): PerGroup {
  const weighted = [0, 0, 0];
  offers.forEach(({ loss }, i) => (weighted[groups[i]] += loss[rungs[i] + 1]));
  return previewLoss.map((loss, g) => loss + weighted[g] / groupWeights[g]) as unknown as PerGroup;
}
