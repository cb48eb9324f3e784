import { octahedralVector } from '../format/splits/octahedron';
import type { SplitGrid, SplitStreamHead, SplitStreamReader } from '../format/splits/split_stream';
import type { SplitInfo, SplitUpdate } from './protocol';

const f = Math.fround;
const names = { uv0: 'uv', uv1: 'uv1', normal: 'normal', colour: 'color' } as const;

/** The facts of a head that the main thread needs. */
export function splitInfo(head: SplitStreamHead): SplitInfo {
  const scales = head.scales.map(({ scale, blocks, wedges }) => {
    const last = head.blocks[blocks - 1];
    return { scale, blocks, wedges, end: last.offset + last.bytes };
  });
  return { headBytes: head.bytes, scales };
}

function gridValues(
  places: Int32Array,
  stride: number,
  grid: SplitGrid,
  count: number,
  placeOf: (i: number) => number,
): Float32Array {
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

/** Wedges that were added since there were `from` wedges, and the index of all triangles, for append-only buffers. */
export function splitUpdate(reader: SplitStreamReader, from: number): SplitUpdate {
  const { mesh, head } = reader;
  const to = mesh.wedges;
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
    attributes.push({ name: names[kind], components: kind === 'normal' ? 3 : kind === 'colour' ? 4 : 2, values });
  });
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
  return { from, to, blocks: reader.nextBlock, attributes, index, draws };
}
