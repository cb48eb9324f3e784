import { BytesIn, readEntryStart } from './bytes_in';
import { thesisPath as file } from './entry_paths';
import { FormatError } from './errors';
import type { Manifest } from './manifest';
import { formatMinor, gammaSteps, mostChainScales, mostTotalBytes, noIndex } from './shared_numbers';
import type { TextureInfo } from './textures';

export { gammaSteps };

/**
 * What only the thesis's policy reads of a texture plane. F fragments, M scales of the chain by scale number;
 * empty arrays say nothing.
 */
export interface PlaneThesis {
  /** [F], 0..1: the predictors of chapter 8; 0 for fragments that are not stored. */
  z: Float32Array;
  i: Float32Array;
  zeta: Float32Array;
  m: Float32Array;
  vqp: Float32Array;
  /**
   * [F]: the size model S = A (100 VQP)^(B Q), and the correlation of Q and log S; 0 for fragments without a
   * model.
   */
  sizeA: Float32Array;
  sizeB: Float32Array;
  sizeCorrelation: Float32Array;
  /** [M]: Q_i. */
  quality: Float32Array;
  /** [M * 21]: D_i(Gamma), bytes. */
  totalBytes: Float64Array;
}

/**
 * Perceptual values of the whole chain of C scales, S_0 first (thesis 7.2). Pairs are those of rows i < j, by
 * i, then j.
 */
export interface PerceptualTable {
  /** [C] scale numbers, rising from 0. */
  scale: Uint8Array;
  /** [C] */
  triangles: Uint32Array;
  /** [C] from the row before to this one. */
  collapses: Uint32Array;
  /** [C] of rho over those collapses. */
  average: Float32Array;
  largest: Float32Array;
  least: Float32Array;
  deviation: Float32Array;
  /** [pairs] of S_i's distances to S_j over the distance to the skeleton. */
  p95: Float32Array;
  /** [pairs] of rho over all collapses from S_i to S_j, each against the vertex that is left in S_j. */
  chainAverage: Float32Array;
  chainLargest: Float32Array;
  chainLeast: Float32Array;
}

/** thesis.bin: by texture plane, and the perceptual table where there is one. */
export interface ThesisTables {
  planes: PlaneThesis[];
  perceptual?: PerceptualTable;
}

const none = new Float32Array(0);
const noPlane = (): PlaneThesis => ({
  z: none, i: none, zeta: none, m: none, vqp: none, sizeA: none, sizeB: none, sizeCorrelation: none,
  quality: none, totalBytes: new Float64Array(0),
});

const floats = (input: BytesIn, count: number, least = -1e30, most = 1e30): Float32Array =>
  Float32Array.from({ length: count }, () => {
    const value = input.f32();
    return value >= least && value <= most ? value : input.fail(`${least} to ${most}`, value);
  });
const whole = (input: BytesIn, count: number): Uint32Array =>
  Uint32Array.from({ length: count }, () => input.u32());

function requireReserved(input: BytesIn, bytes: number, minor: number): void {
  if (input.raw(bytes).some((b) => b !== 0) && minor <= formatMinor)
    input.fail('zero bytes', 'others', 'W05');
}

/** F, which must be that of textures.json. */
function readFragments(input: BytesIn, bytesEach: number, t: TextureInfo): number {
  const fragments = input.u32();
  if (fragments !== t.columns * t.rows) input.fail(`${t.columns * t.rows} fragments`, fragments, 'R16');
  if (input.left < fragments * bytesEach) input.fail(`${fragments * bytesEach} bytes`, input.left);
  return fragments;
}

function readPredictors(input: BytesIn, out: PlaneThesis, t: TextureInfo): void {
  const fragments = readFragments(input, 10, t);
  for (const name of ['z', 'i', 'zeta', 'm', 'vqp'] as const)
    out[name] = Float32Array.from({ length: fragments }, () => input.u16() / 65535);
}

function readModels(input: BytesIn, out: PlaneThesis, t: TextureInfo): void {
  const fragments = readFragments(input, 12, t);
  for (const name of ['sizeA', 'sizeB', 'sizeCorrelation'] as const) out[name] = floats(input, fragments);
}

function readGamma(input: BytesIn, out: PlaneThesis, minor: number, lastScale: number): void {
  const scales = input.u8();
  const width = input.u8();
  requireReserved(input, 2, minor);
  if (scales < 1 || scales > mostChainScales || width < 1 || width > 8)
    input.fail('1 to 100 scales and a width of 1 to 8', `${scales}, ${width}`);
  if (scales <= lastScale) input.fail(`scale ${lastScale}`, `${scales} scales`, 'R16');
  out.quality = floats(input, scales, 0, 100);
  let most = 0;
  out.totalBytes = Float64Array.from({ length: scales * gammaSteps }, () => {
    const low = input.number(Math.min(width, 4)) >>> 0;
    const bytes = width > 4 ? low + 2 ** 32 * (input.number(width - 4) >>> 0) : low;
    if (bytes > mostTotalBytes) input.fail('at most 2^53', bytes);
    most = Math.max(most, bytes);
    return bytes;
  });
  let least = 1;
  while (most >= 256 ** least) ++least;
  if (width !== least) input.fail('the least width that holds the values', 'another');
}

/** Section 4; the table's scales are the whole chain's. */
function readPerceptual(input: BytesIn, minor: number, manifest: Manifest): PerceptualTable {
  const rows = input.u8();
  requireReserved(input, 3, minor);
  const pairs = (rows * (rows - 1)) / 2;
  if (rows < 1 || rows > mostChainScales || input.left < rows * 25 + pairs * 16)
    input.fail('a table of 1 to 100 scales', rows);
  const scale = input.raw(rows).slice();
  scale.forEach((s, k) => {
    if (k === 0 ? s !== 0 : s <= scale[k - 1] || s >= mostChainScales)
      input.fail('scale numbers rising from 0, below 100', s);
  });
  const [triangles, collapses] = [whole(input, rows), whole(input, rows)];
  if (collapses[0] !== 0) input.fail('no collapse for S_0', collapses[0]);
  const [average, largest, least, deviation] = Array.from({ length: 4 }, () => floats(input, rows, 0));
  const [p95, chainAverage, chainLargest, chainLeast] =
    Array.from({ length: 4 }, () => floats(input, pairs, 0));
  for (const s of manifest.scales)
    if (!scale.includes(s.scale)) input.fail(`scale ${s.scale}`, 'none', 'R16');
  return {
    scale, triangles, collapses, average, largest, least, deviation, p95,
    chainAverage, chainLargest, chainLeast,
  };
}

/** thesis.bin (format/SPEC.md, 14.4) of a package with these documents. Throws FormatError. */
export function parseThesis(
  bytes: Uint8Array, manifest: Manifest, textures: readonly TextureInfo[],
): ThesisTables {
  const input = new BytesIn(bytes, file, 'O04');
  const minor = readEntryStart(input, 'TXTH', 'O04');
  if (minor !== manifest.version.minor)
    throw new FormatError(file, 'version', `minor ${manifest.version.minor}`, `${minor}`, 'R01');
  const count = input.u32();
  requireReserved(input, 4, minor);
  if (count > input.left / 12) input.fail('a section count that fits the file', count);
  const sections = Array.from({ length: count },
    () => ({ id: input.u32(), plane: input.u32(), bytes: input.u32() }));
  const out: ThesisTables = { planes: textures.map(noPlane) };
  let last = { id: 0, plane: noIndex };
  for (const { id, plane, bytes: size } of sections) {
    if (id < last.id || (id === last.id && plane <= last.plane) || id === 0)
      input.fail('sections by id and plane', 'another order');
    last = { id, plane };
    const section = new BytesIn(input.raw(size), `${file}: section ${id} of plane ${plane}`, 'O05');
    if (id > 4) continue;
    if (id === 4) {
      if (plane !== noIndex) section.fail('a table of the package', `of plane ${plane}`);
      out.perceptual = readPerceptual(section, minor, manifest);
    } else {
      if (plane >= textures.length) section.fail('a plane', plane, 'R16');
      if (id === 1) readPredictors(section, out.planes[plane], textures[plane]);
      if (id === 2) readModels(section, out.planes[plane], textures[plane]);
      if (id === 3)
        readGamma(section, out.planes[plane], minor, manifest.scales[manifest.scales.length - 1].scale);
    }
    if (minor <= formatMinor) section.finish();
  }
  input.finish();
  return out;
}
