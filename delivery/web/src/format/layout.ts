// Paths of a package's entries (format/SPEC.md, section 3), and numbers that all readers go by.

export { anyDisplayPx, bootstrapBytes, startBytes } from './shared_numbers';
/** Previews are no larger: every GPU takes textures of this size. */
export const mostPreviewPx = 4096;
/** Path of the vertex-split stream. */
export const splitStreamPath = 'mesh/stream.bin';
/** Path of the picture of the whole object. */
export const posterPath = 'poster.jpg';

const digits = (n: number, least: number): string => String(n).padStart(least, '0');

/** Path of a preview, as preview/003.jpg. */
export const previewPath = (plane: number): string => `preview/${digits(plane, 3)}.jpg`;
/** Path of a rung's pack, as texture/3/r07.pack. */
export const rungPath = (plane: number, rung: number): string => `texture/${plane}/r${digits(rung, 2)}.pack`;

/** Number of full-size planes, which stand before the mips. */
export function fullSizePlanes(textures: readonly { mip: number }[]): number {
  const mip = textures.findIndex((t) => t.mip > 0);
  return mip < 0 ? textures.length : mip;
}
