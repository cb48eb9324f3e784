import { FormatError } from '../errors';

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
      c = way === 0 ? next++ : way < 13 ? known(1 + way) : way < 15 ? (last = (last + 2 * way - 27) >>> 0) : far();
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
