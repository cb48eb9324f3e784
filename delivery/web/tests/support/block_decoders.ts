// Decoders of the blocks that the encoder writes, from the text of the formats: nothing is shared with the
// encoder. A mode that the encoder has no use for is an error.

/** Sixteen texels, row by row: red, green, blue, alpha. */
type Texels = number[][];

const bit = (block: Uint8Array, at: number, count = 1): number => {
  let v = 0;
  for (let i = count - 1; i >= 0; --i) v = v * 2 + ((block[(at + i) >> 3] >> ((at + i) & 7)) & 1);
  return v;
};
const texels = (of: (x: number, y: number) => number[]): Texels =>
  Array.from({ length: 16 }, (_, i) => of(i & 3, i >> 2));

// ---- BC

export function decodeBc1(b: Uint8Array, fourColours = false): Texels {
  const words = [bit(b, 0, 16), bit(b, 16, 16)];
  const ends = words.map((w) =>
    [w >> 11, (w >> 5) & 63, w & 31].map((v, c) => (c === 1 ? (v << 2) | (v >> 4) : (v << 3) | (v >> 2))));
  const mix = (a: number, z: number): number[] => ends[0].map((v, c) => (a * v + z * ends[1][c]) / (a + z));
  const four = fourColours || words[0] > words[1];
  const colours = [ends[0], ends[1], four ? mix(2, 1) : mix(1, 1), four ? mix(1, 2) : [0, 0, 0]];
  return texels((x, y) => [...colours[bit(b, 32 + 2 * (4 * y + x), 2)].map(Math.round), 255]);
}
function channel(b: Uint8Array): number[] {
  const [a, z] = b;
  const of = (code: number): number => {
    if (code < 2) return code ? z : a;
    if (a > z) return ((8 - code) * a + (code - 1) * z) / 7;
    return code < 6 ? ((6 - code) * a + (code - 1) * z) / 5 : code === 6 ? 0 : 255;
  };
  return Array.from({ length: 16 }, (_, i) => Math.round(of(bit(b, 16 + 3 * i, 3))));
}
/** Red in alpha, green in green. */
export function decodeBc3Normal(b: Uint8Array): Texels {
  const [red, rest] = [channel(b.subarray(0, 8)), decodeBc1(b.subarray(8), true)];
  return red.map((r, i) => [r, rest[i][1], 0, 255]);
}
export function decodeBc5(b: Uint8Array): Texels {
  const [red, green] = [channel(b.subarray(0, 8)), channel(b.subarray(8))];
  return red.map((r, i) => [r, green[i], 0, 255]);
}
const weights4 = [0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64];
export function decodeBc7(b: Uint8Array): Texels {
  if (bit(b, 0, 7) !== 64) throw new Error('not mode 6');
  const ends = [0, 1].map((e) => [0, 1, 2, 3].map((c) => 2 * bit(b, 7 + 14 * c + 7 * e, 7) + bit(b, 63 + e)));
  const code = (i: number): number => (i === 0 ? bit(b, 65, 3) : bit(b, 64 + 4 * i, 4));
  return texels((x, y) => ends[0].map(
    (v, c) => ((64 - weights4[code(4 * y + x)]) * v + weights4[code(4 * y + x)] * ends[1][c] + 32) >> 6));
}

// ---- ETC2

const modifiers = [[2, 8], [5, 17], [9, 29], [13, 42], [18, 60], [24, 80], [33, 106], [47, 183]];
const clamp = (v: number): number => Math.min(255, Math.max(0, v));
export function decodeEtc2(bytes: Uint8Array): Texels {
  const b = bytes.slice().reverse(); // bits count from the last byte
  const at = (high: number, low: number): number => bit(b, low, high - low + 1);
  const signed = (v: number): number => (v >= 4 ? v - 8 : v);
  const starts = [63, 55, 47];
  let bases: number[][];
  if (at(33, 33)) {
    const first = starts.map((s) => at(s, s - 4));
    const second = starts.map((s, c) => first[c] + signed(at(s - 5, s - 7)));
    const out = second.map((v) => v < 0 || v > 31);
    if (out[0] || out[1]) throw new Error('mode T or H');
    if (out[2]) return planar(at);
    bases = [first, second].map((v) => v.map((q) => (q << 3) | (q >> 2)));
  } else {
    bases = [0, 4].map((by) => starts.map((s) => at(s - by, s - by - 3) * 17));
  }
  const tables = [at(39, 37), at(36, 34)];
  return texels((x, y) => {
    const half = at(32, 32) ? y >> 1 : x >> 1;
    const [i, negative] = [bit(b, 4 * x + y), bit(b, 16 + 4 * x + y)];
    const by = modifiers[tables[half]][i] * (negative ? -1 : 1);
    return [...bases[half].map((v) => clamp(v + by)), 255];
  });
}
function planar(at: (high: number, low: number) => number): Texels {
  const six = (v: number): number => (v << 2) | (v >> 4);
  const seven = (v: number): number => (v << 1) | (v >> 6);
  const o = [six(at(62, 57)), seven(at(56, 56) * 64 + at(54, 49)),
    six(at(48, 48) * 32 + at(44, 43) * 8 + at(41, 39))];
  const h = [six(at(38, 34) * 2 + at(32, 32)), seven(at(31, 25)), six(at(24, 19))];
  const v = [six(at(18, 13)), seven(at(12, 6)), six(at(5, 0))];
  return texels((x, y) =>
    [...o.map((c, i) => clamp((x * (h[i] - c) + y * (v[i] - c) + 4 * c + 2) >> 2)), 255]);
}

// ---- ASTC 4 x 4

/** One of 192 values: 6 bits "fedcba" and a trit. */
function unquantised(bits: number, trit: number): number {
  const a = bits & 1 ? 0x1ff : 0;
  const [f, e, d, c, b] = [5, 4, 3, 2, 1].map((i) => (bits >> i) & 1);
  const high = (f << 8) | (e << 7) | (d << 6) | (c << 5) | (b << 4) | f;
  const t = (trit * 5 + high) ^ a;
  return (a & 0x80) | (t >> 2);
}
/** Five trits of eight bits. */
function tritsOf(t: number): number[] {
  const is = (v: number, high: number, low: number): number => (v >> low) & ((1 << (high - low + 1)) - 1);
  const v = [0, 0, 0, 0, 0];
  let c = is(t, 4, 0);
  if (is(t, 4, 2) === 7) [c, v[4], v[3]] = [is(t, 7, 5) * 4 + is(t, 1, 0), 2, 2];
  else if (is(t, 6, 5) === 3) [v[4], v[3]] = [2, is(t, 7, 7)];
  else [v[4], v[3]] = [is(t, 7, 7), is(t, 6, 5)];
  if (is(c, 1, 0) === 3)
    [v[2], v[1], v[0]] = [2, is(c, 4, 4), is(c, 3, 3) * 2 + (is(c, 2, 2) & ~is(c, 3, 3) & 1)];
  else if (is(c, 3, 2) === 3) [v[2], v[1], v[0]] = [2, 2, is(c, 1, 0)];
  else [v[2], v[1], v[0]] = [is(c, 4, 4), is(c, 3, 2), is(c, 1, 1) * 2 + (is(c, 0, 0) & ~is(c, 1, 1) & 1)];
  return v;
}
function rgbEnds(b: Uint8Array): number[] {
  const widths = [2, 2, 1, 2, 1];
  const [bits, parts]: number[][] = [[], []];
  let at = 17;
  for (const width of widths) {
    bits.push(bit(b, at, 6));
    parts.push(bit(b, at + 6, width));
    at += 6 + width;
  }
  const trits = tritsOf(parts[0] | (parts[1] << 2) | (parts[2] << 4) | (parts[3] << 5) | (parts[4] << 7));
  return [...bits.map((v, i) => unquantised(v, trits[i])),
    unquantised(bit(b, at, 6), tritsOf(bit(b, at + 6, 2))[0])];
}
export function decodeAstc(b: Uint8Array): Texels {
  if (bit(b, 0, 12) === 0xdfc) {
    const colour = [8, 10, 12, 14].map((i) => b[i + 1]);
    return texels(() => colour);
  }
  const mode = bit(b, 0, 11);
  const dual = mode === 0x442;
  if ((mode !== 0x242 && !dual) || bit(b, 11, 2) !== 0) throw new Error(`mode ${mode.toString(16)}`);
  const kind = bit(b, 13, 4);
  let ends: number[][];
  if (kind === 8 && !dual) {
    const v = rgbEnds(b);
    ends = [[v[0], v[2], v[4], 255], [v[1], v[3], v[5], 255]];
    if (v[1] + v[3] + v[5] < v[0] + v[2] + v[4]) throw new Error('ends in the wrong order');
  } else if (kind === 4) {
    const v = [0, 1, 2, 3].map((i) => bit(b, 17 + 8 * i, 8));
    ends = [[v[0], v[0], v[0], v[2]], [v[1], v[1], v[1], v[3]]];
  } else {
    throw new Error(`ends of kind ${kind}`);
  }
  if (dual && bit(b, 62, 2) !== 3) throw new Error('weights of another channel');
  const width = dual ? 2 : 4;
  const weight = (i: number): number => {
    let v = 0;
    for (let k = 0; k < width; ++k) v |= bit(b, 127 - width * i - k) << k;
    const six = dual ? v * 21 : (v << 2) | (v >> 2);
    return six > 32 ? six + 1 : six;
  };
  return texels((x, y) => {
    const i = 4 * y + x;
    const w = dual ? [2 * i, 2 * i, 2 * i, 2 * i + 1].map(weight) : new Array<number>(4).fill(weight(i));
    return ends[0].map((v, c) => (v * 257 * (64 - w[c]) + ends[1][c] * 257 * w[c] + 32) >> 14);
  });
}
/** Red in luminance, green in alpha. */
export const decodeAstcNormal = (b: Uint8Array): Texels => decodeAstc(b).map(([l, , , a]) => [l, a, 0, 255]);
