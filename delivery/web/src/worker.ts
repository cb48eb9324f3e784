import { samePrefix } from './bytes';
import { codecTraits, joinFragment } from './codec';
import { FormatError, TexmeshError } from './errors';
import { sha256 } from './sha256';
import { SplitStreamReader } from './split_stream';
import { splitUpdate } from './split_update';
import type { DecodeRequest, WorkerAnswer, WorkerRequest } from './worker_protocol';

// What happens off the main thread: digests, images, vertex splits. `handle` works on the main thread, too, where no
// worker can be had.

async function decode(request: DecodeRequest): Promise<ImageBitmap> {
  for (const [i, digest] of request.digests.entries())
    if (!samePrefix(await sha256(request.streams[i]), digest))
      throw new FormatError('fragment', '', 'bytes of the digest in tables.bin', 'others');
  const file = request.complete
    ? request.streams[0]
    : joinFragment(request.codec, request.tables, request.streams);
  const blob = new Blob([file as BlobPart], { type: codecTraits(request.codec).mediaType });
  return createImageBitmap(blob, {
    premultiplyAlpha: 'none',
    colorSpaceConversion: 'none',
    imageOrientation: 'none',
  } as ImageBitmapOptions);
}

const streams = new Map<number, { reader: SplitStreamReader; wedges: number }>();

/** Answers a request; the second value lists what may be handed over instead of copied. */
export async function handle(request: WorkerRequest): Promise<[unknown, Transferable[]]> {
  switch (request.op) {
    case 'decode': {
      const bitmap = await decode(request);
      return [bitmap, [bitmap]];
    }
    case 'split-open':
      streams.set(request.key, { reader: new SplitStreamReader(request.head), wedges: 0 });
      return [undefined, []];
    case 'split-add': {
      const stream = streams.get(request.key);
      if (!stream) throw new FormatError('mesh/stream.bin', '', 'a stream that was opened', 'none');
      await stream.reader.addBlocks(request.blocks);
      const update = splitUpdate(stream.reader, stream.wedges);
      stream.wedges = update.to;
      const arrays = [update.positions, update.index, update.groupTriangles, ...update.attributes];
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
