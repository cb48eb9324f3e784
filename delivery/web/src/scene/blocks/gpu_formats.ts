import { RED_GREEN_RGTC2_Format, RGBA_ASTC_4x4_Format, RGBA_BPTC_Format, RGBA_S3TC_DXT5_Format,
  RGB_ETC2_Format, RGB_S3TC_DXT1_Format, type WebGLRenderer } from 'three';
import { type BlockFormat, blockBytes } from '../../blocks/formats';
import type { BytesOf } from '../../decide/gpu_memory';
import { textureBytes } from '../../decide/gpu_size';
import type { TextureInfo } from '../../format/textures';

/** How the planes of a package are stored: RGBA, or blocks of a format that suits each. */
export type BlockChoice = (plane: number) => BlockFormat | undefined;

/** three.js's number for a format. */
export const threeFormats = {
  bc1: RGB_S3TC_DXT1_Format, 'bc3-normal': RGBA_S3TC_DXT5_Format, bc5: RED_GREEN_RGTC2_Format,
  bc7: RGBA_BPTC_Format, etc2: RGB_ETC2_Format, astc: RGBA_ASTC_4x4_Format,
  'astc-normal': RGBA_ASTC_4x4_Format,
} as const;

/** Smaller textures are not worth it, and their levels end within a block. */
const leastPx = 64;
/**
 * Colours, best first. RGBA of half the sides, which takes as much as BC7 and ASTC and twice as much as BC1
 * and ETC2, looks worse than the first two and better than the others (docs/figures.md), so that memory alone
 * is no reason for those. Normals stand in two channels.
 */
const better = ['bc7', 'astc'] as const;
const colours = [...better, 'bc1', 'etc2'] as const;
const normals = ['bc5', 'astc-normal', 'bc3-normal'] as const;

/** Formats that the renderer's GPU has. */
export function formatsOf(renderer: WebGLRenderer): Set<BlockFormat> {
  const gl = renderer.getContext();
  const has = (name: string): boolean => gl.getExtension(name) !== null;
  const found = new Set<BlockFormat>();
  if (has('WEBGL_compressed_texture_s3tc') && has('WEBGL_compressed_texture_s3tc_srgb'))
    found.add('bc1').add('bc3-normal');
  if (has('EXT_texture_compression_rgtc')) found.add('bc5');
  if (has('EXT_texture_compression_bptc')) found.add('bc7');
  if (has('WEBGL_compressed_texture_etc')) found.add('etc2');
  if (has('WEBGL_compressed_texture_astc')) found.add('astc').add('astc-normal');
  return found;
}

/**
 * Blocks for each plane that a format suits; with `any`, formats that look worse than coarser mips, too.
 * Coverage has edges, which those blur.
 */
export function blocksFor(textures: readonly TextureInfo[], formats: ReadonlySet<BlockFormat>,
    any: boolean): BlockChoice {
  const first = (of: readonly BlockFormat[], { widthPx, heightPx }: TextureInfo): BlockFormat | undefined => {
    const whole = widthPx % 4 === 0 && heightPx % 4 === 0; // what BC wants of level 0
    return Math.min(widthPx, heightPx) < leastPx ? undefined
      : of.find((f) => formats.has(f) && (whole || !f.startsWith('bc')));
  };
  return (plane) => {
    const { role } = textures[plane];
    return first(role === 'normal' ? normals : role === 'alpha' || !any ? better : colours, textures[plane]);
  };
}

/** Bytes of planes that are stored this way. */
export function bytesBy(textures: readonly TextureInfo[], way: BlockChoice): BytesOf {
  return (plane) => {
    const format = way(plane);
    return textureBytes(textures[plane].widthPx, textures[plane].heightPx, undefined,
      format ? (blockBytes(format) === 8 ? 'block8' : 'block16') : 'rgba8');
  };
}
