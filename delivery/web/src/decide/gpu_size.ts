import type { ManifestProxy, ManifestScale } from '../format/manifest';
import { proxyTextures, triangleBytes, vertexBytes } from '../format/shared_numbers';

// What choices take on the GPU, from manifest and textures.json alone:
// delivery/cpp/decide/texture_budget.cpp.

const levelsOf = (widthPx: number, heightPx: number): number => 32 - Math.clz32(Math.max(widthPx, heightPx));
/**
 * How texels are stored: RGBA of 8 bits, or blocks of 4 x 4 texels: block8 = BC1, ETC2 of three channels;
 * block16 = BC3, BC7, ETC2 of four, ASTC.
 */
export type GpuTexels = 'rgba8' | 'block8' | 'block16';
/** Bytes of a texture, px, with so many mip levels. */
export function textureBytes(widthPx: number, heightPx: number, levels = levelsOf(widthPx, heightPx),
    texels: GpuTexels = 'rgba8'): number {
  const ofLevel = (width: number, height: number): number =>
    texels === 'rgba8' ? 4 * width * height
      : Math.ceil(width / 4) * Math.ceil(height / 4) * (texels === 'block8' ? 8 : 16);
  let bytes = 0;
  for (let level = 0; level < levels; ++level)
    bytes += ofLevel(Math.max(1, widthPx >> level), Math.max(1, heightPx >> level));
  return bytes;
}
/** Most bytes of a scale's buffers. */
export const scaleBytes = ({ vertices, triangles }: Pick<ManifestScale, 'vertices' | 'triangles'>): number =>
  vertexBytes * vertices + triangleBytes * triangles;
/** Most bytes of a proxy. */
export const proxyBytes = (proxy: Pick<ManifestProxy, 'vertices' | 'triangles' | 'texturePx'>): number =>
  scaleBytes(proxy) + proxyTextures * textureBytes(proxy.texturePx, proxy.texturePx);
