import { samePrefix } from '../format/bytes';
import { codecTraits } from '../format/codec';
import { FormatError } from '../format/errors';
import { imageSize } from '../format/image_size';
import { joinFragment } from '../format/join_fragment';
import { sha256 } from '../format/sha256';
import type { DecodeRequest, EnlargeRequest } from './protocol';

const asItIs = { premultiplyAlpha: 'none', colorSpaceConversion: 'none', imageOrientation: 'none' } as ImageBitmapOptions;

/** A fragment (or preview) as a picture and its halves; digests and size are checked first. */
export async function decodePicture(request: DecodeRequest): Promise<ImageBitmap[]> {
  for (const [i, digest] of request.digests.entries())
    if (!samePrefix(await sha256(request.streams[i]), digest))
      throw new FormatError('fragment', '', 'the digest of tables.bin', '', 'F03');
  const file = request.complete
    ? request.streams[0]
    : joinFragment(request.codec, request.tables, request.streams);
  const size = imageSize(file);
  if (!(size[0] > 0 && size[1] > 0 && size[0] <= request.most[0] && size[1] <= request.most[1]))
    throw new FormatError('fragment', '', `a picture of at most ${request.most.join(' x ')} px`, size.join(' x '), 'F08');
  const blob = new Blob([file as BlobPart], { type: codecTraits(request.codec).mediaType });
  const levels = [await createImageBitmap(blob, asItIs)];
  while (levels.length < request.levels) {
    const last = levels[levels.length - 1];
    const [resizeWidth, resizeHeight] = [last.width >> 1, last.height >> 1];
    if (resizeWidth < 1 || resizeHeight < 1) break;
    levels.push(await createImageBitmap(last, { ...asItIs, resizeWidth, resizeHeight, resizeQuality: 'low' }));
  }
  return levels;
}

/** A piece of an enlarged picture. Every piece is drawn as a part of the whole, so that pieces meet without a seam. */
export function enlargePicture({ picture, width, height, x0, x1, y0, y1, levels }: EnlargeRequest): ImageBitmap[] {
  const out: ImageBitmap[] = [];
  for (let level = 0; level < levels; ++level) {
    const [w, h, left, top] = [width >> level, height >> level, x0 >> level, y0 >> level];
    const columns = (x1 >= width ? w : x1 >> level) - left;
    const rows = (y1 >= height ? h : y1 >> level) - top;
    if (columns < 1 || rows < 1) break;
    const canvas = new OffscreenCanvas(columns, rows);
    const context = canvas.getContext('2d', { alpha: false, willReadFrequently: true })!;
    context.imageSmoothingQuality = 'low';
    context.drawImage(picture, -left, -top, w, h);
    out.push(canvas.transferToImageBitmap());
  }
  picture.close();
  return out;
}
