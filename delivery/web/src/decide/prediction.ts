import type { PlaneGroup, QualityTable, TextureLosses } from '../format/quality_table';
import {
  behindOneSample, flattest, leastDssim, leastFlip, ln2, lossPerDoubling, lossPerHalving, previewLevels,
  steepest,
} from '../format/shared_numbers';
import { clamp } from './numbers';
import { exp, log, pow } from './portable_math';

// FLIP of lit pictures of a choice against S_0 with the source's texels, read between the samples of a
// quality table: format/rules/picture_prediction.cpp, bit for bit.

const mixed = (a: number, b: number, part: number): number => (1 - part) * a + part * b;

/** Two neighbours on a rising axis around `at`, and the way from the first to the second. */
function between(axis: readonly number[], at: number,
    value: (x: number) => number = (x) => x): [first: number, second: number, part: number] {
  let first = 0;
  while (first + 2 < axis.length && axis[first + 1] < at) ++first;
  const second = Math.min(first + 1, axis.length - 1);
  if (second === first) return [first, second, 0];
  const from = value(axis[first]);
  return [first, second, clamp((value(at) - from) / (value(axis[second]) - from), 0, 1)];
}

const sizeAt = ({ sizesPx }: QualityTable, displayedPx: number): [number, number, number] =>
  between(sizesPx, Math.max(displayedPx, 1), log);

/** How much more a picture of a fixed number of texels loses than at the nearest height of the table. */
function beyondSizes({ sizesPx }: QualityTable, displayedPx: number): number {
  const px = Math.max(displayedPx, 1);
  const nearest = clamp(px, sizesPx[0], sizesPx[sizesPx.length - 1]);
  return px === nearest ? 1 : pow(lossPerDoubling, log(px / nearest) / ln2);
}

/** One of the two displayed heights around the one that is asked for. */
class Curve {
  private readonly logDssim_: number[];
  private readonly logFlip_: number[];
  /** Loss of mips from the finest sampled level on; how many levels finer than the shown planes it is. */
  private readonly mips_: number[];
  private readonly finer_: number;
  readonly preview: number;

  constructor({ texelDssim, coded, preview, finer, coarser }: TextureLosses, beyond: number) {
    let least = leastFlip;
    this.logDssim_ = [...texelDssim].map(log);
    this.logFlip_ = [...coded.flip].map((flip) => log((least = Math.max(least, flip))));
    this.mips_ = [...[...finer.flip].reverse(), ...coarser.flip];
    this.finer_ = finer.flip.length - 1;
    this.preview = Math.min(1, preview.flip[0] * beyond);
  }
  at(logDssim: number): number {
    const [x, y] = [this.logDssim_, this.logFlip_];
    let i = 0;
    if (x.length === 1) return exp(y[0] + (logDssim < x[0] ? steepest : behindOneSample) * (logDssim - x[0]));
    while (i + 2 < x.length && x[i + 1] < logDssim) ++i;
    const slope = (y[i + 1] - y[i]) / (x[i + 1] - x[i]);
    const from = logDssim > x[i + 1] ? i + 1 : i;
    const beyond = from > i || logDssim < x[0];
    return exp(y[from] + (beyond ? clamp(slope, flattest, steepest) : slope) * (logDssim - x[from]));
  }
  /** Behind the coarsest sampled level towards the preview's. */
  atLevel(level: number, previewLevel: number): number {
    const mips = this.mips_;
    if (mips.length < 2) return mips[0];
    const at = Math.max(0, level + this.finer_);
    const last = mips.length - 1;
    const first = Math.min(Math.floor(at), last - 1);
    const alongLine = mixed(mips[first], mips[first + 1], at - first);
    const toPreview = previewLevel + this.finer_ - last;
    if (at <= last || toPreview <= 0) return alongLine;
    const line = mixed(mips[first], mips[first + 1], toPreview + 1);
    return alongLine + ((Math.max(line, Math.sqrt(line * this.preview)) - line) * (at - last)) / toPreview;
  }
}

/** The two displayed heights of a table around one, px; 1 px for a table without any. */
export function sizesAround(table: QualityTable, displayedPx: number): readonly [number, number] {
  const [first, second] = sizeAt(table, displayedPx);
  return [table.sizesPx[first] ?? 1, table.sizesPx[second] ?? 1];
}
/** How many times twice as large texels are on the screen as the samples of sizesAround(). */
export type TexelGrowth = readonly [number, number];

/** What textures of a group lose at one height; without samples 1 - SSIM, and 0 by coarser mips. */
export class GroupCurve {
  private readonly curves_: Curve[];
  private readonly part_: number;

  constructor(table: QualityTable, group: PlaneGroup, displayedPx: number) {
    const [first, second, part] = sizeAt(table, displayedPx);
    const sizes = table.groups.find((g) => g.group === group)?.sizes;
    const beyond = beyondSizes(table, displayedPx);
    this.curves_ = sizes ? [new Curve(sizes[first], beyond), new Curve(sizes[second], beyond)] : [];
    this.part_ = part;
  }
  /** FLIP that rungs add where the texels' 1 - SSIM is `dssim`. */
  coded(dssim: number, growth: TexelGrowth = [0, 0]): number {
    if (!(dssim > leastDssim)) return 0;
    const [first, second] = this.curves_;
    if (!first) return Math.min(1, dssim);
    const x = log(dssim);
    const [a, b] = [first, second].map((curve, i) =>
      curve.at(x) * (growth[i] === 0 ? 1 : pow(growth[i] < 0 ? lossPerHalving : lossPerDoubling, growth[i])));
    return Math.min(1, mixed(a, b, this.part_));
  }
  /** FLIP where all textures of the group show their previews. */
  preview(): number {
    const [first, second] = this.curves_;
    return first ? mixed(first.preview, second.preview, this.part_) : 1;
  }
  /** FLIP of the texels that rungs code, halved `mip` times; 0: that of the finest sampled level. */
  halved(growth: TexelGrowth, mip: number): number {
    const [first, second] = this.curves_;
    const at = (curve: Curve, level: number): number => {
      const v = (of: number): number => curve.atLevel(of, level - mip + previewLevels);
      return clamp(v(level) - Math.max(0, v(level - mip) - v(-99)), 0, 1);
    };
    return first ? mixed(at(first, growth[0]), at(second, growth[1]), this.part_) : 0;
  }
}

/** FLIP of a scale with the source's texels. */
export function geometryFlip(table: QualityTable, displayedPx: number, scale: number): number {
  const [s, nextScale, scalePart] = between(table.scales, scale);
  const [size, nextSize, sizePart] = sizeAt(table, displayedPx);
  const at = (i: number): number =>
    mixed(table.geometry[i].flip[s], table.geometry[i].flip[nextScale], scalePart);
  return mixed(at(size), at(nextSize), sizePart);
}

/** Losses of scale and groups together, at most 1. */
export function combinedFlip({ exponent }: QualityTable, losses: readonly number[]): number {
  let sum = 0;
  for (const loss of losses) if (loss > 0) sum += pow(loss, exponent);
  return sum > 0 ? Math.min(1, pow(sum, 1 / exponent)) : 0;
}
