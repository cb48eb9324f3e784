import { samePrefix } from './format/bytes';
import { codecTraits } from './format/codec';
import * as documents from './format/documents';
import { FormatError, TexmeshError } from './format/errors';
import { imageSize } from './format/image_size';
import { joinFragment } from './format/join_fragment';
import { sha256 } from './format/sha256';
import { SplitStreamReader } from './format/splits/split_stream';
import { splitInfo, splitUpdate } from './worker/split_update';
import type { DecodeRequest, EnlargeRequest, Levels, WorkerAnswer, WorkerRequest } from './worker/protocol';

// What happens off the main thread: documents, digests, images, vertex splits. `handle` works on the main thread, too, where no
// worker can be had.

const asItIs = { premultiplyAlpha: 'none', colorSpaceConversion: 'none', imageOrientation: 'none' } as ImageBitmapOptions;

async function decode(request: DecodeRequest): Promise<Levels> {
  for (const [i, digest] of request.digests.entries())
    if (!samePrefix(await sha256(request.streams[i]), digest))
      throw new FormatError('fragment', '', 'bytes of the digest in tables.bin', 'others');
  const file = request.complete
    ? request.streams[0]
    : joinFragment(request.codec, request.tables, request.streams);
  const size = imageSize(file);
  if (!(size[0] > 0 && size[1] > 0 && size[0] <= request.most[0] && size[1] <= request.most[1]))
    throw new FormatError('fragment', '', `a picture of at most ${request.most.join(' x ')} px`, size.join(' x '));
  const blob = new Blob([file as BlobPart], { type: codecTraits(request.codec).mediaType });
  const levels: Levels = [await createImageBitmap(blob, asItIs)];
  while (levels.length < request.levels) {
    const last = levels[levels.length - 1];
    const [resizeWidth, resizeHeight] = [last.width >> 1, last.height >> 1];
    if (resizeWidth < 1 || resizeHeight < 1) break;
    levels.push(await createImageBitmap(last, { ...asItIs, resizeWidth, resizeHeight, resizeQuality: 'low' }));
  }
  return levels;
}

/** Every piece is drawn as a part of the whole, so that pieces meet without a seam. */
function enlarge({ picture, width, height, x0, x1, y0, y1, levels }: EnlargeRequest): Levels {
  const out: Levels = [];
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

/** Those of all typed arrays in a value; several may share one. */
function buffersOf(value: unknown, found = new Set<ArrayBuffer>()): ArrayBuffer[] {
  if (ArrayBuffer.isView(value)) found.add(value.buffer as ArrayBuffer);
  else if (value instanceof Map) for (const v of value.values()) buffersOf(v, found);
  else if (typeof value === 'object' && value) for (const v of Object.values(value)) buffersOf(v, found);
  return [...found];
}

const streams = new Map<number, { reader: SplitStreamReader; wedges: number }>();

function streamOf(key: number): { reader: SplitStreamReader; wedges: number } {
  const stream = streams.get(key);
  if (!stream) throw new FormatError('mesh/stream.bin', '', 'a stream that was opened', 'none');
  return stream;
}

/** Answers a request; the second value lists what may be handed over instead of copied. */
export async function handle(request: WorkerRequest): Promise<[unknown, Transferable[]]> {
  switch (request.op) {
    case 'document': {
      const decoded = await (documents[request.name] as (...args: unknown[]) => unknown)(...request.args);
      return [decoded, buffersOf(decoded)];
    }
    case 'decode': {
      const levels = await decode(request);
      return [levels, levels];
    }
    case 'enlarge': {
      const levels = enlarge(request);
      return [levels, levels];
    }
    case 'split-open': {
      const reader = new SplitStreamReader(request.head);
      streams.set(request.key, { reader, wedges: 0 });
      return [splitInfo(reader.head), []];
    }
    case 'split-check':
      await streamOf(request.key).reader.check(request.from, request.blocks);
      return [undefined, []];
    case 'split-add': {
      const stream = streamOf(request.key);
      await stream.reader.addBlocks(request.blocks);
      const update = splitUpdate(stream.reader, stream.wedges);
      stream.wedges = update.to;
      const arrays = [update.index, ...update.attributes.map((a) => a.values)];
      return [update, arrays.map((a) => a.buffer as ArrayBuffer)];
    }
    case 'split-close':
      streams.delete(request.key);
      return [undefined, []];
  }
}

/** Errors lose their class on the way; their parts do not. */
export function packError(error: unknown): WorkerAnswer['error'] {
  if (error instanceof TexmeshError)
    return { name: error.name, message: error.message, parts: [error.file, error.place, error.expected, error.found] };
  return { name: error instanceof Error ? error.name : 'Error', message: String((error as Error)?.message ?? error) };
}

interface WorkerScope {
  onmessage: ((event: { data: WorkerRequest & { id: number } }) => void) | null;
  postMessage(answer: WorkerAnswer, transfer: Transferable[]): void;
}
const scope = globalThis as unknown as WorkerScope & { WorkerGlobalScope?: unknown };
if (typeof scope.WorkerGlobalScope !== 'undefined')
  scope.onmessage = ({ data }) => {
    handle(data).then(
      ([result, transfer]) => scope.postMessage({ id: data.id, result }, transfer),
      (error: unknown) => scope.postMessage({ id: data.id, error: packError(error) }, []),
    );
  };
