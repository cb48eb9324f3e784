import { sha256, toHex } from './sha256';
import { codecTraits } from './codec';
import { FormatError } from './errors';
import { parseIndexPage, readIndexHead } from './index_table';
import { ByteRange, EntryRef, Manifest, hasGlb, manifestOfContainer, readManifest } from './manifest';
import { QualityTable, readQuality } from './quality_table';
import { parseTablesSection, readTablesHead } from './read_tables';
import { PlaneTables, fragmentCount, rungCount } from './tables';
import { TextureInfo, missingFeature, readTextures } from './textures';
import * as paths from './entry_paths';
import * as layout from './layout';

// Documents are decoded and checked against the manifest and against each other, meshes by themselves: in
// workers, or on this thread where there are none. Digests have been checked before.

export { readIndex } from './index_table';
export { plainGlb } from './glb';
export { requireSelfContained } from './glb';

const sum = (values: Uint32Array): number => values.reduce((total, v) => total + v, 0);

function require(good: boolean, rule: string, file: string, place: string, expected: string,
    found: unknown = ''): asserts good {
  if (!good) throw new FormatError(file, place, expected, `${found}`, rule);
}

/** Manifest and package id from manifest.json, or from the start of a container that `container` names. */
export async function manifest(bytes: Uint8Array, container = ''): Promise<{ parsed: Manifest; id: string }> {
  const json = container ? manifestOfContainer(bytes, container) : bytes;
  return { parsed: readManifest(json), id: toHex(await sha256(json)) };
}

/** A page of index.bin. */
export interface PageRef extends EntryRef {
  /** -1: the page of entries that belong to no plane. */
  plane: number;
  entries: number;
  minor: number;
}
/** The entries of one package have one version. */
function requireMinor(minor: number, { version }: Manifest, file: string): void {
  require(minor === version.minor, 'R01', file, '', `minor version ${version.minor}`, minor);
}

/** The pages of index.bin, from its head or more. */
export function indexPages(bytes: Uint8Array, m: Manifest): PageRef[] {
  const { index } = m;
  const { bytes: headBytes, pages, minor } = readIndexHead(bytes);
  requireMinor(minor, m, paths.indexPath);
  require(headBytes === index.headBytes, 'R02', paths.indexPath, 'head', `${index.headBytes} bytes`,
    headBytes);
  return pages.map((p) => ({ ...p, minor, rule: 'I04', path: `index of plane ${p.plane}`,
    offset: index.offset + p.offset }));
}

/** The entries of a page of index.bin by path. Those without a plane must be as the manifest says. */
export function indexPage(bytes: Uint8Array, { plane, entries: count, minor }: PageRef,
    m: Manifest): Map<string, EntryRef> {
  const entries = new Map(parseIndexPage(bytes, plane, count, minor).map((e) => [e.path, e]));
  if (plane >= 0) return entries;
  const refs: (ByteRange & { path: string; sha256?: Uint8Array } | undefined)[] = [
    m.tables, m.textures, m.quality, m.provenance, m.about, m.stream, m.thesis, m.poster,
    m.annotations,
    ...[...m.scales.filter(hasGlb), ...m.proxies].map(({ glb }) => glb),
  ];
  for (const ref of refs) {
    if (!ref) continue;
    const e = entries.get(ref.path);
    const same = e && e.offset === ref.offset && e.bytes === ref.bytes &&
      (ref.sha256 ?? e.sha256).every((byte, i) => byte === e.sha256[i]);
    require(!!same, 'R03', paths.indexPath, ref.path, 'what the manifest says of it');
  }
  return entries;
}

/** The planes of textures.json. */
export function textures(bytes: Uint8Array, { planeCount, requiredFeatures }: Manifest): TextureInfo[] {
  const planes = readTextures(bytes);
  require(planes.length === planeCount, 'R04', paths.texturesPath, '', `${planeCount} planes`, planes.length);
  const feature = missingFeature(planes, requiredFeatures);
  require(feature === '', 'R05', paths.manifestPath, '/requiredFeatures', feature);
  return planes;
}

/** Losses of lit pictures, of the manifest's scales. */
export function quality(bytes: Uint8Array, { scales }: Manifest): QualityTable {
  const table = readQuality(bytes);
  const same = table.scales.length === scales.length && scales.every((s, k) => s.scale === table.scales[k]);
  require(same, 'R14', paths.qualityPath, '/scales', "the manifest's scales");
  return table;
}

/** A plane's section of tables.bin. */
export interface SectionRef extends EntryRef {
  minor: number;
  /** Rows of scales that the section must have. */
  scales: number;
}
/** The sections of tables.bin by plane, from its head or more. */
export function tableSections(bytes: Uint8Array, m: Manifest): SectionRef[] {
  const { tables: ref, planeCount, scales } = m;
  const head = readTablesHead(bytes);
  requireMinor(head.minor, m, paths.tablesPath);
  require(head.bytes === ref.headBytes, 'R02', paths.tablesPath, 'head', `${ref.headBytes} bytes`,
    head.bytes);
  require(head.planes.length === planeCount, 'R04', paths.tablesPath, '', `${planeCount} planes`,
    head.planes.length);
  const last = head.planes[planeCount - 1];
  const end = last ? last.offset + last.bytes : head.bytes;
  require(end === ref.bytes, 'T02', paths.tablesPath, '', `${end} bytes`, ref.bytes);
  return head.planes.map((s, p) => ({ ...s, rule: 'T02', minor: head.minor, scales: scales.length,
    path: `texture plane ${p}`, offset: ref.offset + s.offset }));
}

/** Tables of one plane, and where its fragments are. */
export interface PlaneDocument {
  tables: PlaneTables;
  /** What the fragments of its rungs have in common. */
  tableStreams: EntryRef;
  /** Packs by rung. */
  packs: EntryRef[];
  /** [rung * F + fragment] offset of each fragment's stream within its rung's pack. */
  offsets: Float64Array;
}

/** Tables from a section of tables.bin, which must agree with textures.json and the index. */
export function planeTables(bytes: Uint8Array, { minor, scales }: SectionRef, plane: number,
    info: TextureInfo, entries: Map<string, EntryRef>): PlaneDocument {
  const tables = parseTablesSection(bytes, minor, `plane ${plane}`);
  const requireHere = (good: boolean, rule: string, expected: string): void =>
    require(good, rule, paths.tablesPath, `texture plane ${plane}`, expected);
  const { columns, rows, rungQuality, order, sizeBytes } = tables;
  const sameRungs = rungQuality.length === info.rungQuality.length &&
    info.rungQuality.every((q, r) => q === rungQuality[r]);
  requireHere(columns === info.columns && rows === info.rows, 'R08', 'the grid of textures.json');
  requireHere(sameRungs, 'R09', 'the rungs of textures.json');
  requireHere(tables.quality.length === scales, 'R11', `${scales} rows`);
  requireHere(tables.incremental === codecTraits(info.codec).incremental, 'R10', 'tables of the codec');
  const requireSum = (path: string, total: number, rule: string): void => {
    const entry = entries.get(path);
    requireHere(!!entry, 'R07', path);
    requireHere(entry!.bytes === total, rule, `${path} of ${total} bytes`);
  };
  requireSum(paths.tableStreamsPath(plane), sum(tables.tableBytes), 'R12');
  const n = fragmentCount(tables);
  const offsets = new Float64Array(n * rungCount(tables));
  for (let r = 0; r < rungCount(tables); ++r) {
    requireSum(layout.rungPath(plane, r), sum(sizeBytes.subarray(r * n, (r + 1) * n)), 'R13');
    let at = 0;
    for (const f of order) {
      offsets[r * n + f] = at;
      at += sizeBytes[r * n + f];
    }
  }
  const entry = (path: string): EntryRef => entries.get(path)!;
  const packs = Array.from(tables.rungQuality, (_, r) => entry(layout.rungPath(plane, r)));
  return { tables, tableStreams: entry(paths.tableStreamsPath(plane)), packs, offsets };
}
