import { concat } from '../bytes';
import { decodeAttributes, decodeTriangles } from './meshopt';
import { partsOfGlb, requireOfMesh, requireSelfContained } from '../self_contained_glb';

const extension = 'EXT_meshopt_compression';
/** A proxy's mesh takes no more memory. */
const mostBytes = 1 << 25;

interface Coded {
  byteOffset?: number;
  byteLength: number;
  byteStride: number;
  count: number;
  mode: string;
  filter?: string;
}
interface View {
  buffer: number;
  byteOffset?: number;
  byteLength: number;
  extensions?: Record<string, Coded>;
}
interface Gltf {
  buffers?: unknown[];
  bufferViews?: View[];
  extensionsUsed?: string[];
  extensionsRequired?: string[];
}

function require(good: unknown, what: string): asserts good {
  requireOfMesh(good, 'G15', what);
}
const isSize = (n: unknown): n is number => Number.isInteger(n) && (n as number) >= 0 && (n as number) <= mostBytes;

/** What a buffer view has, decoded. */
function bytesOfView({ buffer, byteOffset = 0, byteLength, extensions }: View, bytes: Uint8Array): Uint8Array {
  const coded = extensions?.[extension];
  const { byteOffset: at = 0, byteLength: length } = coded ?? { byteOffset, byteLength };
  require(isSize(at) && isSize(length) && at + length <= bytes.length && (coded || buffer === 0), 'views within the file');
  const part = bytes.subarray(at, at + length);
  if (!coded) return part;
  const { count, byteStride: stride, mode, filter = 'NONE' } = coded;
  require(isSize(count) && isSize(stride) && isSize(count * stride) && count * stride === byteLength && filter === 'NONE', 'coded views without filters');
  if (mode === 'ATTRIBUTES' && stride > 0 && stride % 4 === 0 && stride <= 256) return decodeAttributes(part, count, stride);
  require(mode === 'TRIANGLES' && (stride === 2 || stride === 4) && count / 3 <= length, 'attributes or triangles');
  const indices = decodeTriangles(part, count);
  return new Uint8Array((stride === 2 ? Uint16Array.from(indices) : indices).buffer);
}

/**
 * A GLB that any loader reads without a decoder, from one whose views EXT_meshopt_compression codes without filters. All data must be in
 * the file. FormatError otherwise.
 */
export function plainGlb(glb: Uint8Array): Uint8Array {
  const { json, bytes } = partsOfGlb(glb);
  const gltf = json as Gltf;
  const { bufferViews: views = [], buffers = [], extensionsUsed = [], extensionsRequired = [] } = gltf;
  require([views, buffers, extensionsUsed, extensionsRequired].every(Array.isArray) && views.every((view) => view), 'lists');
  const parts: Uint8Array[] = [];
  let end = 0;
  for (const view of views) {
    const part = bytesOfView(view, bytes);
    Object.assign(view, { buffer: 0, byteOffset: end, byteLength: part.length });
    delete view.extensions;
    parts.push(part, new Uint8Array(-part.length & 3));
    end += (part.length + 3) & ~3;
    require(end <= mostBytes, 'less data');
  }
  for (const list of ['extensionsUsed', 'extensionsRequired'] as const) gltf[list] = gltf[list]?.filter((name) => name !== extension);
  // The other buffers were stand-ins for coded views. A URI of any buffer stays, and is refused below.
  gltf.buffers = gltf.buffers?.slice(0, 1).map((buffer) => ({ ...(buffer as object), byteLength: end }));
  const text = new TextEncoder().encode(JSON.stringify(gltf));
  const blanks = new Uint8Array(-text.length & 3).fill(32);
  const heads = [[0x46546c67, 2, 28 + text.length + blanks.length + end, text.length + blanks.length, 0x4e4f534a], [end, 0x004e4942]];
  const [head, binary] = heads.map((words) => new Uint8Array(Uint32Array.from(words).buffer));
  const plain = concat([head, text, blanks, binary, ...parts]);
  requireSelfContained(plain, false, 'G13');
  return plain;
}
