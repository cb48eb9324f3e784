import { BytesIn, readEntryStart } from './bytes_in';
import { tablesPath as file } from './entry_paths';
import { FormatError } from './errors';
import { formatMinor } from './manifest';
import { requireDigest } from './sha256';
import {
  byVqp, largestHalf, largestMse, maxFragments, maxPackageRungs, maxPlaneCells, maxScaleCount,
} from './shared_numbers';
import { PlaneTables, TablesHead, fragmentCount } from './tables';


/** Head of tables.bin; the bytes may stop after the head. */
export function readTablesHead(bytes: Uint8Array): TablesHead {
  const input = new BytesIn(bytes, file, 'T02');
  const minor = readEntryStart(input, 'TXMT', 'T01');
  const planes = input.u32();
  if (input.u32() !== 0 && minor <= formatMinor) input.fail('0', '', 'T01');
  if (planes > input.left / 36) input.fail('fewer planes', planes);
  const head: TablesHead = { minor, bytes: 16 + planes * 36, planes: [] };
  let offset = head.bytes;
  for (let p = 0; p < planes; ++p) {
    const section = { offset, bytes: input.u32(), sha256: input.raw(32) };
    offset += section.bytes;
    head.planes.push(section);
  }
  return head;
}

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
  if (half > largestHalf) input.fail('a finite binary16 >= 0', half, 'T04');
  return fromHalf(half);
}

/** What a section's first fields say of the rest; widths in bytes. */
interface Counts {
  scales: number;
  rungs: number;
  knots: number;
  listed: number;
  size: number;
  feature: number;
  density: number;
}

const sectionBytes = ({ scales, rungs, knots, listed, size, feature }: Counts): number =>
  36 + listed * 2 + rungs * 5 + knots * 3 + rungs * listed * (size + 12) + listed * (10 + scales * feature) +
    scales * 4;

function fill<T extends { [i: number]: number; length: number }>(values: T, get: () => number): T {
  for (let i = 0; i < values.length; ++i) values[i] = get();
  return values;
}

function readArrays(input: BytesIn, t: PlaneTables, c: Counts): void {
  const f = fragmentCount(t);
  const u32 = (): number => input.u32();
  const half = (): number => readHalf(input);
  const unit = (): number => input.u16() / 65535;
  t.order = fill(new Uint16Array(c.listed), () => input.u16());
  const seen = new Uint8Array(f);
  for (const fragment of t.order)
    if (fragment >= f || seen[fragment]++) input.fail('every fragment once', fragment, 'T05');
  t.rungQuality = input.raw(c.rungs);
  t.tableBytes = fill(new Uint32Array(c.rungs), u32);
  t.knotQuality = input.raw(c.knots);
  t.knotPosition = fill(new Float32Array(c.knots), unit);
  /** Fills what is stored of an array [lines * F]. */
  const listed = <T extends { [i: number]: number; length: number }>(values: T, get: () => number): T => {
    for (let line = 0; line < values.length; line += f) for (const fragment of t.order)
      values[line + fragment] = get();
    return values;
  };
  t.sizeBytes = listed(new Uint32Array(c.rungs * f), () => input.number(c.size));
  t.digest = new Uint8Array(c.rungs * f * 8);
  for (let r = 0; r < c.rungs; ++r) for (const fragment of t.order)
    t.digest.set(input.raw(8), 8 * (r * f + fragment));
  t.mse = listed(new Float32Array(c.rungs * f), half);
  t.dssim = listed(new Float32Array(c.rungs * f), half);
  t.skipDssim = listed(new Float32Array(f), half);
  t.coveredTexels = listed(new Uint32Array(f), u32);
  t.surfaceFraction = listed(new Float32Array(f), () => input.f32());
  t.features = listed(new Uint32Array(c.scales * f), () => input.number(c.feature));
  t.quality = fill(new Float32Array(c.scales), () => input.f32());
  if (t.allocation === byVqp) {
    t.vqp = listed(new Float32Array(f), () => input.u16() / 65535);
    if (c.density > 0) t.densityWeight = input.f32();
  }
}

function emptyTables(): PlaneTables {
  const none = new Float32Array(0);
  return {
    columns: 0, rows: 0, incremental: false,
    rungQuality: new Uint8Array(0), tableBytes: new Uint32Array(0), sizeBytes: new Uint32Array(0),
    digest: new Uint8Array(0), mse: none, dssim: none, coveredTexels: new Uint32Array(0),
    surfaceFraction: none,
    order: new Uint16Array(0), skipDssim: none, knotQuality: new Uint8Array(0), knotPosition: none,
    features: new Uint32Array(0), quality: none, allocation: 1, vqp: none, densityWeight: 0,
    qualityWidth: 60, logWidth: 0.7, qualityMin: 5, qualityMax: 97,
  };
}

const parameters = ['qualityWidth', 'logWidth', 'qualityMin', 'qualityMax'] as const;

/** The least number of bytes that holds every value. */
function widthOf(values: Uint32Array): number {
  let most = 0;
  for (const v of values) if (v > most) most = v;
  return most < 256 ? 1 : most < 65536 ? 2 : most < 16777216 ? 3 : 4;
}

/** Throws FormatError where values make no sense. */
function checkPlane(t: PlaneTables, place: string): void {
  const require = (good: boolean, rule: string, what: string, expected: string, found: unknown): void => {
    if (!good) throw new FormatError(file, `${place}/${what}`, expected, String(found), rule);
  };
  const within = (values: ArrayLike<number>, least: number, most: number, what: string): void => {
    for (let k = 0; k < values.length; ++k)
      if (!(values[k] >= least && values[k] <= most))
        require(false, 'T04', `${what}[${k}]`, `${least} to ${most}`, values[k]);
  };
  t.rungQuality.forEach((q, r) =>
    require(q >= 1 && q <= 100 && (r === 0 || q > t.rungQuality[r - 1]), 'T08', 'rungQuality', 'rising', q),
  );
  within([t.qualityWidth], 0, 100, 'qualityWidth');
  within([t.logWidth], 0, 4, 'logWidth');
  within([t.qualityMax], 1, 100, 'qualityMax');
  within([t.qualityMin], 1, t.qualityMax, 'qualityMin');
  within(t.mse, 0, largestMse, 'mse');
  within(t.dssim, 0, 2, 'dssim');
  within(t.skipDssim, 0, 2, 'skipDssim');
  t.knotQuality.forEach((q, k) => {
    const above = t.rungQuality.findIndex((r) => r >= q);
    const before = k > 0 ? t.knotQuality[k - 1] : 0;
    require(q > before && above > 0 && t.rungQuality[above] !== q, 'T08', 'knotQuality',
      'rising, between rungs', q);
    if (before > t.rungQuality[above - 1])
      require(t.knotPosition[k] >= t.knotPosition[k - 1], 'T08', 'knotPosition', 'rising', t.knotPosition[k]);
  });
  within(t.surfaceFraction, 0, 1, 'surfaceFraction');
  within([t.densityWeight], 0, 1, 'densityWeight');
  within(t.quality, 0, 100, 'quality');
  for (let line = 0; line < t.sizeBytes.length; line += fragmentCount(t))
    for (const f of t.order)
      require(t.sizeBytes[line + f] > 0, 'T06', 'sizeBytes', 'bytes at every rung', `none of ${f}`);
}

/** Fields in front of a section's arrays. */
function readStart(input: BytesIn, t: PlaneTables, minor: number): Counts {
  t.columns = input.u32();
  t.rows = input.u32();
  const c: Counts = { scales: input.u8(), rungs: input.u8(), size: input.u8(), feature: input.u8(), knots: 0,
    listed: 0, density: 0 };
  t.allocation = input.u8();
  if (t.allocation === byVqp && minor > 0) c.density = 4;
  const flags = input.u8();
  c.knots = input.u8();
  const reserved = input.u8();
  if (minor <= formatMinor && (flags > 1 || reserved !== 0)) input.fail('0', `${flags}, ${reserved}`, 'W05');
  t.incremental = (flags & 1) !== 0;
  for (const name of parameters) t[name] = input.f32();
  c.listed = input.u32();
  const { columns, rows } = t;
  if (columns === 0 || rows === 0 || columns > maxFragments || rows > Math.floor(maxFragments / columns))
    input.fail('1 to 65535 fragments');
  const good = c.scales > 0 && c.scales <= maxScaleCount && c.rungs > 0 && c.rungs <= maxPackageRungs &&
    c.listed <= columns * rows;
  if (!good) input.fail('counts in their ranges');
  if (t.allocation > 3) input.fail('allocation 0 to 3', t.allocation, 'T13');
  const cells = columns * rows * (5 * c.rungs + c.scales);
  if (cells > maxPlaneCells) input.fail('at most 2^24 cells', cells, 'L02');
  if (c.size < 1 || c.size > 4 || c.feature < 1 || c.feature > 3)
    input.fail('widths of 1 to 4 and 1 to 3 bytes');
  return c;
}

/** Tables of a plane from its section's bytes; counts are checked before anything is allocated. */
export function parseTablesSection(bytes: Uint8Array, minor: number, place: string): PlaneTables {
  const input = new BytesIn(bytes, `${file}: ${place}`, 'T03');
  const t = emptyTables();
  const counts = readStart(input, t, minor);
  const expected = sectionBytes(counts) + (t.allocation === byVqp ? 2 * counts.listed + counts.density : 0);
  if (bytes.length < expected) input.fail(`${expected} bytes`, bytes.length);
  readArrays(input, t, counts);
  if (minor <= formatMinor) input.finish();
  checkPlane(t, place);
  if (counts.size !== widthOf(t.sizeBytes) || counts.feature !== widthOf(t.features))
    input.fail('the least widths', '', 'T08');
  return t;
}

/** One plane's tables; the section's digest is checked. */
export async function readTablesSection(head: TablesHead, plane: number,
    section: Uint8Array): Promise<PlaneTables> {
  const s = head.planes[plane];
  const place = `plane ${plane}`;
  if (section.length !== s.bytes)
    throw new FormatError(file, place, `${s.bytes} bytes`, `${section.length}`, 'T02');
  await requireDigest(section, s.sha256, file, place, 'T02');
  return parseTablesSection(section, head.minor, place);
}
