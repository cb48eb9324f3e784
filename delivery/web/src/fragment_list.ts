import { bytesToShow, etaOf, interpolatedBytes, meanEta, qualityOf, surfaceWeights } from './allocation';
import { InputError } from './errors';
import type { FragmentOffer } from './harmonic_time';
import type { Manifest } from './manifest';
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
}
export interface ListOptions {
  scale: number;
  /** Of q_i(x, y); -1 = the mean of eta. */
  gamma: number;
  qualityLow: number;
  qualityHigh: number;
}
export const defaultListOptions: ListOptions = { scale: 0, gamma: -1, qualityLow: 5, qualityHigh: 97 };

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
    const loss = [weight * (t.skipDssim.length === 0 ? 1 : t.skipDssim[f])];
    for (let r = 0; r < rungCount(t); ++r) {
      bytes.push(bytesToShow(t, r, f));
      loss.push(weight * t.dssim[r * fragments + f]);
    }
    if (!bytes.every((b) => b > 0 && b <= 0xffffffff)) continue;
    list.totalWeight += weight;
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

export function fragmentList(
  data: PackageData,
  planes: readonly PlaneChoice[],
  options: Partial<ListOptions> = {},
): FragmentList {
  const list: FragmentList = { offers: [], fragments: [], totalWeight: 0 };
  for (const p of planes) addPlane(data, p.plane, { ...defaultListOptions, ...options }, list);
  return list;
}

/** Every texture at full size. */
export function fullSize(textures: readonly TextureInfo[]): PlaneChoice[] {
  return Array.from({ length: fullSizePlanes(textures) }, (_, p) => ({ base: p, plane: p }));
}

/** Surface of the bounding box, what a closed object of that size shows at most. */
function surfaceEstimate(m: Manifest): number {
  const [x, y, z] = m.boundsMin.map((least, i) => m.boundsMax[i] - least);
  return 2 * (x * y + y * z + z * x);
}

/**
 * The smallest mips that still have a texel for every pixel where the object is displayed `displayedPx` high (device
 * px). Needs the tables of the full-size planes.
 */
export function planesForDisplay(data: PackageData, displayedPx: number): PlaneChoice[] {
  const planes = fullSize(data.textures);
  const pxPerUnit = displayedPx / data.manifest.objectHeight;
  const surface = surfaceEstimate(data.manifest);
  for (const choice of planes) {
    const t = tablesOf(data, choice.base);
    let texels = 0;
    let share = 0;
    for (let f = 0; f < fragmentCount(t); ++f) {
      texels += t.coveredTexels[f];
      share += t.surfaceFraction[f];
    }
    if (!(share > 0) || !(surface > 0)) continue;
    const texelsPerUnit = Math.sqrt(texels / (share * surface));
    let bestMip = 0;
    for (let p = planes.length; p < data.textures.length; ++p) {
      const info = data.textures[p];
      if (info.base !== choice.base || info.mip <= bestMip) continue;
      if (texelsPerUnit / 2 ** Math.min(info.mip, 30) < pxPerUnit) continue;
      bestMip = info.mip;
      choice.plane = p;
    }
  }
  return planes;
}
