import type { Texture, WebGLRenderer } from 'three';
import type { BlockFormat } from '../../blocks/formats';
import type { WorkerPool } from '../../worker/pool';
import type { PlaneComposer } from '../composer';
import { eachPiece, uploadAll } from '../enlarge';
import type { UploadQueue } from '../upload_queue';
import { readPicture } from './read_picture';

/** Fills a plane of blocks with a texture, scaled bilinearly: the GPU draws it piece by piece, workers make the blocks. */
export async function refill(next: PlaneComposer, from: Texture, format: BlockFormat | undefined, renderer: WebGLRenderer, pool: WorkerPool, uploads: UploadQueue): Promise<void> {
  await eachPiece(next, uploads, async ({ x0, x1, y0, y1 }) => {
    const [width, height] = [x1 - x0, y1 - y0];
    let pixels: Uint8Array | undefined;
    await uploads.enqueue(width * height, () => (pixels = readPicture(renderer, from, format, { x: x0, y: y0, width, height, of: [next.widthPx, next.heightPx] })));
    if (!pixels) return; // the load has ended
    const levels = await pool.blocksOf({ pixels, width, height, blocks: next.blocks!.request(x0, y0) });
    await uploadAll(uploads, next.uploads(levels, x0, y0));
  });
}
