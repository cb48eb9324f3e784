import * as documents from '../format/documents';
import { FormatError, TexmeshError } from '../format/errors';
import { SplitStreamReader } from '../format/splits/split_stream';
import { decodePicture, enlargePicture } from './pictures';
import type { BlockLevel, BlockRequest, Pixels } from '../blocks/formats';
import type { WorkerAnswer, WorkerRequest } from './protocol';
import { splitInfo, splitUpdate } from './split_update';

// The work of workers: documents, digests, images, vertex splits. `handle` works on the main thread, too, where no worker can be
// had.

/** Buffers of all typed arrays in a value; several arrays may share one. */
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

/** What makes blocks is fetched where somebody asks for them: most loads never do. */
async function inBlocks(picture: ImageBitmap | Pixels, request: BlockRequest): Promise<[BlockLevel[], Transferable[]]> {
  const levels = await (await import(/* webpackIgnore: true */ /* @vite-ignore */ request.url)).toBlocks(picture, request);
  return [levels, buffersOf(levels)];
}

/** Answers a request; the second value lists objects that may be handed over instead of copied. */
export async function handle(request: WorkerRequest): Promise<[unknown, Transferable[]]> {
  switch (request.op) {
    case 'document': {
      const decoded = await (documents[request.name] as (...args: unknown[]) => unknown)(...request.args);
      return [decoded, buffersOf(decoded)];
    }
    case 'decode': {
      const levels = await decodePicture(request);
      return request.blocks ? inBlocks(levels[0], request.blocks) : [levels, levels];
    }
    case 'enlarge': {
      const levels = enlargePicture(request);
      return request.blocks ? inBlocks(levels[0], request.blocks) : [levels, levels];
    }
    case 'blocks':
      return inBlocks(request, request.blocks);
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
    return { name: error.name, message: error.message, parts: [error.file, error.place, error.expected, error.found, error.rule] };
  return { name: error instanceof Error ? error.name : 'Error', message: String((error as Error)?.message ?? error) };
}
