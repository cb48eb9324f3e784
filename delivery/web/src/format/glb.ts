import { concat } from './sha256';
import { FormatError } from './errors';
import { imageSize } from './image_size';
import { mostPreviewPx } from './layout';

/** Fields of a GLB's JSON that make loaders ask other hosts, or make room for pictures. */
interface Embedding {
  buffers?: { uri?: unknown }[];
  images?: { uri?: unknown; bufferView?: number }[];
  bufferViews?: Record<number, { buffer?: unknown; byteOffset?: number; byteLength?: number;
    extensions?: unknown } | undefined>;
}

function require(good: unknown, rule: string, what: string): asserts good {
  if (!good) throw new FormatError('mesh', '', what, '', rule);
}

/** JSON and bytes of a GLB of at most two chunks: glTF has no others, and loaders differ in those. */
function partsOfGlb(glb: Uint8Array): { json: Embedding; bytes: Uint8Array } {
  const view = new DataView(glb.buffer, glb.byteOffset, glb.byteLength);
  const at = (i: number): number => (i + 4 <= glb.length ? view.getUint32(i, true) : -1);
  const end = 20 + at(12);
  const endsThere = end === glb.length || (at(end + 4) === 0x004e4942 && end + 8 + at(end) === glb.length);
  require(at(0) === 0x46546c67 && at(8) === glb.length && at(16) === 0x4e4f534a && endsThere, 'G01',
    'a GLB of JSON and bytes');
  let json: unknown;
  try {
    json = JSON.parse(new TextDecoder().decode(glb.subarray(20, end)));
  } catch {
    // the next line throws
  }
  require(typeof json === 'object' && json, 'G01', 'JSON in its GLB');
  return { json, bytes: glb.subarray(end + 8) };
}

/** What the GLBs of finer scales have for images: previews by their place in a tree. */
const previewUri = /^\.\.\/preview\/\d{3,5}\.jpg$/;

/**
 * Requires a GLB whose data is all in the file: a URI would make pages ask the host of that URI. With
 * `placeholders` its images may be URIs of previews, since nobody asks for them. Pictures in the GLB, which
 * loaders decode, must be no larger than previews. FormatError otherwise.
 */
export function requireSelfContained(glb: Uint8Array, placeholders = false,
    rule = placeholders ? 'G06' : 'G05'): void {
  const { json, bytes } = partsOfGlb(glb);
  const { buffers = [], images = [] } = json;
  require(Array.isArray(buffers) && Array.isArray(images) && [...buffers, ...images].every((item) => item),
    'G01', 'lists of buffers and images');
  const mayName = (uri: unknown): boolean => placeholders && typeof uri === 'string' && previewUri.test(uri);
  const inside = images.filter(({ uri }) => !mayName(uri));
  require([...buffers, ...inside].every(({ uri }) => uri === undefined), rule,
    'buffers and images within the file');
  for (const { bufferView = -1 } of inside) {
    const { buffer, byteOffset: at = 0, byteLength: length = 0, extensions } =
      json.bufferViews?.[bufferView] ?? {};
    require(buffer === 0 && !extensions && Number.isInteger(at) && at >= 0, 'G05', 'pictures as they are');
    const [width, height] = imageSize(bytes.subarray(at, at + length));
    require(width > 0 && width <= mostPreviewPx && height > 0 && height <= mostPreviewPx, 'G05', 'previews');
  }
}

// Bitstreams of EXT_meshopt_compression without filters: attributes (version 0) and triangles (version 1).

function fail(): never {
  throw new FormatError('proxy', '', 'a stream of meshopt', 'something else', 'G15');
}

/** Reads bytes up to an end. */
function reader(bytes: Uint8Array, at: number, end: number) {
  return {
    byte: (): number => (at < end ? bytes[at++] : fail()),
    run(count: number): Uint8Array {
      if (at + count > end) fail();
      return bytes.subarray(at, (at += count));
    },
    /** A difference of any size: 7 bits a byte, the sign in the lowest. */
    difference(): number {
      let value = 0;
      for (let shift = 0; shift < 35; shift += 7) {
        const next = this.byte();
        value |= (next & 127) << shift;
        if (next < 128) break;
      }
      return (value >>> 1) ^ -(value & 1);
    },
  };
}

/** `count` vertices of `stride` bytes each. */
export function decodeAttributes(coded: Uint8Array, count: number, stride: number): Uint8Array {
  const end = coded.length - Math.max(32, stride);
  if (end < 1 || coded[0] !== 0xa0) fail();
  const from = reader(coded, 1, end);
  const out = new Uint8Array(count * stride);
  const last = coded.slice(coded.length - stride); // the vertex before, whose bytes differences are to
  const most = Math.min(256, (8192 / stride) & ~15);
  const group = new Uint8Array(16);
  for (let first = 0; first < count; first += most) {
    const n = Math.min(most, count - first);
    const groups = Math.ceil(n / 16);
    for (let k = 0; k < stride; ++k) {
      const modes = from.run(Math.ceil(groups / 4));
      for (let g = 0; g < groups; ++g) {
        const mode = (modes[g >> 2] >> (2 * (g & 3))) & 3;
        if (mode === 0) group.fill(0);
        else if (mode === 3) group.set(from.run(16));
        else {
          const bits = 2 * mode;
          const packed = from.run(2 * bits);
          const escape = (1 << bits) - 1;
          for (let i = 0; i < 16; ++i) {
            const value = (packed[(i * bits) >> 3] >> (8 - bits - ((i * bits) & 7))) & escape;
            group[i] = value === escape ? from.byte() : value;
          }
        }
        for (let i = 16 * g; i < Math.min(16 * g + 16, n); ++i) {
          const d = group[i & 15];
          out[(first + i) * stride + k] = last[k] += (d >> 1) ^ -(d & 1);
        }
      }
    }
  }
  return out;
}

/** Indices of `count` corners. */
export function decodeTriangles(coded: Uint8Array, count: number): Uint32Array {
  const codes = 1 + count / 3;
  const end = coded.length - 16; // a table of codes stands behind
  if (count % 3 || end < codes || coded[0] !== 0xe1) fail();
  const from = reader(coded, codes, end);
  const out = new Uint32Array(count);
  const edges = new Uint32Array(32).fill(-1); // the last 16 edges, the last 16 vertices
  const vertices = new Uint32Array(16).fill(-1);
  let [edge, vertex, next, last] = [0, 0, 0, 0];
  const push = (v: number, isNew: boolean): void => {
    vertices[vertex & 15] = v;
    vertex += Number(isNew);
  };
  const far = (): number => (last = (last + from.difference()) >>> 0);
  const known = (back: number): number => vertices[(vertex - back) & 15];
  for (let at = 0; at < count; at += 3) {
    const code = coded[1 + at / 3];
    let [a, b, c] = [0, 0, 0];
    if (code < 0xf0) {
      const of = 2 * ((edge - 1 - (code >> 4)) & 15);
      const way = code & 15;
      [a, b] = [edges[of], edges[of + 1]];
      c = way === 0 ? next++
        : way < 13 ? known(1 + way) : way < 15 ? (last = (last + 2 * way - 27) >>> 0) : far();
      push(c, way === 0 || way > 12);
    } else {
      const free = code >= 0xfe; // its own code instead of one of the table
      const ways = free ? from.byte() : coded[end + (code & 15)];
      const [wayB, wayC] = [ways >> 4, ways & 15];
      if (free && ways === 0) next = 0;
      a = code < 0xff ? next++ : 0;
      const other = (way: number): number => (way === 0 ? next++ : known(way));
      b = other(wayB);
      c = other(wayC);
      if (free) {
        if (code === 0xff) a = far();
        if (wayB === 15) b = far();
        if (wayC === 15) c = far();
      }
      push(a, true);
      push(b, wayB === 0 || (free && wayB === 15));
      push(c, wayC === 0 || (free && wayC === 15));
    }
    out.set([a, b, c], at);
    const pairs = code < 0xf0 ? [c, b, a, c] : [b, a, c, b, a, c];
    for (let i = 0; i < pairs.length; i += 2) edges.set([pairs[i], pairs[i + 1]], 2 * (edge++ & 15));
  }
  return out;
}

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

function need(good: unknown, what: string): asserts good {
  require(good, 'G15', what);
}
const isSize = (n: unknown): n is number =>
  Number.isInteger(n) && (n as number) >= 0 && (n as number) <= mostBytes;

/** What a buffer view has, decoded. */
function bytesOfView({ buffer, byteOffset = 0, byteLength, extensions }: View,
    bytes: Uint8Array): Uint8Array {
  const coded = extensions?.[extension];
  const { byteOffset: at = 0, byteLength: length } = coded ?? { byteOffset, byteLength };
  need(isSize(at) && isSize(length) && at + length <= bytes.length && (coded || buffer === 0),
    'views within the file');
  const part = bytes.subarray(at, at + length);
  if (!coded) return part;
  const { count, byteStride: stride, mode, filter = 'NONE' } = coded;
  need(isSize(count) && isSize(stride) && isSize(count * stride) && count * stride === byteLength &&
    filter === 'NONE', 'coded views without filters');
  if (mode === 'ATTRIBUTES' && stride > 0 && stride % 4 === 0 && stride <= 256)
    return decodeAttributes(part, count, stride);
  need(mode === 'TRIANGLES' && (stride === 2 || stride === 4) && count / 3 <= length,
    'attributes or triangles');
  const indices = decodeTriangles(part, count);
  return new Uint8Array((stride === 2 ? Uint16Array.from(indices) : indices).buffer);
}

/** A GLB without EXT_meshopt_compression, from one whose data is all in the file. FormatError otherwise. */
export function plainGlb(glb: Uint8Array): Uint8Array {
  const { json, bytes } = partsOfGlb(glb);
  const gltf = json as Gltf;
  const { bufferViews: views = [], buffers = [], extensionsUsed = [], extensionsRequired = [] } = gltf;
  need([views, buffers, extensionsUsed, extensionsRequired].every(Array.isArray) &&
    views.every((view) => view), 'lists');
  const parts: Uint8Array[] = [];
  let end = 0;
  for (const view of views) {
    const part = bytesOfView(view, bytes);
    Object.assign(view, { buffer: 0, byteOffset: end, byteLength: part.length });
    delete view.extensions;
    parts.push(part, new Uint8Array(-part.length & 3));
    end += (part.length + 3) & ~3;
    need(end <= mostBytes, 'less data');
  }
  for (const list of ['extensionsUsed', 'extensionsRequired'] as const)
    gltf[list] = gltf[list]?.filter((name) => name !== extension);
  // The other buffers were stand-ins for coded views. A URI of any buffer stays, and is refused below.
  gltf.buffers = gltf.buffers?.slice(0, 1).map((buffer) => ({ ...(buffer as object), byteLength: end }));
  const text = new TextEncoder().encode(JSON.stringify(gltf));
  const blanks = new Uint8Array(-text.length & 3).fill(32);
  const heads = [[0x46546c67, 2, 28 + text.length + blanks.length + end, text.length + blanks.length,
    0x4e4f534a], [end, 0x004e4942]];
  const [head, binary] = heads.map((words) => new Uint8Array(Uint32Array.from(words).buffer));
  const plain = concat([head, text, blanks, binary, ...parts]);
  requireSelfContained(plain, false, 'G13');
  return plain;
}
