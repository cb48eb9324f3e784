import { CodecId, codecTraits, isCodec } from './codec';
import * as paths from './entry_paths';
import { JsonAt, parseJson } from './json_fields';
import { fullSizePlanes } from './layout';

/** One texture plane of textures.json (format/SPEC.md, section 7). */
export interface TextureInfo {
  /** GLB image "texture/<image>". */
  image: number;
  /** Sides are 1 / 2^mip of the full-size plane's, rounded up. */
  mip: number;
  /** The full-size plane of a mip. */
  base: number;
  /** base-colour, emissive, normal, occlusion-roughness-metallic, alpha, colour, data, or one of a later version. */
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
  /** The last rung holds the coefficients of the source, a JPEG. That rung is shown as any other, and fetched where a load asks for it or refines so far. */
  sourceRung: boolean;
  /** Ending of the source file among the entries, source/PPP.EXT; "" = none. Loads leave that file alone; PackageReader.entry reads it. */
  source: string;
}

const mostSide = 1 << 20;

function readGrid(at: JsonAt) {
  const integer = (name: string, least: number, most: number): number => at.at(name).integer(least, most);
  const grid = {
    widthPx: integer('widthPx', 1, mostSide),
    heightPx: integer('heightPx', 1, mostSide),
    channels: integer('channels', 1, 3),
    fragmentWidthPx: integer('fragmentWidthPx', 1, mostSide),
    fragmentHeightPx: integer('fragmentHeightPx', 1, mostSide),
    columns: integer('columns', 1, 65535),
    rows: 0,
    gridReason: '',
  };
  if (grid.channels === 2) at.at('channels').fail('1 or 3', '2');
  if (grid.fragmentWidthPx % 16 || grid.fragmentHeightPx % 16)
    at.fail('sides of fragments that are multiples of 16', `${grid.fragmentWidthPx} x ${grid.fragmentHeightPx}`);
  grid.rows = integer('rows', 1, Math.floor(65535 / grid.columns));
  const tiles = (count: number, side: number, whole: number): boolean =>
    count * side >= whole && (count - 1) * side < whole;
  if (!tiles(grid.columns, grid.fragmentWidthPx, grid.widthPx))
    at.at('columns').fail('as many as cover the width', `${grid.columns}`);
  if (!tiles(grid.rows, grid.fragmentHeightPx, grid.heightPx))
    at.at('rows').fail('as many as cover the height', `${grid.rows}`);
  grid.gridReason = at.at('gridReason').text(1000);
  return grid;
}

const sourceEndings = ['jpg', 'png', 'tif', 'webp', 'exr'];

/** Fields about the source itself. */
function readSource(at: JsonAt, codec: CodecId, mip: number): { sourceRung: boolean; source: string } {
  const sourceRung = at.has('sourceRung') && at.at('sourceRung').boolean();
  if (sourceRung && (codec !== 'jpeg' || mip > 0)) at.at('sourceRung').fail('a full-size plane of codec jpeg', 'another');
  if (!at.has('source')) return { sourceRung, source: '' };
  const source = at.at('source').text(100);
  if (!sourceEndings.includes(source) || mip > 0) at.at('source').fail('jpg, png, tif, webp or exr of a full-size plane', source);
  at.at('sourceColours').boolean();
  return { sourceRung, source };
}

function readTexture(at: JsonAt): TextureInfo {
  const colourSpace = at.at('colourSpace').text(100);
  if (colourSpace !== 'srgb' && colourSpace !== 'linear') at.at('colourSpace').fail('srgb or linear', colourSpace);
  const codec = at.at('codec').text(100);
  if (!isCodec(codec)) return at.at('codec').fail('jpeg, jpeg-progressive or webp', codec);
  const mip = at.has('mip') ? at.at('mip').integer(1, 20) : 0;
  const rungQuality: number[] = [];
  for (let i = 0, n = at.at('rungQuality').array(1, 100); i < n; ++i) {
    const quality = at.at('rungQuality').at(i).integer(1, 100);
    if (i > 0 && quality <= rungQuality[i - 1]) at.at('rungQuality').at(i).fail('a rising number', `${quality}`);
    rungQuality.push(quality);
  }
  return {
    image: at.at('image').integer(0, 0xffffffff),
    mip,
    base: mip > 0 ? at.at('base').integer(0, 10000) : 0,
    role: at.at('role').text(100),
    name: at.at('name').text(1000),
    colourSpace: colourSpace as 'srgb' | 'linear',
    codec,
    ...readGrid(at),
    ...readSource(at, codec, mip),
    previewWidthPx: at.at('previewWidthPx').integer(1, mostSide),
    previewHeightPx: at.at('previewHeightPx').integer(1, mostSide),
    rungQuality,
  };
}

/** Mips stand behind the full-size planes by (base, mip), each of its base's image and size. */
function checkMips(list: JsonAt, textures: TextureInfo[]): void {
  const full = fullSizePlanes(textures);
  for (let p = full; p < textures.length; ++p) {
    const t = textures[p];
    if (t.mip === 0) list.at(p).fail('a mip, as the plane before is one', 'a full-size plane');
    if (t.base >= full) list.at(p).at('base').fail('a full-size plane', `${t.base}`);
    const base = textures[t.base];
    const before = p > full ? textures[p - 1] : undefined;
    if (before && (before.base > t.base || (before.base === t.base && t.mip <= before.mip)))
      list.at(p).at('mip').fail('mips by base and mip', `${t.mip}`);
    const side = (px: number): number => Math.ceil(px / (1 << t.mip));
    if (t.widthPx !== side(base.widthPx) || t.heightPx !== side(base.heightPx))
      list.at(p).at('widthPx').fail('sides of 1 / 2^mip of the full size, rounded up', `${t.widthPx}`);
    const same = (['image', 'role', 'channels', 'colourSpace', 'previewWidthPx', 'previewHeightPx'] as const).every(
      (name) => t[name] === base[name],
    );
    if (!same) list.at(p).fail(`image, role, channels, colour space and preview of plane ${t.base}`, 'others');
  }
}

/** Reads textures.json, strictly; FormatError names the place in the document. */
export function readTextures(json: Uint8Array): TextureInfo[] {
  const list = parseJson(json, paths.texturesPath, 32 << 20).at('textures');
  const textures: TextureInfo[] = [];
  for (let i = 0, n = list.array(0, 10000); i < n; ++i) textures.push(readTexture(list.at(i)));
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
