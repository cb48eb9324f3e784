import { InputError } from '../format/errors';
import { fullSizePlanes } from '../format/layout';
import type { Manifest } from '../format/manifest';
import type { PackageData } from '../format/package_data';
import { PlaneTables, bytesToShow, fragmentCount } from '../format/tables';
import { TextureInfo } from '../format/textures';
import { etaOf, meanEta, qualityOf } from './allocation';
import { clamp, sumOf } from './numbers';
import { FragmentOffer } from './plan_types';
import { log, pow } from './portable_math';
import { spendBytes, surfaceWeights } from './rate_distortion';
import { bytesAtRung } from './rung_choice';
import { interpolatedBytes } from './size_curve';

/** Which plane shows each texture: the full-size one or a mip of it. */
export interface PlaneChoice {
  base: number;
  plane: number;
}
/** Plane and fragment of an offer of the list. */
export interface ListedFragment {
  plane: number;
  fragment: number;
}
/** The F-list of a package at a scale: the stored fragments of all chosen planes in one list (thesis ch. 4). */
export interface FragmentList {
  offers: FragmentOffer[];
  /** Places by offer. */
  fragments: ListedFragment[];
  /** Sum of weights: a loss of so much is 1 - SSIM = 1 everywhere. */
  totalWeight: number;
  /** Loss of fragments that are not in the list because no rung shows more than the preview. */
  previewLoss: number;
}
/** Options of fragmentList. */
export interface ListOptions {
  scale: number;
  /** Gamma of q_i(x, y); -1 = the mean of eta. */
  gamma: number;
  qualityLow: number;
  qualityHigh: number;
}
/** S_0, the mean of eta, the qualities of delivery/cpp. */
export const defaultListOptions: ListOptions = { scale: 0, gamma: -1, qualityLow: 5, qualityHigh: 97 };

const ln2 = 0.693147180559945309417;
const mipExponent = 1.45;
/** Levels below the display's that are tried. */
const mostCoarser = 4;
/** Losses as spendBytes counts them. */
const lossUnit = 2 ** 40;

/** Weight of a role in the list and in losses. */
export function roleWeight(role: string): number {
  if (role === 'base-colour') return 1;
  if (role === 'emissive') return 0.7;
  return role === 'normal' || role === 'alpha' ? 0.5 : 0.3;
}

function tablesOf(data: PackageData, plane: number): PlaneTables {
  const t = data.tables[plane];
  if (!t) throw new InputError('', `texture plane ${plane}`, 'a plane whose tables were read', 'another');
  return t;
}

/** Loss where the preview stands for a fragment. */
const skippedLoss = (t: PlaneTables, fragment: number): number => t.skipDssim[fragment] ?? 1;

function addPlane(data: PackageData, plane: number, options: ListOptions, list: FragmentList): void {
  const t = tablesOf(data, plane);
  const role = roleWeight(data.textures[plane].role);
  const scale = clamp(options.scale, 0, t.scales);
  const eta = etaOf(t, scale);
  const weights = surfaceWeights(t);
  const quality = qualityOf(t, scale, options.gamma < 0 ? meanEta(t, scale) : options.gamma);
  // Rungs whose quality is within the limits, as near as there are any.
  const rungs = [...t.rungQuality.keys()];
  const highRung = Math.max(t.rungQuality.filter((q) => q <= options.qualityHigh).length - 1, 0);
  const lowRung = Math.min(t.rungQuality.filter((q) => q < options.qualityLow).length, rungs.length - 1, highRung);
  for (const f of t.order) {
    const weight = role * weights[f];
    const bytes = rungs.map((r) => bytesToShow(t, r, f));
    const dssim = [skippedLoss(t, f), ...rungs.map((r) => t.dssim[r * fragmentCount(t) + f])];
    const loss = dssim.map((d) => weight * d);
    if (!bytes.every((b) => b > 0 && b <= 0xffffffff)) continue;
    list.totalWeight += weight;
    if (!dssim.some((d) => d < dssim[0])) {
      list.previewLoss += loss[0];
      continue;
    }
    list.fragments.push({ plane, fragment: f });
    list.offers.push({ bytes, loss, eta: eta[f] * weight, plannedBytes: Math.max(1, interpolatedBytes(t, f, quality[f])), lowRung, highRung });
  }
}

/**
 * Ordered by plane and importance; offers carry eta x weight of the role x share of the surface. Needs the planes' tables.
 */
export function fragmentList(
  data: PackageData,
  planes: readonly PlaneChoice[],
  options: Partial<ListOptions> = {},
): FragmentList {
  const list: FragmentList = { offers: [], fragments: [], totalWeight: 0, previewLoss: 0 };
  for (const p of planes) addPlane(data, p.plane, { ...defaultListOptions, ...options }, list);
  return list;
}

/** Every texture at full size. */
export function fullSize(textures: readonly TextureInfo[]): PlaneChoice[] {
  return Array.from({ length: fullSizePlanes(textures) }, (_, p) => ({ base: p, plane: p }));
}

/** Area of the object; where the package does not say the area, that of the bounding box. */
function surfaceOf({ surfaceArea, boundsMin, boundsMax }: Manifest): number {
  const [x, y, z] = boundsMin.map((least, i) => boundsMax[i] - least);
  return surfaceArea > 0 ? surfaceArea : 2 * (x * y + y * z + z * x);
}

/** How often the texels of a full-size plane may be halved until one stands for a pixel; at least 0. */
function displayLevel(data: PackageData, base: number, displayedPx: number): number {
  const { coveredTexels, surfaceFraction } = tablesOf(data, base);
  const texelsPerArea = sumOf(coveredTexels) / (sumOf(surfaceFraction) * surfaceOf(data.manifest));
  if (!(texelsPerArea > 0 && texelsPerArea < Infinity)) return 0;
  return Math.max(0, log(Math.sqrt(texelsPerArea) / (displayedPx / data.manifest.objectHeight)) / ln2);
}

/** Levels below the display's: of base colours and of everything else, which often costs more and shows less. */
type Coarser = readonly [colour: number, other: number];

function planesAt(data: PackageData, displayedPx: number, [colour, other]: Coarser): PlaneChoice[] {
  const { textures } = data;
  return fullSize(textures).map(({ base }) => {
    const level = displayLevel(data, base, displayedPx) + (roleWeight(textures[base].role) === 1 ? colour : other);
    // Its largest mip that is at most as coarse.
    const mips = textures.map((t) => (t.mip > 0 && t.base === base && t.mip <= level ? t.mip : 0));
    const mip = Math.max(...mips);
    return { base, plane: mip > 0 ? mips.indexOf(mip) : base };
  });
}

/**
 * The smallest mips that still have a texel for every pixel where the object is displayed `displayedPx` high (device
 * px). Needs the tables of the full-size planes.
 */
export function planesForDisplay(data: PackageData, displayedPx: number): PlaneChoice[] {
  return planesAt(data, displayedPx, [0, 0]);
}

/** Surface-weighted mean of the previews' losses. */
function previewLoss(t: PlaneTables): number {
  if (t.skipDssim.length === 0) return 1;
  const weights = surfaceWeights(t);
  const stored = [...t.order];
  const weight = sumOf(stored.map((f) => weights[f]));
  return weight > 0 ? sumOf(stored.map((f) => weights[f] * t.skipDssim[f])) / weight : 0;
}

/** Loss of the picture, as 1 - SSIM over the surface, because mips stand for textures with more texels. */
export function mipLoss(data: PackageData, planes: readonly PlaneChoice[], displayedPx: number): number {
  let [loss, weight] = [0, 0];
  for (const { base, plane } of planes) {
    const { role, widthPx, previewWidthPx } = data.textures[base];
    const { mip } = data.textures[plane];
    const t = tablesOf(data, base);
    const w = roleWeight(role) * sumOf(t.surfaceFraction);
    weight += w;
    const display = displayLevel(data, base, displayedPx);
    const missing = mip - display;
    const all = log(widthPx / previewWidthPx) / ln2 - display;
    if (mip > 0 && missing > 0) loss += w * previewLoss(t) * (missing < all ? pow(missing / all, mipExponent) : 1);
  }
  return weight > 0 ? Math.min(1, loss / weight) : 0;
}

/** How bytes are best spent on textures. */
export interface TextureSpending {
  planes: PlaneChoice[];
  list: FragmentList;
  /** Ways by offer; 0 = skipped, or one more than the rung. */
  ways: number[];
  /** Predicted 1 - SSIM over the surface, loss by mips included. */
  dssim: number;
}

function spendOn(data: PackageData, planes: PlaneChoice[], displayedPx: number, options: Partial<ListOptions>, budget: number): TextureSpending {
  const list = fragmentList(data, planes, options);
  const total = Math.max(list.totalWeight, 1e-300);
  const curves = list.offers.map(({ bytes, loss }) => ({ bytes: [0, ...bytes], loss: loss.map((l) => Math.floor((l / total) * lossUnit)) }));
  const ways = spendBytes(curves, budget);
  const loss = ways.reduce((sum, way, i) => sum + list.offers[i].loss[way], list.previewLoss);
  return { planes, list, ways, dssim: 1 - (1 - loss / total) * (1 - mipLoss(data, planes, displayedPx)) };
}

/** The steps of textureForBudget, so that a page can breathe between them; the last value is the result. */
export function* budgetSteps(
  data: PackageData,
  displayedPx: number,
  options: Partial<ListOptions>,
  bytes: number,
): Generator<TextureSpending> {
  const spend = (c: Coarser): TextureSpending => spendOn(data, planesAt(data, displayedPx, c), displayedPx, options, bytes);
  let from: Coarser | undefined = [0, 0];
  let best = spend(from);
  while (from) {
    // Downhill; every step makes something coarser.
    const [colour, other]: Coarser = from;
    from = undefined;
    for (const to of [[colour + 1, other + 1], [colour, other + 1], [colour + 1, other]] as const) {
      if (Math.max(...to) > mostCoarser) continue;
      yield best;
      const now = spend(to);
      if (now.dssim >= best.dssim) continue;
      best = now;
      from = to;
    }
  }
  yield best;
}

/** The best texture that so many bytes can show. */
export interface TextureBudget extends TextureSpending {
  /** Rungs by offer; -1 = skipped. */
  rungs: number[];
  /** Bytes of fragments, at most the budget. */
  bytes: number;
}

/**
 * Chooses between the planes for the display and their mips, so that few bytes are not spread over texels that they
 * cannot make good; fragments share the bytes by rate and distortion. Needs the tables of all planes.
 */
export function textureForBudget(
  data: PackageData,
  displayedPx: number,
  options: Partial<ListOptions>,
  bytes: number,
): TextureBudget {
  const best = [...budgetSteps(data, displayedPx, options, bytes)].pop()!;
  const rungs = best.ways.map((way) => way - 1);
  return { ...best, rungs, bytes: sumOf(best.list.offers.map((f, i) => bytesAtRung(f, rungs[i]))) };
}
