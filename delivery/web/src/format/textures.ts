import type { CodecId } from './codec';

/** One texture plane of textures.json (format/SPEC.md, section 7). */
export interface TextureInfo {
  /** GLB image "texture/<image>". */
  image: number;
  /** Sides are 1 / 2^mip of the full-size plane's, rounded up. */
  mip: number;
  /** Of a mip: the full-size plane. */
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
  /** The last rung loses nothing of the source: shown as any other, and fetched where it is asked for or refining is to go so far. */
  lossless: boolean;
  /** Ending of the source's own file among the entries, source/PPP.EXT; "" = none. Loads leave it alone; PackageReader.entry reads it. */
  source: string;
}

/** How many of the planes have full size; they stand first. */
export function fullSizePlanes(textures: readonly TextureInfo[]): number {
  const mip = textures.findIndex((t) => t.mip > 0);
  return mip < 0 ? textures.length : mip;
}
