// Paths of a package's entries (format/SPEC.md, section 3), and numbers that all readers go by.

/** The manifest with its ZIP header fits in this many bytes, whatever the model: one request bootstraps a client. */
export const bootstrapBytes = 16384;
/** What a client asks for in its first request: the manifest and most first pictures. See format/SPEC.md, section 3. */
export const startBytes = 45056;
/** A displayed height that is enough at any size: displayPx... of S_0 and the last step's upToPx. */
export const anyDisplayPx = 1e9;
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
