import { describe, expect, it } from 'vitest';
import { makeTangents, type TangentSource } from '../../src/worker/tangents';

const columns = 5;
const rows = 3;

/** The sheet of tests/format/model/tangents_test.cpp: wavy, its atlas mirrored about the third column. */
function mirroredSheet(): TangentSource {
  const [positions, normals, uv, index]: number[][] = [[], [], [], []];
  for (let i = 0; i < columns * rows; ++i) {
    const [x, y] = [i % columns, Math.floor(i / columns)];
    positions.push(x, y + (x % 2) * 0.25, ((x * x + 3 * y * x + y) % 5) * 0.125);
    const normal = [((x % 3) - 1) * 0.25, (y - 1) * 0.25, 1];
    normals.push(...normal.map((v) => v / Math.hypot(...normal)));
    uv.push(Math.abs(x - 2) * 0.25 + y * 0.0625, 1 - y * 0.375 - (x === 2 ? 0.125 : 0));
  }
  [uv[0], uv[1]] = [uv[2], uv[3]];
  for (let a = 0; a + columns + 1 < columns * rows; ++a)
    if (a % columns + 1 < columns) index.push(a, a + 1, a + columns + 1, a, a + columns + 1, a + columns);
  return { positions: new Float32Array(positions), normals: new Float32Array(normals),
    uv: new Float32Array(uv), index: new Uint32Array(index) };
}

describe('tangents', () => {
  it('are those of MikkTSpace', () => {
    const sheet = mirroredSheet();
    const { values } = makeTangents(sheet);
    const known = [ // corner, and what mikktspace.c gives
      [0, -0.94742, -0.16033, -0.27694, -1], [2, -0.98191, 0.18932, 0, -1],
      [7, -0.85528, 0.41034, 0.31641, -1], [12, 0.8304, 0.55283, -0.06939, 1],
      [13, 0.96743, 0.03522, 0.25066, 1], [19, 0.94864, -0.30691, -0.07673, 1],
      [34, -0.86049, 0.5015, 0.08975, -1], [46, 0.97806, -0.20211, 0.05053, 1],
    ];
    for (const [corner, ...tangent] of known)
      tangent.forEach((v, k) =>
        expect(Math.abs(values[4 * sheet.index[corner] + k] / 127 - v), `${corner}`).toBeLessThan(0.005));
  });
  it('give mirrored sides wedges of their own', () => {
    const sheet = mirroredSheet();
    const before = sheet.index.slice();
    const { values, added } = makeTangents(sheet);
    expect([...added].sort((a, b) => a - b)).toEqual([2, 7, 12]);
    expect(values.length).toBe(4 * (columns * rows + 3));
    sheet.index.forEach((w, i) =>
      expect(w < columns * rows ? w : added[w - columns * rows]).toBe(before[i]));
  });
  it('follow equal wedges and not their numbers', () => {
    const sheet = mirroredSheet();
    const pick = (values: Float32Array, n: number): Float32Array =>
      Float32Array.from([...sheet.index].flatMap((w) => [...values.subarray(n * w, n * w + n)]));
    const apart = { positions: pick(sheet.positions, 3), normals: pick(sheet.normals, 3),
      uv: pick(sheet.uv, 2), index: Uint32Array.from(sheet.index.keys()) };
    const joined = makeTangents(sheet).values;
    const { values, added } = makeTangents(apart);
    expect(added.length).toBe(0);
    sheet.index.forEach((w, i) =>
      expect(values.subarray(4 * i, 4 * i + 4)).toEqual(joined.subarray(4 * w, 4 * w + 4)));
  });
  it('point anywhere without an area of texture or of the triangle', () => {
    const flat = mirroredSheet();
    flat.uv.fill(0.5);
    const needle = mirroredSheet();
    for (let i = 0; i < needle.index.length; i += 3) needle.index[i + 1] = needle.index[i];
    for (const mesh of [flat, needle]) {
      const { values, added } = makeTangents(mesh);
      expect(added.length).toBe(0);
      for (const w of mesh.index) expect([...values.subarray(4 * w, 4 * w + 4)]).toEqual([127, 0, 0, 127]);
    }
  });
  it('of many triangles at an edge take no longer', () => {
    const fan = mirroredSheet();
    const [triangle, turned] = [fan.index.slice(12, 15), fan.index.slice(12, 15).reverse()];
    const index = Uint32Array.from({ length: 120000 }, (_, i) => (i < 60000 ? triangle : turned)[i % 3]);
    expect(makeTangents({ ...fan, index }).values.length).toBeGreaterThan(0);
  });
});
