import { BytesIn } from './bytes_in';
import { toHex } from './bytes';
import { tablesPath as file } from './entry_paths';
import { FormatError } from './errors';
import { formatMajor, formatMinor } from './manifest';
import { sha256 } from './sha256';
import { PlaneTables, TablesHead, fragmentCount, gammaSteps } from './tables';

const mostFragments = 65535;
const mostRungs = 100;
const mostScales = 100;
/** Head of tables.bin; the bytes may stop after the head. */
export function readTablesHead(bytes: Uint8Array): TablesHead {
  const input = new BytesIn(bytes, file);
  input.expect('TXMT');
  const major = input.u16();
  if (major !== formatMajor) input.fail(`major version ${formatMajor}`, `${major}`);
  const minor = input.u16();
  const planes = input.u32();
  if (input.u32() !== 0 && minor <= formatMinor) input.fail('4 zero bytes', 'others');
  if (planes > input.left / 36) input.fail('a plane count that fits the file', `${planes}`);
  const head: TablesHead = { minor, bytes: 16 + planes * 36, planes: [] };
  let offset = head.bytes;
  for (let p = 0; p < planes; ++p) {
    const section = { offset, bytes: input.u32(), sha256: input.raw(32) };
    offset += section.bytes;
    head.planes.push(section);
  }
  return head;
}

const largestHalf = 0x7bff;
const floatBits = new DataView(new ArrayBuffer(4));
/** binary16, finite and not negative, to a number. */
function fromHalf(half: number): number {
  const exponent = half >> 10;
  const mantissa = half & 0x3ff;
  if (exponent === 0) return mantissa / 16777216;
  floatBits.setUint32(0, ((exponent + 112) << 23) | (mantissa << 13));
  return floatBits.getFloat32(0);
}

function readHalf(input: BytesIn): number {
  const half = input.u16();
  if (half > largestHalf) input.fail('a finite binary16 >= 0', `${half}`);
  return fromHalf(half);
}

interface Widths {
  size: number;
  feature: number;
}

function sectionBytes(f: number, r: number, n: number, order: number, w: Widths): number {
  return (
    56 + r * 5 + r * f * (w.size + 12) + f * 18 + order * 2 + n * f * w.feature + n * 4 + n * gammaSteps * 8
  );
}

function fill<T extends { [i: number]: number; length: number }>(values: T, get: () => number): T {
  for (let i = 0; i < values.length; ++i) values[i] = get();
  return values;
}

function readArrays(input: BytesIn, t: PlaneTables, r: number, order: number, w: Widths): void {
  const f = fragmentCount(t);
  const n = t.scales + 1;
  const u32 = (): number => input.u32();
  const f32 = (): number => input.f32();
  const half = (): number => readHalf(input);
  const unit = (): number => input.u16() / 65535;
  t.rungQuality = input.raw(r);
  t.tableBytes = fill(new Uint32Array(r), u32);
  t.sizeBytes = fill(new Uint32Array(r * f), () => input.number(w.size));
  t.digest = input.raw(r * f * 8);
  t.mse = fill(new Float32Array(r * f), half);
  t.dssim = fill(new Float32Array(r * f), half);
  t.coveredTexels = fill(new Uint32Array(f), u32);
  t.surfaceFraction = fill(new Float32Array(f), f32);
  for (const name of ['z', 'i', 'zeta', 'm', 'vqp'] as const) t[name] = fill(new Float32Array(f), unit);
  t.order = fill(new Uint16Array(order), () => input.u16());
  t.features = fill(new Uint32Array(n * f), () => input.number(w.feature));
  t.quality = fill(new Float32Array(n), f32);
  t.totalBytes = fill(new Float64Array(n * gammaSteps), () => input.u64());
}

/** Fields behind those of format 1.0. */
function readExtension(input: BytesIn, t: PlaneTables, minor: number): void {
  if (minor < 1) return input.finish();
  const allocation = input.u8();
  const flags = input.u8();
  if (Math.min(allocation, 1) !== t.allocation || allocation > 2)
    input.fail("the allocation of the section's head, or 2 where that is 1", `${allocation}`);
  t.allocation = allocation;
  const reserved = input.u16();
  if (minor <= formatMinor && (flags > 7 || reserved !== 0)) input.fail('flags 0 to 7 and 2 zero bytes', 'others');
  t.incremental = (flags & 2) !== 0;
  if (flags & 1) t.skipDssim = fill(new Float32Array(fragmentCount(t)), () => readHalf(input));
  if (flags & 4) {
    const knots = input.u8();
    if (knots === 0) input.fail('at least one knot', 'none');
    t.knotQuality = input.raw(knots);
    t.knotPosition = fill(new Float32Array(knots), () => input.u16() / 65535);
  }
  if (minor <= formatMinor) input.finish();
}

function emptyTables(): PlaneTables {
  const none = new Float32Array(0);
  return {
    columns: 0, rows: 0, scales: 0, incremental: false,
    rungQuality: new Uint8Array(0), tableBytes: new Uint32Array(0), sizeBytes: new Uint32Array(0),
    digest: new Uint8Array(0), mse: none, dssim: none, coveredTexels: new Uint32Array(0), surfaceFraction: none,
    z: none, i: none, zeta: none, m: none, vqp: none, order: new Uint16Array(0), skipDssim: none, knotQuality: new Uint8Array(0), knotPosition: none,
    features: new Uint32Array(0), quality: none, totalBytes: new Float64Array(0), allocation: 1,
    qualityWidth: 60, logWidth: 0.7, qualityMin: 5, qualityMax: 97,
    modelA: 0, modelB: 0, modelR: 0, modelCorrelation: 0, modelError: 0,
  };
}

const parameters = [
  'qualityWidth', 'logWidth', 'qualityMin', 'qualityMax', 'modelA', 'modelB', 'modelR', 'modelCorrelation', 'modelError',
] as const;

/** The least number of bytes that holds every value. */
function widthOf(values: Uint32Array): number {
  let most = 0;
  for (const v of values) if (v > most) most = v;
  return most < 256 ? 1 : most < 65536 ? 2 : most < 16777216 ? 3 : 4;
}

/** Throws FormatError where values make no sense. */
function checkPlane(t: PlaneTables, place: string): void {
  const require = (good: boolean, what: string, expected: string, found: unknown): void => {
    if (!good) throw new FormatError(file, `${place}/${what}`, expected, String(found));
  };
  const within = (values: ArrayLike<number>, least: number, most: number, what: string): void => {
    for (let k = 0; k < values.length; ++k)
      if (!(values[k] >= least && values[k] <= most))
        require(false, `${what}[${k}]`, `${least} to ${most}`, values[k]);
  };
  const f = fragmentCount(t);
  t.rungQuality.forEach((q, r) =>
    require(q >= 1 && q <= 100 && (r === 0 || q > t.rungQuality[r - 1]), 'rungQuality', '1 to 100, rising', q),
  );
  within([t.qualityWidth], 0, 100, 'qualityWidth');
  within([t.logWidth], 0, 4, 'logWidth');
  within([t.qualityMax], 1, 100, 'qualityMax');
  within([t.qualityMin], 1, t.qualityMax, 'qualityMin');
  within([t.modelA, t.modelB, t.modelR, t.modelCorrelation, t.modelError], -1e30, 1e30, 'model');
  within(t.mse, 0, 65025, 'mse');
  within(t.dssim, 0, 2, 'dssim');
  within(t.skipDssim, 0, 2, 'skipDssim');
  t.knotQuality.forEach((q, k) => {
    const above = t.rungQuality.findIndex((r) => r >= q);
    const before = k > 0 ? t.knotQuality[k - 1] : 0;
    require(q > before && above > 0 && t.rungQuality[above] !== q, 'knotQuality', 'rising, between rungs', q);
    if (before > t.rungQuality[above - 1])
      require(t.knotPosition[k] >= t.knotPosition[k - 1], 'knotPosition', 'not falling', t.knotPosition[k]);
  });
  within(t.surfaceFraction, 0, 1, 'surfaceFraction');
  within(t.quality, 0, 100, 'quality');
  const listed = new Uint8Array(f);
  for (const fragment of t.order) {
    require(fragment < f && !listed[fragment], 'order', 'every stored fragment once', fragment);
    listed[fragment] = 1;
  }
  const stored = new Uint8Array(f);
  for (let k = 0; k < t.sizeBytes.length; ++k) {
    if (t.sizeBytes[k] > 0) stored[k % f] = 1;
    else
      for (let b = 8 * k; b < 8 * k + 8; ++b)
        require(t.digest[b] === 0, 'digest', '0 where nothing is stored', 'a digest');
  }
  for (let k = 0; k < f; ++k)
    require(stored[k] === listed[k], 'order', 'exactly the fragments that have a size', `fragment ${k}`);
}

/** Tables of a plane from its section's bytes; counts are checked before anything is allocated. */
export function parseTablesSection(bytes: Uint8Array, minor: number, place: string): PlaneTables {
  const input = new BytesIn(bytes, `${file}: ${place}`);
  const t = emptyTables();
  t.columns = input.u32();
  t.rows = input.u32();
  t.scales = input.u8();
  const rungs = input.u8();
  const w = { size: input.u8(), feature: input.u8() };
  t.allocation = input.u8();
  if (input.number(3) !== 0 && minor <= formatMinor) input.fail('3 zero bytes', 'others');
  for (const name of parameters) t[name] = input.f32();
  const order = input.u32();
  if (t.columns === 0 || t.rows === 0 || t.columns > mostFragments || t.rows > Math.floor(mostFragments / t.columns))
    input.fail('1 to 65535 fragments', `${t.columns} x ${t.rows}`);
  if (t.scales >= mostScales || rungs === 0 || rungs > mostRungs || order > fragmentCount(t) || t.allocation > 1)
    input.fail('at most 99 scales, 100 rungs, every fragment once and allocation 0 or 1', 'more');
  if (w.size < 1 || w.size > 4 || w.feature < 1 || w.feature > 3)
    input.fail('widths of 1 to 4 and 1 to 3 bytes', `${w.size}, ${w.feature}`);
  const expected = sectionBytes(fragmentCount(t), rungs, t.scales + 1, order, w) + (minor < 1 ? 0 : 4);
  if (bytes.length < expected) input.fail(`${expected} bytes`, `${bytes.length}`);
  readArrays(input, t, rungs, order, w);
  readExtension(input, t, minor);
  checkPlane(t, place);
  if (w.size !== widthOf(t.sizeBytes) || w.feature !== widthOf(t.features))
    input.fail('the least width that holds the values', 'another');
  return t;
}

/** One plane's tables; the section's digest is checked. */
export async function readTablesSection(head: TablesHead, plane: number, section: Uint8Array): Promise<PlaneTables> {
  const s = head.planes[plane];
  const place = `plane ${plane}`;
  if (section.length !== s.bytes) throw new FormatError(file, place, `${s.bytes} bytes`, `${section.length}`);
  const digest = toHex(await sha256(section));
  if (digest !== toHex(s.sha256)) throw new FormatError(file, place, `SHA-256 ${toHex(s.sha256)}`, digest);
  return parseTablesSection(section, head.minor, place);
}
