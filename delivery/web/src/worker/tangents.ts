/** What tangents are made of. */
export interface TangentSource {
  /** Per wedge: 3 coordinates, 3 of the normal, 2 of the texture. */
  positions: Float32Array;
  normals: Float32Array;
  uv: Float32Array;
  /** Wedges of the triangles. */
  index: Uint32Array;
}
/** Groups of corners that share a tangent. */
interface Groups {
  /** Per corner; -1 = only triangles without an area of texture meet. */
  of: Int32Array;
  /** 3 coordinates for each, not unit. */
  sums: number[];
  mirrored: boolean[];
}

const leastFloat = 1.1754943508222875e-38;

type Vector = [number, number, number];
const dot = (a: Vector, b: Vector): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const minus = (a: Vector, b: Vector): Vector => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const cross = (a: Vector, b: Vector): Vector =>
  [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const times = (a: Vector, s: number): Vector => [a[0] * s, a[1] * s, a[2] * s];
const unit = (a: Vector): Vector => {
  const length = Math.sqrt(dot(a, a));
  return length > 0 ? times(a, 1 / length) : [0, 0, 0];
};
const vectorAt = (values: Float32Array, i: number): Vector =>
  [values[3 * i], values[3 * i + 1], values[3 * i + 2]];
const nextCorner = (c: number): number => (c % 3 === 2 ? c - 2 : c + 1);
const previousCorner = (c: number): number => (c % 3 === 0 ? c + 2 : c - 1);

/** Per wedge: the first wedge of equal values. */
function equalWedges({ positions, normals, uv }: TangentSource): Uint32Array {
  const count = uv.length / 2;
  let size = 1;
  while (size < 2 * count) size *= 2;
  const table = new Int32Array(size).fill(-1);
  const value = (w: number, k: number): number =>
    k < 3 ? positions[3 * w + k] : k < 6 ? normals[3 * w + k - 3] : uv[2 * w + k - 6];
  const number = new Float32Array(1);
  const bits = new Uint32Array(number.buffer);
  const first = new Uint32Array(count);
  for (let w = 0; w < count; ++w) {
    let hash = 0;
    for (let k = 0; k < 8; ++k) {
      number[0] = value(w, k) + 0; // -0 equals 0
      hash = Math.imul(hash ^ bits[0], 0x9e3779b1);
      hash ^= hash >>> 15;
    }
    let at = hash & (size - 1);
    const differs = (other: number): boolean => {
      for (let k = 0; k < 8; ++k) if (value(other, k) !== value(w, k)) return true;
      return false;
    };
    while (table[at] >= 0 && differs(table[at])) at = (at + 1) & (size - 1);
    if (table[at] < 0) table[at] = w;
    first[w] = table[at];
  }
  return first;
}

/** Per corner: the triangle across the edge to the next corner, the first that runs along it backwards. */
function neighbours(vertex: Uint32Array): Int32Array {
  const out = new Int32Array(vertex.length).fill(-1);
  const waiting = new Map<number, { corners: number[]; at: number }>();
  for (let c = 0; c < vertex.length; ++c) {
    const [a, b] = [vertex[c], vertex[nextCorner(c)]];
    if (a === b) continue;
    const key = Math.min(a, b) * 4294967296 + Math.max(a, b);
    const edge = waiting.get(key);
    if (edge && edge.at < edge.corners.length && vertex[edge.corners[edge.at]] !== a) {
      const other = edge.corners[edge.at++];
      out[c] = Math.floor(other / 3);
      out[other] = Math.floor(c / 3);
    } else if (edge) edge.corners.push(c);
    else waiting.set(key, { corners: [c], at: 0 });
  }
  return out;
}

/** Of triangles: the unit direction of growing u, and whether the texture is mirrored. */
function texturePlanes({ positions, uv, index }: TangentSource): { along: (Vector | undefined)[];
    mirrored: boolean[] } {
  const along: (Vector | undefined)[] = [];
  const mirrored: boolean[] = [];
  for (let i = 0; i < index.length; i += 3) {
    const [a, b, c] = [index[i], index[i + 1], index[i + 2]];
    const [ux, uy] = [uv[2 * b] - uv[2 * a], uv[2 * b + 1] - uv[2 * a + 1]];
    const [vx, vy] = [uv[2 * c] - uv[2 * a], uv[2 * c + 1] - uv[2 * a + 1]];
    const area = ux * vy - uy * vx;
    const d1 = minus(vectorAt(positions, b), vectorAt(positions, a));
    const d2 = minus(vectorAt(positions, c), vectorAt(positions, a));
    const s = minus(times(d1, vy), times(d2, uy));
    const t = minus(times(d2, ux), times(d1, vx));
    const least = Math.abs(area) * leastFloat;
    const some = Math.abs(area) > leastFloat && Math.sqrt(dot(s, s)) > least && Math.sqrt(dot(t, t)) > least;
    along.push(some ? unit(times(s, area > 0 ? 1 : -1)) : undefined);
    mirrored.push(area > 0);
  }
  return { along, mirrored };
}

function tangentGroups(source: TangentSource): Groups {
  const { positions, normals, index } = source;
  const first = equalWedges(source);
  const vertex = index.map((w) => first[w]);
  const beside = neighbours(vertex);
  const { along, mirrored } = texturePlanes(source);
  const out: Groups = { of: new Int32Array(index.length).fill(-1), sums: [], mirrored: [] };
  const add = (group: number, c: number, direction: Vector): void => {
    const n = vectorAt(normals, index[c]);
    const flat = (v: Vector): Vector => unit(minus(v, times(n, dot(n, v))));
    const here = vectorAt(positions, index[c]);
    const a = flat(minus(vectorAt(positions, index[previousCorner(c)]), here));
    const b = flat(minus(vectorAt(positions, index[nextCorner(c)]), here));
    const across = cross(a, b);
    const angle = Math.atan2(Math.sqrt(dot(across, across)), dot(a, b));
    flat(direction).forEach((v, k) => (out.sums[3 * group + k] += v * angle));
  };
  for (let start = 0; start < index.length; ++start) {
    if (!along[Math.floor(start / 3)] || out.of[start] >= 0) continue;
    const group = out.mirrored.push(mirrored[Math.floor(start / 3)]) - 1;
    out.sums.push(0, 0, 0);
    const open = [Math.floor(start / 3)];
    while (open.length > 0) {
      const t = open.pop()!;
      if (t < 0) continue;
      const c = [3 * t, 3 * t + 1, 3 * t + 2].find((k) => vertex[k] === vertex[start])!;
      if (out.of[c] >= 0) continue;
      const free = out.of[3 * t] < 0 && out.of[3 * t + 1] < 0 && out.of[3 * t + 2] < 0;
      if (!along[t] && free) mirrored[t] = out.mirrored[group];
      if (mirrored[t] !== out.mirrored[group]) continue;
      out.of[c] = group;
      open.push(beside[previousCorner(c)], beside[c]);
      if (along[t]) add(group, c, along[t]!);
    }
  }
  return out;
}

/** Tangents, 4 bytes for each wedge, and the wedges that were added. */
export interface MadeTangents {
  /** -127 .. 127 for -1 .. 1; all 0 = none. */
  values: Int8Array;
  /** Which wedge an added one repeats; they stand behind the others. */
  added: Uint32Array;
}

/**
 * Tangents by MikkTSpace, as format/model/tangents.h has it, of the triangles given; `index` gets the added
 * wedges.
 */
export function makeTangents(source: TangentSource): MadeTangents {
  const { index, positions } = source;
  const count = source.uv.length / 2;
  const same = (a: number, b: number): boolean =>
    vectorAt(positions, a).every((v, k) => v === positions[3 * b + k]);
  const whole: number[] = []; // triangles with their corners in three places
  for (let i = 0; i < index.length; i += 3)
    if (!same(index[i], index[i + 1]) && !same(index[i + 1], index[i + 2]) && !same(index[i + 2], index[i]))
      whole.push(i);
  const corners = Uint32Array.from(whole.flatMap((i) => [i, i + 1, i + 2]));
  const groups = tangentGroups({ ...source, index: corners.map((c) => index[c]) });
  const own = new Int32Array(count).fill(-1);
  const others = new Map<number, number>();
  const added: number[] = [];
  corners.forEach((c, i) => {
    const [w, group] = [index[c], groups.of[i]];
    if (group < 0 || own[w] === group) return;
    if (own[w] < 0) own[w] = group;
    else {
      const key = group * 4294967296 + w;
      if (!others.has(key)) others.set(key, count + added.push(w) - 1);
      index[c] = others.get(key)!;
    }
  });
  const values = new Int8Array(4 * (count + added.length));
  const set = (w: number, t: Vector, sign: number): void =>
    values.set([...t.map((v) => Math.round(127 * v)), 127 * sign], 4 * w);
  const setGroup = (w: number, group: number): void => {
    const t = unit([0, 1, 2].map((k) => groups.sums[3 * group + k]) as Vector);
    set(w, dot(t, t) > 0 ? t : [1, 0, 0], groups.mirrored[group] ? -1 : 1);
  };
  own.forEach((group, w) => group >= 0 && setGroup(w, group));
  others.forEach((w, key) => setGroup(w, Math.floor(key / 4294967296)));
  for (const w of index) if (values[4 * w + 3] === 0) set(w, [1, 0, 0], 1);
  return { values, added: Uint32Array.from(added) };
}
