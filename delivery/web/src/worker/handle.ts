import type { BlockLevel, BlockRequest, Pixels } from '../blocks/formats';
import { samePrefix, sha256 } from '../format/sha256';
import { codecTraits, joinFragment } from '../format/codec';
import * as documents from '../format/documents';
import { FormatError, TexmeshError } from '../format/errors';
import { imageSize } from '../format/image_size';
import { type SplitGrid, type SplitStreamHead, SplitStreamReader } from '../format/splits/split_stream';
import { octahedralVector } from '../format/splits/split_values';
import type {
  DecodeRequest, EnlargeRequest, SplitInfo, SplitUpdate, WorkerAnswer, WorkerRequest,
} from './protocol';
import { makeTangents } from './tangents';

const asItIs =
  { premultiplyAlpha: 'none', colorSpaceConversion: 'none', imageOrientation: 'none' } as ImageBitmapOptions;

/** A fragment (or preview) as a picture and its halves; digests and size are checked first. */
async function decodePicture(request: DecodeRequest): Promise<ImageBitmap[]> {
  for (const [i, digest] of request.digests.entries())
    if (!samePrefix(await sha256(request.streams[i]), digest))
      throw new FormatError('fragment', '', 'the digest of tables.bin', '', 'F03');
  const file = request.complete
    ? request.streams[0]
    : joinFragment(request.codec, request.tables, request.streams);
  const size = imageSize(file);
  if (!(size[0] > 0 && size[1] > 0 && size[0] <= request.most[0] && size[1] <= request.most[1]))
    throw new FormatError('fragment', '', `a picture of at most ${request.most.join(' x ')} px`,
      size.join(' x '), 'F08');
  const blob = new Blob([file as BlobPart], { type: codecTraits(request.codec).mediaType });
  const levels = [await createImageBitmap(blob, asItIs)];
  while (levels.length < request.levels) {
    const last = levels[levels.length - 1];
    const [resizeWidth, resizeHeight] = [last.width >> 1, last.height >> 1];
    if (resizeWidth < 1 || resizeHeight < 1) break;
    levels.push(await createImageBitmap(last,
      { ...asItIs, resizeWidth, resizeHeight, resizeQuality: 'low' }));
  }
  return levels;
}

/** A piece of an enlarged picture, drawn as a part of the whole: pieces meet without a seam. */
function enlargePicture({ picture, width, height, x0, x1, y0, y1, levels }: EnlargeRequest): ImageBitmap[] {
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

const f = Math.fround;
const names = { uv0: 'uv', uv1: 'uv1', normal: 'normal', colour: 'color' } as const;

/** The facts of a head that the main thread needs. */
function splitInfo(head: SplitStreamHead): SplitInfo {
  const scales = head.scales.map(({ scale, blocks, wedges }) => {
    const last = head.blocks[blocks - 1];
    return { scale, blocks, wedges, end: last.offset + last.bytes };
  });
  return { headBytes: head.bytes, scales };
}

function gridValues(places: Int32Array, stride: number, grid: SplitGrid, count: number,
    placeOf: (i: number) => number): Float32Array {
  const step = f(grid.range / f(2 ** grid.bits - 1));
  const out = new Float32Array(count * stride);
  for (let i = 0; i < count; ++i) {
    const from = placeOf(i) * stride;
    for (let k = 0; k < stride; ++k) out[i * stride + k] = f(f(places[from + k] * step) + grid.origin[k]);
  }
  return out;
}

function normals(codes: Int32Array, from: number, to: number, bits: number): Float32Array {
  const out = new Float32Array(3 * (to - from));
  for (let w = from; w < to; ++w) {
    const [x, y, z] = octahedralVector(codes[2 * w], codes[2 * w + 1], bits);
    const length = Math.sqrt(x * x + y * y + z * z);
    out.set(length > 0 ? [x / length, y / length, z / length] : [0, 0, 1], 3 * (w - from));
  }
  return out;
}

/** The values of some wedges. */
function wedgeValues({ mesh, head }: SplitStreamReader, from: number, to: number): SplitUpdate['attributes'] {
  const points = mesh.wedgePoint.data;
  const positions = gridValues(mesh.places.data, 3, head.position, to - from, (i) => points[from + i]);
  const attributes = [{ name: 'position', components: 3, values: positions }];
  head.attributes.forEach(({ kind, grid }, k) => {
    const data = mesh.values[k].data;
    const most = 2 ** grid.bits - 1;
    const values =
      kind === 'normal' ? normals(data, from, to, grid.bits)
      : kind === 'colour' ? Float32Array.from(data.subarray(4 * from, 4 * to), (v) => v / most)
      : gridValues(data, 2, grid, to - from, (i) => from + i);
    attributes.push({ name: names[kind], components: kind === 'normal' ? 3 : kind === 'colour' ? 4 : 2,
      values });
  });
  return attributes;
}

/** Adds tangents to an update, those of one set of texture coordinates. */
function addTangents(update: SplitUpdate, reader: SplitStreamReader, texcoords: number[]): void {
  const set = texcoords.find((texcoord) => texcoord >= 0);
  if (set === undefined) return;
  const all = wedgeValues(reader, 0, update.to);
  const valuesOf = (name: string): Float32Array | undefined => all.find((a) => a.name === name)?.values;
  const [positions, normal, uv] = ['position', 'normal', set === 1 ? 'uv1' : 'uv'].map(valuesOf);
  if (!positions || !normal || !uv) return;
  const wanted = update.draws.filter(({ material }) => texcoords[material] === set);
  const index = Uint32Array.from(wanted.flatMap(({ start, count }) =>
    [...update.index.subarray(start, start + count)]));
  update.tangents = makeTangents({ positions, normals: normal, uv, index });
  let at = 0;
  for (const { start, count } of wanted) update.index.set(index.subarray(at, (at += count)), start);
}

/** Wedges from number `from` on, and the index of all triangles, for append-only buffers. */
function splitUpdate(reader: SplitStreamReader, from: number, tangents: number[]): SplitUpdate {
  const { mesh, head } = reader;
  const to = mesh.wedges;
  const groupTriangles = new Uint32Array(head.groups.length);
  const visible = new Uint8Array(mesh.faceCount);
  for (let face = 0; face < visible.length; ++face)
    if (mesh.isVisible(face)) {
      visible[face] = 1;
      ++groupTriangles[mesh.faceGroup.data[face]];
    }
  let total = 0;
  const next = groupTriangles.map((n) => (total += n) - n);
  const index = new Uint32Array(3 * total);
  for (let face = 0; face < visible.length; ++face)
    if (visible[face])
      index.set(mesh.faces.data.subarray(3 * face, 3 * face + 3), 3 * next[mesh.faceGroup.data[face]]++);
  const draws: SplitUpdate['draws'] = [];
  let start = 0;
  for (const [g, { material }] of head.groups.entries()) {
    const count = 3 * groupTriangles[g];
    const last = draws[draws.length - 1];
    // Neighbours of one material are drawn together.
    if (last?.material === material) last.count += count;
    else if (count > 0) draws.push({ material, start, count });
    start += count;
  }
  const attributes = wedgeValues(reader, from, to);
  const update: SplitUpdate = { from, to, blocks: reader.nextBlock, attributes, index, draws };
  addTangents(update, reader, tangents);
  return update;
}

// The work of workers: documents, digests, images, vertex splits. `handle` works on the main thread, too,
// where no worker can be had.

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
async function inBlocks(picture: ImageBitmap | Pixels, request: BlockRequest): Promise<[BlockLevel[],
    Transferable[]]> {
  const levels =
    await (await import(/* webpackIgnore: true */ /* @vite-ignore */ request.url)).toBlocks(picture, request);
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
      const update = splitUpdate(stream.reader, stream.wedges, request.tangents);
      stream.wedges = update.to;
      return [update, buffersOf(update)];
    }
    case 'split-close':
      streams.delete(request.key);
      return [undefined, []];
  }
}

/** Errors lose their class on the way; their parts do not. */
export function packError(error: unknown): WorkerAnswer['error'] {
  if (error instanceof TexmeshError)
    return { name: error.name, message: error.message,
      parts: [error.file, error.place, error.expected, error.found, error.rule] };
  return { name: error instanceof Error ? error.name : 'Error',
    message: String((error as Error)?.message ?? error) };
}
