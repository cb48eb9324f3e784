import { InputError } from '../format/errors';
import { fullSizePlanes } from '../format/layout';
import type { Manifest } from '../format/manifest';
import { ln2 } from '../format/shared_numbers';
import { type PackageData, PlaneTables, fragmentCount } from '../format/tables';
import { QualityTable, groupOf, planeGroups } from '../format/quality_table';
import { TextureInfo } from '../format/textures';
import { sumOf } from './numbers';
import { log } from './portable_math';
import { GroupCurve, TexelGrowth, combinedFlip, geometryFlip, sizesAround } from './prediction';
import { surfaceWeights } from './rate_distortion';

// delivery/cpp/decide/texture_loss.cpp, bit for bit.

/** Which plane shows each texture: the full-size one or a mip of it. */
export interface PlaneChoice {
  base: number;
  plane: number;
}
/** A number for each group of planes, in the order of planeGroups. */
export type PerGroup = readonly [colour: number, normal: number, data: number];
/** Of every group the same. */
export const everyGroup = (value: number): PerGroup => [value, value, value];


/** Tables of a plane that were read; InputError where they were not. */
export function tablesOf(data: PackageData, plane: number): PlaneTables {
  const t = data.tables[plane];
  if (!t) throw new InputError('', `texture plane ${plane}`, 'a plane whose tables were read', 'another');
  return t;
}

/** Number of the group of a plane. */
export const groupIndex = (data: PackageData, plane: number): number =>
  planeGroups.indexOf(groupOf(data.textures[plane].role));

/** Every texture at full size. */
export function fullSize(textures: readonly TextureInfo[]): PlaneChoice[] {
  return Array.from({ length: fullSizePlanes(textures) }, (_, p) => ({ base: p, plane: p }));
}

/** Area of the object; where the package does not say the area, that of the bounding box. */
function surfaceOf({ surfaceArea, boundsMin, boundsMax }: Manifest): number {
  const [x, y, z] = boundsMin.map((least, i) => boundsMax[i] - least);
  return surfaceArea > 0 ? surfaceArea : 2 * (x * y + y * z + z * x);
}

/** How often full-size texels may be halved until one covers a pixel; below 0 where it covers more. */
function displayLevel(data: PackageData, base: number, displayedPx: number): number {
  const { coveredTexels, surfaceFraction } = tablesOf(data, base);
  const texelsPerArea = sumOf(coveredTexels) / (sumOf(surfaceFraction) * surfaceOf(data.manifest));
  if (!(texelsPerArea > 0 && texelsPerArea < Infinity)) return 0;
  return log(Math.sqrt(texelsPerArea) / (displayedPx / data.manifest.objectHeight)) / ln2;
}

/** The largest mip of a texture that is at most as coarse as `level`, or the full-size plane. */
function planeAtLevel({ textures }: PackageData, base: number, level: number): number {
  const mips = textures.map((t) => (t.mip > 0 && t.base === base && t.mip <= level ? t.mip : 0));
  const mip = Math.max(...mips);
  return mip > 0 ? mips.indexOf(mip) : base;
}

/**
 * The smallest mips that still have a texel for every pixel where the object is displayed `displayedPx` high
 * (device px), or by group so many `levels` coarser, or finer where below 0. Needs the tables of the
 * full-size planes.
 */
export function planesForDisplay(data: PackageData, displayedPx: number,
    levels: PerGroup = everyGroup(0)): PlaneChoice[] {
  return fullSize(data.textures).map(({ base }) => {
    const level = Math.max(0, displayLevel(data, base, displayedPx)) + levels[groupIndex(data, base)];
    return { base, plane: planeAtLevel(data, base, level) };
  });
}

/** FLIP of the textures alone, 0 = equal to S_0 with the source's texels. `losses`: by group, on S_0. */
export function textureFlip(table: QualityTable, losses: PerGroup): number {
  return combinedFlip(table, [0, ...losses]);
}
/** FLIP of a scale with textures. */
export function pictureFlip(table: QualityTable, displayedPx: number, scale: number,
    losses: PerGroup): number {
  return combinedFlip(table, [geometryFlip(table, displayedPx, scale), ...losses]);
}

/** Of a plane: FLIP of an object that looks all over like one fragment. */
interface PlaneLoss {
  /** [F] surfaceWeights(). */
  weights: Float32Array;
  /** Of the stored fragments together. */
  weight: number;
  /** [(rungs + 1) * F], index way * F + fragment; way 0 is the preview, others lose by mip and rung. */
  shown: Float64Array;
}

/** What fragments lose in lit pictures of one displayed height, by the package's quality table. */
export class TextureLoss {
  private readonly curves_: GroupCurve[];
  private readonly planes_ = new Map<number, PlaneLoss>();
  private readonly previewMeans_ = new Map<number, number>();

  constructor(readonly data: PackageData, readonly displayedPx: number) {
    this.curves_ = planeGroups.map((group) => new GroupCurve(data.quality, group, displayedPx));
  }
  plane(plane: number): PlaneLoss {
    let loss = this.planes_.get(plane);
    if (!loss) this.planes_.set(plane, (loss = this.measure_(plane)));
    return loss;
  }
  /** What a mip loses of the source's texels; 0 for full size. Needs that plane's tables alone. */
  mip(plane: number): number {
    return this.curves_[groupIndex(this.data, plane)].halved(this.growth_(plane),
      this.data.textures[plane].mip);
  }
  private measure_(plane: number): PlaneLoss {
    const t = tablesOf(this.data, plane);
    const curve = this.curves_[groupIndex(this.data, plane)];
    const weights = surfaceWeights(t);
    const fragments = fragmentCount(t);
    const growth = this.growth_(plane);
    const shown = new Float64Array((t.rungQuality.length + 1) * fragments);
    const mip = this.mip(plane);
    const withMip = (coded: number): number =>
      (mip > 0 ? combinedFlip(this.data.quality, [coded, mip]) : coded);
    const mean = this.previewMean_(plane);
    const preview = this.previewLoss_(plane);
    for (const f of t.order) {
      shown[f] = mean > 0 ? Math.min(1, preview * (curve.coded(t.skipDssim[f]) / mean)) : 0;
      for (let r = 0; r < t.rungQuality.length; ++r)
        shown[(r + 1) * fragments + f] = withMip(curve.coded(t.dssim[r * fragments + f], growth));
    }
    return { weights, weight: sumOf([...t.order].map((f) => weights[f])), shown };
  }
  /** Loss of skipped fragments: the mean over the surface of what the group's curve says of their texels. */
  private previewMean_(plane: number): number {
    let mean = this.previewMeans_.get(plane);
    if (mean !== undefined) return mean;
    const t = tablesOf(this.data, plane);
    const curve = this.curves_[groupIndex(this.data, plane)];
    const weights = surfaceWeights(t);
    let [sum, total] = [0, 0];
    for (const f of t.order) {
      sum += weights[f] * curve.coded(t.skipDssim[f] ?? 1);
      total += weights[f];
    }
    this.previewMeans_.set(plane, (mean = total > 0 ? sum / total : 0));
    return mean;
  }
  /** FLIP of the plane's preview, which is the same for all mips of a texture. */
  private previewLoss_(plane: number): number {
    const { data } = this;
    const { mip, base } = data.textures[plane];
    const group = groupIndex(data, plane);
    let [sum, total] = [0, 0];
    for (const full of fullSize(data.textures)) {
      if (groupIndex(data, full.plane) !== group) continue;
      const t = tablesOf(data, full.plane);
      const weights = surfaceWeights(t);
      const weight = sumOf([...t.order].map((f) => weights[f]));
      sum += weight * this.previewMean_(full.plane);
      total += weight;
    }
    const share = sum > 0 ? (this.previewMean_(mip > 0 ? base : plane) * total) / sum : 1;
    return this.curves_[group].preview() * share;
  }
  /** How much larger the plane's texels are at this height than those that the quality table sampled. */
  private growth_(plane: number): TexelGrowth {
    const { data, displayedPx } = this;
    const { textures } = data;
    const { mip } = textures[plane];
    const base = mip > 0 ? textures[plane].base : plane;
    const here = mip - displayLevel(data, base, displayedPx);
    const [first, second] = sizesAround(data.quality, displayedPx).map((px) => {
      const level = displayLevel(data, base, px);
      return here - (textures[planeAtLevel(data, base, level)].mip - level);
    });
    return [first, second];
  }
  /** The weight of each group's stored fragments. */
  weights(planes: readonly PlaneChoice[]): PerGroup {
    const weights: [number, number, number] = [0, 0, 0];
    for (const { plane } of planes) weights[groupIndex(this.data, plane)] += this.plane(plane).weight;
    return weights;
  }
}

/** A texture as it is shown: the rung of each fragment, row by row; -1 = the preview. */
export interface ShownTexture extends PlaneChoice {
  rungs: ArrayLike<number>;
}
/** Predicted FLIP of this scale with these textures. Needs their planes' tables and the full-size ones'. */
export function shownFlip(data: PackageData, displayedPx: number, scale: number,
    planes: readonly ShownTexture[]): number {
  const loss = new TextureLoss(data, displayedPx);
  const surface = loss.weights(planes);
  const all: [number, number, number] = [0, 0, 0];
  for (const { plane, rungs } of planes) {
    const { weights, shown } = loss.plane(plane);
    const t = tablesOf(data, plane);
    const group = groupIndex(data, plane);
    for (const f of t.order) all[group] +=
      (weights[f] / (surface[group] || 1)) * shown[((rungs[f] ?? -1) + 1) * fragmentCount(t) + f];
  }
  return pictureFlip(data.quality, displayedPx, scale, all);
}
