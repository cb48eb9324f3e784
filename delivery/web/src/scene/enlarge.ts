import type { PlaneComposer } from './composer';
import { ownLevels } from './plane_storage';
import type { Upload } from './blocks/block_storage';
import type { UploadQueue } from './upload_queue';
import type { WorkerPool } from '../worker/pool';
import type { PictureArea } from '../worker/protocol';

// Enlarging for machines whose processor draws for want of a GPU, and for previews of coverage.

/** Pixels of a piece of an enlarged preview, which is uploaded in one go; and pieces under way at once. */
const stripPx = 1 << 18;
const mostPieces = 4;

export interface Piece extends PictureArea {
  /** Fragments in it, [from, to). */
  from: number;
  to: number;
}

/** Resolves when no piece may come over this fragment any more; rejects where workers cannot draw. */
export type Clear = (fragment: number) => Promise<unknown>;

/** Enlarges a preview in workers, piece by piece. Pieces that fragments cover already need none. */
export function enlarge(next: PlaneComposer, image: ImageBitmap | HTMLImageElement, pool: WorkerPool,
    uploads: UploadQueue): { clear?: Clear; done: Promise<void> } {
  const underWay = new Map<Piece, Promise<void>>();
  let first: Promise<void> | undefined;
  const done = eachPiece(next, uploads, (piece) => {
    const made = enlargePiece(next, image, piece, pool, uploads).finally(() => underWay.delete(piece));
    underWay.set(piece, made);
    first ??= made;
    return made;
  });
  const clear: Clear = async (fragment) => {
    await first; // whoever has made one piece will make the others
    await Promise.all([...underWay].map(([{ from, to }, made]) => fragment >= from && fragment < to && made));
  };
  return next.blocks ? { done } : { clear, done };
}

/** Works on all pieces, a few at once. */
export async function eachPiece(next: PlaneComposer, uploads: UploadQueue,
    work: (piece: Piece) => Promise<void>): Promise<void> {
  const running = new Set<Promise<void>>();
  for (const piece of pieces(next)) {
    const done = work(piece).finally(() => running.delete(done));
    done.catch(() => undefined); // the first to fail is told
    running.add(done);
    if (running.size >= mostPieces) await Promise.race(running);
    if (uploads.disposed) break;
  }
  await Promise.all(running);
}

/** Runs of neighbouring fragments that have not come when the turn of the run comes. */
function* pieces(next: PlaneComposer): Generator<Piece> {
  const { columns, rows, fragmentWidthPx: width, fragmentHeightPx: height } = next.info;
  const step = next.blocks ? 4 << (next.blocks.own - 1) : 16; // of blocks, all levels begin with a block
  const rise = Math.min(height, Math.max(step, Math.floor(stripPx / width) & ~(step - 1)));
  const most = Math.max(1, Math.floor(stripPx / (width * rise)));
  for (let row = 0; row < rows; ++row)
    for (let y = row * height; y < Math.min((row + 1) * height, next.heightPx); y += rise)
      for (let from = 0, to = 0; from < columns; from = to) {
        const lacks = (column: number): boolean => column < columns && !next.come.has(row * columns + column);
        to = from + 1;
        if (!lacks(from)) continue;
        while (to - from < most && lacks(to)) ++to;
        const [x1, y1] = [Math.min(to * width, next.widthPx),
          Math.min(y + rise, (row + 1) * height, next.heightPx)];
        yield { x0: from * width, x1, y0: y, y1, from: row * columns + from, to: row * columns + to };
      }
}

async function enlargePiece(next: PlaneComposer, image: ImageBitmap | HTMLImageElement, piece: Piece,
    pool: WorkerPool, uploads: UploadQueue): Promise<void> {
  const picture = await createImageBitmap(image, { premultiplyAlpha: 'none', colorSpaceConversion: 'none' });
  const { widthPx: width, heightPx: height } = next;
  const { x0, x1, y0, y1 } = piece;
  const blocks = next.blocks &&
    { ...next.blocks.request(x0, y0), size: [x1 - x0, y1 - y0] as [number, number] };
  const bitmaps = await pool
    .enlarge({ picture, width, height, ...piece, levels: blocks ? 1 : ownLevels, blocks })
    .finally(() => picture.close()); // workers have a copy of their own
  await uploadAll(uploads, next.uploads(bitmaps, x0, y0));
  bitmaps.forEach((b) => b.close?.());
}

/** Resolves when all have ended. */
export async function uploadAll(uploads: UploadQueue, all: readonly Upload[]): Promise<void> {
  await Promise.all(all.map(({ pixels, run }) => uploads.enqueue(pixels, run)));
}
