import type { ManifestScale } from '../format/manifest';
import { type PlaneChoice, type TextureLoss, groupIndex } from './texture_loss';

// What choices take on the GPU, and what fits: textures are RGBA of 8 bits with all their mip levels.

/** Position, normal, texture coordinates and tangent, 32-bit floats. */
const vertexBytes = 4 * (3 + 3 + 2 + 4);
const triangleBytes = 3 * 4;
const texelBytes = 4;
/** A mesh may take so much of the memory where a coarser scale takes less. */
const meshShare = 0.5;

/** Bytes of a texture, px; `levels` left out: down to one texel. */
export function textureBytes(widthPx: number, heightPx: number, levels = 32 - Math.clz32(Math.max(widthPx, heightPx))): number {
  let bytes = 0;
  for (let level = 0; level < levels; ++level) bytes += texelBytes * Math.max(1, widthPx >> level) * Math.max(1, heightPx >> level);
  return bytes;
}
/** Most bytes of a scale's buffers. */
export const scaleBytes = ({ vertices, triangles }: Pick<ManifestScale, 'vertices' | 'triangles'>): number => vertexBytes * vertices + triangleBytes * triangles;

/** `scale`, or the next coarser one whose mesh leaves room for textures; the coarsest where none does. */
export function scaleWithin(scales: readonly ManifestScale[], scale: number, mostBytes: number): number {
  const fitting = scales.find((s) => s.scale >= scale && scaleBytes(s) <= meshShare * mostBytes);
  return fitting?.scale ?? scales[scales.length - 1]?.scale ?? scale;
}

/**
 * The planes, with coarser mips of those textures where a byte less loses least of the picture, until all take at most `mostBytes` or
 * none is coarser. Needs the tables of the full-size planes.
 */
export function planesWithin(loss: TextureLoss, planes: readonly PlaneChoice[], mostBytes: number): PlaneChoice[] {
  const { data, data: { textures } } = loss;
  const bytesOf = (plane: number): number => textureBytes(textures[plane].widthPx, textures[plane].heightPx);
  const chosen = planes.map((choice) => ({ ...choice }));
  const surface = loss.weights(chosen.map(({ base }) => ({ base, plane: base })));
  /** The next coarser mip; undefined where there is none. */
  const coarser = ({ base, plane }: PlaneChoice) => {
    const mips = textures.map((t, p) => ({ p, mip: t.mip > 0 && t.base === base ? t.mip : 0 })).filter(({ mip }) => mip > textures[plane].mip);
    return mips.sort((a, b) => a.mip - b.mip)[0]?.p;
  };
  for (let bytes = chosen.reduce((sum, { plane }) => sum + bytesOf(plane), 0); bytes > mostBytes; ) {
    let best: { at: number; plane: number; saved: number; price: number } | undefined;
    chosen.forEach((choice, at) => {
      const plane = coarser(choice);
      if (plane === undefined) return;
      const saved = bytesOf(choice.plane) - bytesOf(plane);
      const share = loss.plane(choice.base).weight / (surface[groupIndex(data, choice.base)] || 1);
      const price = ((loss.mip(plane) - loss.mip(choice.plane)) * share) / saved;
      if (!best || price < best.price) best = { at, plane, saved, price };
    });
    if (!best) break;
    chosen[best.at].plane = best.plane;
    bytes -= best.saved;
  }
  return chosen;
}
