import type { ManifestScale } from '../../format/manifest';

// What choices take on the GPU: textures are RGBA of 8 bits with all their mip levels.

/** Position, normal, texture coordinates and tangent, 32-bit floats. */
const vertexBytes = 4 * (3 + 3 + 2 + 4);
const triangleBytes = 3 * 4;
const texelBytes = 4;
/** Bytes of a texture, px; `levels` left out: down to one texel. */
export function textureBytes(widthPx: number, heightPx: number, levels = 32 - Math.clz32(Math.max(widthPx, heightPx))): number {
  let bytes = 0;
  for (let level = 0; level < levels; ++level) bytes += texelBytes * Math.max(1, widthPx >> level) * Math.max(1, heightPx >> level);
  return bytes;
}
/** Most bytes of a scale's buffers. */
export const scaleBytes = ({ vertices, triangles }: Pick<ManifestScale, 'vertices' | 'triangles'>): number => vertexBytes * vertices + triangleBytes * triangles;
