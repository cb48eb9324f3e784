import { Source, type Texture, type WebGLRenderer } from 'three';
import type { BlockFormat } from '../../blocks/formats';
import type { BytesOf } from '../../decide/gpu_memory';
import type { TextureInfo } from '../../format/textures';
import type { WorkerPool } from '../../worker/pool';
import type { PlaneComposer } from '../composer';
import { eachPiece, uploadAll } from '../enlarge';
import type { LoadContext } from '../load_context';
import type { UploadQueue } from '../upload_queue';
import { BlockStorage, readPicture } from './block_storage';
import { type BlockChoice, blocksFor, bytesBy, formatsOf } from './gpu_formats';
import { readTwoChannels } from './two_channels';

/** Fills a plane of blocks with a texture: the GPU draws it piece by piece, workers make the blocks. */
export async function refill(next: PlaneComposer, from: Texture, format: BlockFormat | undefined,
    renderer: WebGLRenderer, pool: WorkerPool, uploads: UploadQueue): Promise<void> {
  await eachPiece(next, uploads, async ({ x0, x1, y0, y1 }) => {
    const [width, height] = [x1 - x0, y1 - y0];
    let pixels: Uint8Array | undefined;
    await uploads.enqueue(width * height, () => (pixels = readPicture(renderer, from, format,
      { x: x0, y: y0, width, height, of: [next.widthPx, next.heightPx] })));
    if (!pixels) return; // the load has ended
    const levels = await pool.blocksOf({ pixels, width, height, blocks: next.blocks!.request(x0, y0) });
    await uploadAll(uploads, next.uploads(levels, x0, y0));
  });
}

/** A plane to be stored, and what its load works with. */
export interface StorageOptions {
  renderer: WebGLRenderer;
  pool: WorkerPool;
  uploads: UploadQueue;
  info: TextureInfo;
  format: BlockFormat;
  /** Counts what is under way. */
  pending(by: 1 | -1): void;
  /** Fills a further storage of the plane. */
  refill(from: Texture): void;
}
/** Textures as blocks; this module is loaded where a load wants them. */
export interface Compression {
  /** Ways to store the planes, the best pictures first, and the bytes of each. */
  ways: BlockChoice[];
  bytes: BytesOf[];
  storage(of: StorageOptions): BlockStorage;
  refill: typeof refill;
  readTwoChannels: typeof readTwoChannels;
}

/** undefined: the GPU has no formats, three.js is too old, or a worker cannot make blocks. */
export async function openCompression({ options, pool }: LoadContext,
    textures: readonly TextureInfo[]): Promise<Compression | undefined> {
  const { renderer, workerUrl, blocksUrl, compress } = options;
  const formats = formatsOf(renderer);
  // before three.js r162 a storage wants its texels at once
  if (formats.size === 0 || !('dataReady' in new Source(null))) return undefined;
  const url = blocksUrl ? new URL(blocksUrl, location.href) : workerUrl
    ? new URL('./blocks.js', new URL(workerUrl, location.href)) : new URL('./blocks.js', import.meta.url);
  const [format] = formats;
  await pool.blocksOf({ pixels: new Uint8Array(64), width: 4, height: 4,
    blocks: { url: url.href, format, own: 1, size: [4, 4] } });
  const storage = ({ renderer: gpu, pool: workers, uploads, info, format: stored, pending,
    refill: filled }: StorageOptions): BlockStorage =>
    new BlockStorage(gpu, info, stored, {
      encode: (picture, blocks) => workers.blocksOf({ ...picture, blocks }),
      enqueue: ({ pixels, run }) => uploads.enqueue(pixels, run),
      pending, blocksUrl: url.href,
    }, filled);
  const always = compress === 'always';
  const blocks = blocksFor(textures, formats, always);
  const ways: BlockChoice[] = always ? [blocks] : [() => undefined, blocks];
  return { ways, bytes: ways.map((way) => bytesBy(textures, way)), refill, readTwoChannels, storage };
}
