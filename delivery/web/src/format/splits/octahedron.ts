// Unit vectors as points of an octahedron: format/split/split_stream.cpp.

/** A coordinate of the octahedron's vector, scaled to `centre`, rounded towards zero. */
function scaled(value: number, centre: number, total: number): number {
  const product = value * centre;
  if (Math.abs(product) <= Number.MAX_SAFE_INTEGER) return Math.trunc(product / total);
  return Number((BigInt(value) * BigInt(centre)) / BigInt(total));
}
/** A point of the octahedron |x| + |y| + |z| = 2^(bits - 1) - 1. */
export function octahedralVector(u: number, v: number, bits: number): [number, number, number] {
  const centre = 2 ** (bits - 1) - 1;
  const x = u - centre;
  const y = v - centre;
  const z = centre - Math.abs(x) - Math.abs(y);
  if (z >= 0) return [x, y, z];
  return [(centre - Math.abs(y)) * (x < 0 ? -1 : 1), (centre - Math.abs(x)) * (y < 0 ? -1 : 1), z];
}
/** Code of the direction of a vector, each coordinate rounded towards zero. */
export function octahedralPlace(sum: readonly number[], bits: number, out: number[]): void {
  const centre = 2 ** (bits - 1) - 1;
  const total = Math.abs(sum[0]) + Math.abs(sum[1]) + Math.abs(sum[2]);
  out[0] = out[1] = centre;
  if (total === 0) return;
  let x = scaled(sum[0], centre, total);
  let y = scaled(sum[1], centre, total);
  if (sum[2] < 0)
    [x, y] = [(centre - Math.abs(y)) * (x < 0 ? -1 : 1), (centre - Math.abs(x)) * (y < 0 ? -1 : 1)];
  out[0] += x;
  out[1] += y;
}
