import { bytesToShow, etaOf, interpolatedBytes, meanEta, qualityOf, spendBytes, surfaceWeights } from './allocation';
import { InputError } from './errors';
import type { FragmentOffer } from './harmonic_time';
import type { Manifest } from './manifest';
import { log, pow } from './portable_math';
import { PlaneTables, fragmentCount, rungCount } from './tables';
import { TextureInfo, fullSizePlanes } from './textures';

/** What decisions about textures are made from. Tables may lack planes that nobody asks about. */
export interface PackageData {
  manifest: Manifest;
  textures: readonly TextureInfo[];
  tables: readonly (PlaneTables | undefined)[];
}
/** Which plane shows each texture: the full-size one or a mip of it. */
export interface PlaneChoice {
  base: number;
  plane: number;
}
/** Where an offer of the list comes from. */
export interface ListedFragment {
  plane: number;
  fragment: number;
}
/** The F-list of a package at a scale: the stored fragments of all chosen planes in one list (thesis ch. 4). */
export interface FragmentList {
  offers: FragmentOffer[];
  /** By offer. */
  fragments: ListedFragment[];
  /** Of the losses: a loss of this is 1 - SSIM = 1 everywhere. */
  totalWeight: number;
  /** Of fragments that are not in the list because no rung shows more of them than the preview. */
  previewLoss: number;
}
/** Of fragmentList. */
export interface ListOptions {
  scale: number;
  /** Of q_i(x, y); -1 = the mean of eta. */
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

/** What a role counts for in the list and in losses. */
export function roleWeight(role: string): number {
  if (role === 'base-colour') return 1;
  if (role === 'emissive') return 0.7;
  if (role === 'normal' || role === 'alpha') return 0.5;
  return 0.3;
}

/** Rungs of a plane whose quality is within the limits, as near as there are any. */
function limitRung(t: PlaneTables, quality: number, low: boolean): number {
  let rung = low ? rungCount(t) - 1 : 0;
  if (low) while (rung > 0 && t.rungQuality[rung - 1] >= quality) --rung;
  else while (rung + 1 < rungCount(t) && t.rungQuality[rung + 1] <= quality) ++rung;
  return rung;
}

function tablesOf(data: PackageData, plane: number): PlaneTables {
  const t = data.tables[plane];
  if (!t) throw new InputError('', `texture plane ${plane}`, 'a plane whose tables were read', 'another');
  return t;
}

function addPlane(data: PackageData, plane: number, options: ListOptions, list: FragmentList): void {
  const t = tablesOf(data, plane);
  const role = roleWeight(data.textures[plane].role);
  const scale = Math.min(Math.max(options.scale, 0), t.scales);
  const eta = etaOf(t, scale);
  const weights = surfaceWeights(t);
  const quality = qualityOf(t, scale, options.gamma < 0 ? meanEta(t, scale) : options.gamma);
  const low = limitRung(t, options.qualityLow, true);
  const high = limitRung(t, options.qualityHigh, false);
  const fragments = fragmentCount(t);
  for (const f of t.order) {
    const weight = role * weights[f];
    const bytes: number[] = [];
    const skipped = t.skipDssim.length === 0 ? 1 : t.skipDssim[f];
    const loss = [weight * skipped];
    let showsMore = false;
    for (let r = 0; r < rungCount(t); ++r) {
      const dssim = t.dssim[r * fragments + f];
      bytes.push(bytesToShow(t, r, f));
      loss.push(weight * dssim);
      showsMore ||= dssim < skipped;
    }
    if (!bytes.every((b) => b > 0 && b <= 0xffffffff)) continue;
    list.totalWeight += weight;
    if (!showsMore) {
      list.previewLoss += loss[0];
      continue;
    }
    list.fragments.push({ plane, fragment: f });
    list.offers.push({
      bytes,
      loss,
      eta: eta[f] * weight,
      plannedBytes: Math.max(1, interpolatedBytes(t, f, quality[f])),
      lowRung: Math.min(low, high),
      highRung: high,
    });
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

/** Covered texels of a plane and the share of the surface that it has. */
function coverOf(t: PlaneTables): { texels: number; surface: number } {
  let texels = 0;
  let surface = 0;
  for (let f = 0; f < fragmentCount(t); ++f) {
    texels += t.coveredTexels[f];
    surface += t.surfaceFraction[f];
  }
  return { texels, surface };
}

/** Area of the object; where the package does not say it that of the bounding box. */
function surfaceOf(m: Manifest): number {
  if (m.surfaceArea > 0) return m.surfaceArea;
  const [x, y, z] = m.boundsMin.map((least, i) => m.boundsMax[i] - least);
  return 2 * (x * y + y * z + z * x);
}

/** How often the texels of a full-size plane may be halved until one stands for a pixel. */
function displayLevel(data: PackageData, base: number, displayedPx: number): number {
  const cover = coverOf(tablesOf(data, base));
  const surface = surfaceOf(data.manifest);
  if (!(cover.surface > 0) || !(surface > 0) || !(cover.texels > 0)) return 0;
  const texelsPerUnit = Math.sqrt(cover.texels / (cover.surface * surface));
  return log(texelsPerUnit / (displayedPx / data.manifest.objectHeight)) / ln2;
}

/** The plane of a texture with the largest mip that is at most `level`. */
function planeAt(textures: readonly TextureInfo[], base: number, level: number): number {
  let best = base;
  let bestMip = 0;
  textures.forEach((t, p) => {
    if (t.mip === 0 || t.base !== base || t.mip <= bestMip || t.mip > level) return;
    bestMip = t.mip;
    best = p;
  });
  return best;
}

/** Levels below the display's: of base colours and of everything else, which often costs more and shows less. */
interface Coarser {
  colour: number;
  other: number;
}
function planesAt(data: PackageData, displayedPx: number, coarser: Coarser): PlaneChoice[] {
  return fullSize(data.textures).map(({ base }) => {
    const colour = roleWeight(data.textures[base].role) === 1;
    const level = Math.max(0, displayLevel(data, base, displayedPx)) + (colour ? coarser.colour : coarser.other);
    return { base, plane: planeAt(data.textures, base, level) };
  });
}

/**
 * The smallest mips that still have a texel for every pixel where the object is displayed `displayedPx` high (device
 * px). Needs the tables of the full-size planes.
 */
export function planesForDisplay(data: PackageData, displayedPx: number): PlaneChoice[] {
  return planesAt(data, displayedPx, { colour: 0, other: 0 });
}

/** Surface-weighted mean of what the previews lose. */
function previewLoss(t: PlaneTables): number {
  if (t.skipDssim.length === 0) return 1;
  const weights = surfaceWeights(t);
  let sum = 0;
  let weight = 0;
  for (const f of t.order) {
    sum += weights[f] * t.skipDssim[f];
    weight += weights[f];
  }
  return weight > 0 ? sum / weight : 0;
}

/** What the picture loses, as 1 - SSIM over the surface, because mips stand for textures that have more texels. */
export function mipLoss(data: PackageData, planes: readonly PlaneChoice[], displayedPx: number): number {
  let loss = 0;
  let weight = 0;
  for (const choice of planes) {
    const base = data.textures[choice.base];
    const shown = data.textures[choice.plane];
    const t = tablesOf(data, choice.base);
    const w = roleWeight(base.role) * coverOf(t).surface;
    weight += w;
    if (shown.mip === 0) continue;
    const display = Math.max(0, displayLevel(data, choice.base, displayedPx));
    const preview = log(base.widthPx / base.previewWidthPx) / ln2;
    const missing = shown.mip - display;
    const all = preview - display;
    if (missing <= 0) continue;
    loss += w * previewLoss(t) * (missing < all ? pow(missing / all, mipExponent) : 1);
  }
  return weight > 0 ? Math.min(1, loss / weight) : 0;
}

/** The best texture that so many bytes can show. */
export interface TextureBudget {
  planes: PlaneChoice[];
  list: FragmentList;
  /** By offer; -1 = skipped. */
  rungs: number[];
  /** Of fragments, at most the budget. */
  bytes: number;
  /** Predicted 1 - SSIM over the surface, loss by mips included. */
  dssim: number;
}

function spendOn(
  data: PackageData,
  planes: PlaneChoice[],
  displayedPx: number,
  options: Partial<ListOptions>,
  budget: number,
): TextureBudget {
  const list = fragmentList(data, planes, options);
  const total = Math.max(list.totalWeight, 1e-300);
  const curves = list.offers.map((f) => ({
    bytes: [0, ...f.bytes],
    loss: f.loss.map((l) => Math.floor((l / total) * lossUnit)),
  }));
  const ways = spendBytes(curves, budget);
  let loss = list.previewLoss;
  let bytes = 0;
  ways.forEach((way, i) => {
    bytes += curves[i].bytes[way];
    loss += list.offers[i].loss[way];
  });
  const dssim = 1 - (1 - loss / total) * (1 - mipLoss(data, planes, displayedPx));
  return { planes, list, rungs: ways.map((way) => way - 1), bytes, dssim };
}

/** The steps of textureForBudget, so that a page can breathe between them; the last value is the result. */
export function* budgetSteps(
  data: PackageData,
  displayedPx: number,
  options: Partial<ListOptions>,
  bytes: number,
): Generator<TextureBudget> {
  const spend = (c: Coarser): TextureBudget =>
    spendOn(data, planesAt(data, displayedPx, c), displayedPx, options, bytes);
  let at: Coarser = { colour: 0, other: 0 };
  let best = spend(at);
  for (let better = true; better; ) {
    // Downhill; every step makes something coarser.
    better = false;
    const from = at;
    for (const step of [{ colour: 1, other: 1 }, { colour: 0, other: 1 }, { colour: 1, other: 0 }]) {
      const to = { colour: from.colour + step.colour, other: from.other + step.other };
      if (Math.max(to.colour, to.other) > mostCoarser) continue;
      yield best;
      const now = spend(to);
      if (now.dssim >= best.dssim) continue;
      best = now;
      at = to;
      better = true;
    }
  }
  yield best;
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
  let best: TextureBudget | undefined;
  for (const step of budgetSteps(data, displayedPx, options, bytes)) best = step;
  return best!;
}
