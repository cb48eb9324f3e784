import { qualityPath } from './entry_paths';
import { FormatError } from './errors';
import { JsonAt, parseJson } from './json_fields';
import { maxQualityBytes, maxQualitySamples, maxQualitySizes } from './shared_numbers';
import type { TextureInfo } from './textures';

/** Planes whose loss shows in the same way. */
export type PlaneGroup = 'colour' | 'normal' | 'data';
/** Groups in the order of documents. */
export const planeGroups: readonly PlaneGroup[] = ['colour', 'normal', 'data'];

/** The group of a role of textures.json. */
export function groupOf(role: string): PlaneGroup {
  if (role === 'normal') return role;
  return role === 'data' || role === 'occlusion-roughness-metallic' ? 'data' : 'colour';
}

/** How lit pictures differ from those of S_0 with the source's texels; arrays of one length. */
export interface PictureLosses {
  /** Mean FLIP over the pixels that either picture covers, 0 = equal. */
  flip: Float32Array;
  /** 95th percentile of FLIP over those pixels. */
  flipP95: Float32Array;
  /** 1 - mean SSIM of luma. */
  dssim: Float32Array;
}
/** What a group's textures lose at one displayed height, on S_0, with all other groups as in the source. */
export interface TextureLosses {
  /** Mean of 1 - SSIM of the group's texels over the object's surface, rising, > 0; a sample each. */
  texelDssim: Float32Array;
  /** A sample each; `flip` is what coding adds to finer.flip[0], by the exponent. */
  coded: PictureLosses;
  /** One: with the previews of all the group's textures. */
  preview: PictureLosses;
  /** With the source's texels of the planes for that height, then of mips that are 1, 2 .. levels finer. */
  finer: PictureLosses;
  /** With the source's texels of mips that are 1, 2 .. levels coarser than those for that height. */
  coarser: PictureLosses;
}
/** What choices of scale and textures change in lit pictures: quality.json. */
export interface QualityTable {
  views: number;
  /** Displayed heights of the object, px, rising. */
  sizesPx: number[];
  /** Losses of parts add up as (sum of loss^exponent)^(1 / exponent). */
  exponent: number;
  /** Mean of |predicted - measured| / measured of FLIP; 0 where nothing was sampled. */
  error: number;
  /** Scale numbers, rising. */
  scales: number[];
  /** By size; of each scale, with the source's texels. */
  geometry: PictureLosses[];
  /** Those that the model has; by size. */
  groups: { group: PlaneGroup; sizes: TextureLosses[] }[];
}


function readRising(at: JsonAt, mostValues: number, least: number, most: number): number[] {
  let before = -Infinity;
  return at.each(1, mostValues, (one) => {
    const v = one.integer(least, most);
    if (v <= before) one.fail('a rising number', v);
    return (before = v);
  });
}

function readFractions(at: JsonAt, count: number): Float32Array {
  return Float32Array.from(at.each(count, count, (one) => one.number(0, 1)));
}

function readLosses(at: JsonAt, count: number): PictureLosses {
  const [flip, flipP95, dssim] =
    ['flip', 'flipP95', 'dssim'].map((name) => readFractions(at.at(name), count));
  return { flip, flipP95, dssim };
}

function readTexture(at: JsonAt): TextureLosses {
  let before = 0;
  const texelDssim = Float32Array.from(at.at('texelDssim').each(1, maxQualitySamples, (one) => {
    const v = Math.fround(one.number(0, 2));
    if (!(v > before)) one.fail('a rising number above 0', v);
    return (before = v);
  }));
  const mips = (one: JsonAt, least: number): PictureLosses =>
    readLosses(one, one.at('flip').array(least, 8 + least));
  const coded = readLosses(at.at('coded'), texelDssim.length);
  return { texelDssim, coded, preview: readLosses(at.at('preview'), 1), finer: mips(at.at('finer'), 1),
    coarser: mips(at.at('coarser'), 0) };
}

/** Reads quality.json, strictly; FormatError names the place in the document. */
export function readQuality(json: Uint8Array): QualityTable {
  const at = parseJson(json, qualityPath, maxQualityBytes).by('Q01');
  const sizesPx = readRising(at.at('sizesPx'), maxQualitySizes, 1, 65536);
  const scales = readRising(at.at('scales'), 100, 0, 99);
  const sizes = sizesPx.length;
  let last = -1;
  return {
    views: at.at('views').integer(1, 10000),
    sizesPx,
    exponent: Math.fround(at.at('exponent').number(1, 4)),
    error: Math.fround(at.at('error').number(0, 1e6)),
    scales,
    geometry: at.at('geometry').each(sizes, sizes, (one) => readLosses(one, scales.length)),
    groups: at.at('groups').each(0, planeGroups.length, (one) => {
      const name = one.at('group').text(20);
      const place = planeGroups.indexOf(name as PlaneGroup);
      if (place <= last) one.fail(`${planeGroups}`, name, place < 0 ? 'W06' : 'Q03');
      last = place;
      return { group: planeGroups[place], sizes: one.at('sizes').each(sizes, sizes, readTexture) };
    }),
  };
}

/** The groups of quality.json are those of the planes. */
export function requireGroups({ groups }: QualityTable, planes: readonly TextureInfo[]): void {
  const wanted = planeGroups.filter((group) => planes.some((t) => groupOf(t.role) === group));
  if (groups.length !== wanted.length || groups.some((g, k) => g.group !== wanted[k]))
    throw new FormatError(qualityPath, '/groups', 'those of the planes', '', 'R15');
}
