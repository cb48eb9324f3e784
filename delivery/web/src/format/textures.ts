import { CodecId, codecTraits, isCodec } from './codec';
import * as paths from './entry_paths';
import { JsonAt, parseJson } from './json_fields';
import { fullSizePlanes } from './layout';
import {
  maxFragments, maxMip, maxPackagePlanes, maxPackageRungs, maxSide, maxTextBytes, maxTexturesBytes,
} from './shared_numbers';

/** One texture plane of textures.json (format/SPEC.md, section 7). */
export interface TextureInfo {
  /** GLB image "texture/<image>". */
  image: number;
  /** Sides are 1 / 2^mip of the full-size plane's, rounded up. */
  mip: number;
  /** The full-size plane of a mip. */
  base: number;
  /** base-colour, emissive, normal, occlusion-roughness-metallic, alpha, colour, data, or a later one. */
  role: string;
  name: string;
  colourSpace: 'srgb' | 'linear';
  codec: CodecId;
  widthPx: number;
  heightPx: number;
  channels: number;
  fragmentWidthPx: number;
  fragmentHeightPx: number;
  columns: number;
  rows: number;
  gridReason: string;
  previewWidthPx: number;
  previewHeightPx: number;
  /** IJG quality per rung, strictly rising. */
  rungQuality: number[];
  /** The last rung has the coefficients of the source, a JPEG. Loads that ask or refine so far fetch it. */
  sourceRung: boolean;
  /** Ending of the source file source/PPP.EXT; "" = none. PackageReader.entry reads it, no load does. */
  source: string;
}


function readGrid(at: JsonAt) {
  const integer = (name: string, least: number, most: number): number => at.at(name).integer(least, most);
  const grid = {
    widthPx: integer('widthPx', 1, maxSide),
    heightPx: integer('heightPx', 1, maxSide),
    channels: integer('channels', 1, 3),
    fragmentWidthPx: integer('fragmentWidthPx', 1, maxSide),
    fragmentHeightPx: integer('fragmentHeightPx', 1, maxSide),
    columns: integer('columns', 1, maxFragments),
    rows: 0,
    gridReason: '',
  };
  if (grid.channels === 2) at.at('channels').fail('1 or 3');
  if (grid.fragmentWidthPx % 16 || grid.fragmentHeightPx % 16)
    at.fail('sides of fragments that are multiples of 16', '', 'X04');
  grid.rows = at.at('rows').by('X05').integer(1, Math.floor(maxFragments / grid.columns));
  const tiles = (count: number, side: number, whole: number): boolean =>
    count * side >= whole && (count - 1) * side < whole;
  if (!tiles(grid.columns, grid.fragmentWidthPx, grid.widthPx) ||
      !tiles(grid.rows, grid.fragmentHeightPx, grid.heightPx))
    at.fail('columns and rows that cover the plane', '', 'X05');
  grid.gridReason = at.at('gridReason').text(maxTextBytes);
  return grid;
}

const sourceEndings = ['jpg', 'png', 'tif', 'webp', 'exr'];

/** Fields about the source itself. */
function readSource(at: JsonAt, codec: CodecId, mip: number): { sourceRung: boolean; source: string } {
  const sourceRung = at.has('sourceRung') && at.at('sourceRung').boolean();
  if (sourceRung && (codec !== 'jpeg' || mip > 0))
    at.fail('sourceRung of a full-size plane of codec jpeg', '', 'X11');
  if (!at.has('source')) return { sourceRung, source: '' };
  const source = at.at('source').text(100);
  if (!sourceEndings.includes(source)) at.fail('a known source', source, 'X03');
  if (mip > 0) at.fail('source of a full-size plane', '', 'X11');
  at.at('sourceColours').boolean();
  return { sourceRung, source };
}

function readTexture(at: JsonAt): TextureInfo {
  const colourSpace = at.at('colourSpace').text(100);
  if (colourSpace !== 'srgb' && colourSpace !== 'linear') at.fail('srgb or linear', colourSpace, 'X03');
  const codec = at.at('codec').text(100);
  if (!isCodec(codec)) return at.fail('a known codec', codec, 'X03');
  if (codec === 'jpeg-xy' && (colourSpace !== 'linear' || at.at('channels').integer(1, 3) !== 3))
    at.fail('jpeg-xy for three linear channels alone', codec, 'F24');
  const mip = at.has('mip') ? at.at('mip').integer(1, maxMip) : 0;
  const rungQuality: number[] = [];
  for (let i = 0, n = at.at('rungQuality').array(1, maxPackageRungs); i < n; ++i) {
    const quality = at.at('rungQuality').at(i).integer(1, 100);
    if (i > 0 && quality <= rungQuality[i - 1]) at.at('rungQuality').fail('rising numbers');
    rungQuality.push(quality);
  }
  return {
    image: at.at('image').integer(0, 0xffffffff),
    mip,
    base: mip > 0 ? at.at('base').integer(0, maxPackagePlanes) : 0,
    role: at.at('role').text(100),
    name: at.at('name').text(maxTextBytes),
    colourSpace: colourSpace as 'srgb' | 'linear',
    codec,
    ...readGrid(at),
    ...readSource(at, codec, mip),
    previewWidthPx: at.at('previewWidthPx').integer(1, maxSide),
    previewHeightPx: at.at('previewHeightPx').integer(1, maxSide),
    rungQuality,
  };
}

/** Mips stand behind the full-size planes by (base, mip), each of its base's image and size. */
function checkMips(list: JsonAt, textures: TextureInfo[]): void {
  const full = fullSizePlanes(textures);
  for (let p = full; p < textures.length; ++p) {
    const t = textures[p];
    if (t.mip === 0) list.at(p).fail('a mip', '', 'X06');
    if (t.base >= full) list.at(p).fail('a full-size base', t.base, 'X06');
    const base = textures[t.base];
    const before = p > full ? textures[p - 1] : undefined;
    if (before && (before.base > t.base || (before.base === t.base && t.mip <= before.mip)))
      list.at(p).fail('mips by base and mip', '', 'X06');
    const side = (px: number): number => Math.ceil(px / (1 << t.mip));
    if (t.widthPx !== side(base.widthPx) || t.heightPx !== side(base.heightPx))
      list.at(p).fail('sides of 1 / 2^mip of the full size', '', 'X07');
    const same = (['image', 'role', 'channels', 'colourSpace', 'previewWidthPx',
      'previewHeightPx'] as const).every((name) => t[name] === base[name]);
    if (!same) list.at(p).fail(`what plane ${t.base} has`, '', 'X07');
  }
}

/** Reads textures.json, strictly; FormatError names the place in the document. */
export function readTextures(json: Uint8Array): TextureInfo[] {
  const list = parseJson(json, paths.texturesPath, maxTexturesBytes).at('textures');
  const textures: TextureInfo[] = [];
  for (let i = 0, n = list.array(0, maxPackagePlanes); i < n; ++i) textures.push(readTexture(list.at(i)));
  checkMips(list, textures);
  return textures;
}

/** The first feature that a plane's codec needs and the package does not require; '' = none. */
export function missingFeature(textures: readonly TextureInfo[], features: readonly string[]): string {
  for (const t of textures) {
    const { requiredFeature } = codecTraits(t.codec);
    if (requiredFeature !== '' && !features.includes(requiredFeature)) return requiredFeature;
  }
  return '';
}
