import type { ManifestScale } from '../format/manifest';
import { meshShare } from '../format/shared_numbers';
import type { TextureInfo } from '../format/textures';
import { scaleBytes, textureBytes } from './gpu_size';
import { type PlaneChoice, type TextureLoss, groupIndex } from './texture_loss';

// What fits into the GPU's memory.

/** `scale`, or the next coarser one whose mesh leaves room for textures; the coarsest where none does. */
export function scaleWithin(scales: readonly ManifestScale[], scale: number, mostBytes: number): number {
  const fitting = scales.find((s) => s.scale >= scale && scaleBytes(s) <= meshShare * mostBytes);
  return fitting?.scale ?? scales[scales.length - 1]?.scale ?? scale;
}

/** Planes as RGBA. */
export const rgbaBytes = (textures: readonly TextureInfo[]): BytesOf =>
  (plane) => textureBytes(textures[plane].widthPx, textures[plane].heightPx);
/** Bytes of a plane on the GPU, as its texels are stored. */
export type BytesOf = (plane: number) => number;

/** The first way to store texels by which these planes take at most `mostBytes`; else the last one. */
export function wayWithin(planes: readonly PlaneChoice[], mostBytes: number,
    ways: readonly BytesOf[]): number {
  const way =
    ways.findIndex((bytesOf) => planes.reduce((sum, { plane }) => sum + bytesOf(plane), 0) <= mostBytes);
  return way < 0 ? ways.length - 1 : way;
}

/**
 * The planes, with coarser mips of those textures where a byte less loses least of the picture, until all
 * take at most `mostBytes` or none is coarser. Needs the tables of the full-size planes. With several `ways`
 * to store texels, those of the first by which all fit, or of the last.
 */
export function planesWithin(loss: TextureLoss, planes: readonly PlaneChoice[], mostBytes: number,
    ways: readonly BytesOf[] = [rgbaBytes(loss.data.textures)]): PlaneChoice[] {
  const { data, data: { textures } } = loss;
  const bytesOf = ways[wayWithin(planes, mostBytes, ways)];
  const chosen = planes.map((choice) => ({ ...choice }));
  const surface = loss.weights(chosen.map(({ base }) => ({ base, plane: base })));
  /** The next coarser mip; undefined where there is none. */
  const coarser = ({ base, plane }: PlaneChoice) => {
    const mips = textures.map((t, p) => ({ p, mip: t.mip > 0 && t.base === base ? t.mip : 0 }))
      .filter(({ mip }) => mip > textures[plane].mip);
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
