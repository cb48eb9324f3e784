import * as paths from './entry_paths';
import { FormatError, otherMajor } from './errors';
import { JsonAt, parseJson } from './json_fields';
import * as layout from './layout';
import {
  formatMajor, formatMinor, largest, maxFloorBytes, maxPackagePlanes, maxPosterSide, maxProxySizePx,
  maxProxySizes, maxProxyTexturePx, maxScales, maxTitleBytes,
} from './shared_numbers';

export { formatMajor, formatMinor };
/** Features that packages may require of this reader. */
export const knownFeatures: readonly string[] = ['codec-jpeg-progressive', 'codec-jpeg-xy', 'codec-webp'];

/** Where an entry's data stands in the container, and its digest. */
export interface EntryRef extends ByteRange {
  path: string;
  sha256: Uint8Array;
  /** The rule of format/SPEC.md that bytes of another digest break; absent = I08. */
  rule?: string;
}
/** An entry whose head tells where its pages are, and their digests. */
export interface PagedRef extends EntryRef {
  headBytes: number;
  headSha256: Uint8Array;
}
/** Where the stream of vertex splits stands. */
export type StreamRef = Omit<PagedRef, 'sha256'>;
/** The picture of the whole object, for lists and search engines. */
export interface PosterRef extends EntryRef {
  widthPx: number;
  heightPx: number;
}
/** Offset and length in bytes. */
export interface ByteRange {
  offset: number;
  bytes: number;
}
/** x, y, z. */
export type Vector3 = [number, number, number];

/** A mesh scale; lengths in object units, displayed heights in px. */
export interface ManifestScale {
  /** Scale number; 0 = S_0, the source's shape. */
  scale: number;
  triangles: number;
  vertices: number;
  /** What is read for the scale: its file, or a prefix of the vertex-split stream; see hasGlb. */
  glb: EntryRef;
  /** The last scale of a tier whose members cannot be told apart. */
  major: boolean;
  errorMax: number;
  errorRms: number;
  p95: number;
  p99: number;
  displayPxJnd: number;
  displayPxError: number;
  displayPxEdge: number;
  /** By lit pictures: up to this height no view of the scale can be told from S_0's; 0 = at no height. */
  displayPxFlip: number;
  /** Why the scale has too many vertices, or why (the last scale) none is coarser; mostly "". */
  floor: string;
}
/** Whether a scale has a file of its own; the others stand in the vertex-split stream alone. */
export const hasGlb = ({ glb }: ManifestScale): boolean => glb.path !== layout.splitStreamPath;
/** The whole object in a small GLB that stands alone, with textures of its own. */
export interface ManifestProxy {
  glb: EntryRef;
  triangles: number;
  vertices: number;
  /** Longest side of its textures; 0: it has none. */
  texturePx: number;
  /** Mean FLIP of lit pictures against S_0, one per Manifest.proxySizesPx. */
  flip: number[];
  /** The same: 95th percentile. */
  flipP95: number[];
}
/** One step of the step function from displayed height to scale. */
export interface ManifestStep {
  upToPx: number;
  scale: number;
}
/** manifest.json (format/SPEC.md, section 5). */
export interface Manifest {
  version: { major: number; minor: number };
  requiredFeatures: string[];
  title: string;
  /** Mesh positions and this vector add up to the source's coordinates. */
  origin: Vector3;
  boundsMin: Vector3;
  boundsMax: Vector3;
  /** O_V: largest extent of the bounds. */
  objectHeight: number;
  /** Area of S_0, object units squared. */
  surfaceArea: number;
  jnd: number;
  /** Scales, S_0 first. */
  scales: ManifestScale[];
  /** Steps, coarse to fine. */
  steps: ManifestStep[];
  /** Displayed heights at which proxies were measured, px, rising. */
  proxySizesPx: number[];
  /** Proxies, smallest first. */
  proxies: ManifestProxy[];
  /** Number of texture planes, mips included. */
  planeCount: number;
  index: PagedRef;
  tables: PagedRef;
  textures: EntryRef;
  quality: EntryRef;
  provenance: EntryRef;
  about: EntryRef;
  stream?: StreamRef;
  /** thesis.bin, which no load reads. */
  thesis?: EntryRef;
  poster?: PosterRef;
  /** annotations.json, which texmesh/notes reads. */
  annotations?: EntryRef;
}

/** What is shown first: the smallest proxy, where there is none the GLB of the coarsest scale. */
export const firstPicture = ({ proxies, scales }: Manifest): EntryRef =>
  (proxies[0] ?? scales[scales.length - 1]).glb;

const lengths = ['errorMax', 'errorRms', 'p95', 'p99'] as const;
const heights = ['displayPxJnd', 'displayPxError', 'displayPxEdge', 'displayPxFlip'] as const;

function readOffset(at: JsonAt): number {
  const offset = at.by('M05').integer(64);
  if (offset % 64 !== 0) at.fail('a multiple of 64', offset, 'M05');
  return offset;
}

function readRange(at: Pick<JsonAt, 'at'>): ByteRange {
  return { offset: readOffset(at.at('offset')), bytes: at.at('bytes').integer(1) };
}

function readRef(at: Pick<JsonAt, 'at'>, path: string): EntryRef {
  return { path, ...readRange(at), sha256: at.at('sha256').digest() };
}

function readHead(at: JsonAt, bytes: number): { headBytes: number; headSha256: Uint8Array } {
  return { headBytes: at.at('headBytes').integer(16, bytes), headSha256: at.at('headSha256').digest() };
}

function readPagedRef(at: JsonAt, path: string): PagedRef {
  const ref = readRef(at, path);
  return { ...ref, ...readHead(at, ref.bytes) };
}

function readStream(at: JsonAt): StreamRef {
  const range = readRange(at);
  return { path: layout.splitStreamPath, ...range, ...readHead(at, range.bytes) };
}

function readPoster(at: JsonAt): PosterRef {
  const ref = readRef(at, layout.posterPath);
  at.at('bytes').by('O01').integer(1, 1e6);
  const [widthPx, heightPx] =
    ['widthPx', 'heightPx'].map((side) => at.at(side).by('O01').integer(1, maxPosterSide));
  return { ...ref, widthPx, heightPx };
}

function readVector(at: JsonAt): Vector3 {
  return at.each(3, 3, (c) => c.number(-largest, largest)) as Vector3;
}

function readVersion(at: JsonAt): Pick<Manifest, 'version' | 'requiredFeatures'> {
  const format = at.at('format').by('M01');
  if (format.text(100) !== 'texmesh') format.fail('texmesh');
  const version = at.at('version').by('M01');
  const [major, minor] = ['major', 'minor'].map((name) => version.at(name).integer(0, 1e6));
  if (major !== formatMajor) version.at('major').fail(`${formatMajor}`, otherMajor(major), 'W03');
  const requiredFeatures = at.at('requiredFeatures').each(0, 100, (feature) => {
    const name = feature.text(100);
    if (!knownFeatures.includes(name)) feature.fail('a known feature', name, 'M02');
    return name;
  });
  return { version: { major, minor }, requiredFeatures };
}

/** Scales from an array for each field, all of one length. */
function readScales(at: JsonAt): ManifestScale[] {
  const n = at.at('scale').array(1, maxScales);
  let before = -1;
  return at.at('scale').each(n, n, (scaleAt, i) => {
    const field = (name: string): JsonAt => {
      const column = at.at(name);
      column.by('M10').array(n, n);
      return column.at(i);
    };
    const numbers = <K extends string>(names: readonly K[], most: number, rule?: string): Record<K, number> =>
      Object.fromEntries(names.map((name) => [name, field(name).by(rule).number(0, most)])) as
        Record<K, number>;
    const scale = scaleAt.integer(0, 99);
    if (i === 0 ? scale !== 0 : scale <= before) scaleAt.fail('0, then rising', scale, 'M10');
    before = scale;
    return {
      scale,
      triangles: field('triangles').integer(1, 0xffffffff),
      vertices: field('vertices').integer(1, 0xffffffff),
      glb: readRef({ at: field as JsonAt['at'] }, paths.meshPath(scale)),
      major: field('major').boolean(),
      ...numbers(lengths, largest),
      ...numbers(heights, layout.anyDisplayPx, 'M11'),
      floor: field('floor').text(maxFloorBytes),
    };
  });
}

function readSteps(at: JsonAt, scales: ManifestScale[]): ManifestStep[] {
  let before: ManifestStep = { upToPx: -1, scale: Infinity };
  const steps = at.each(1, maxScales, (pair) => {
    pair.array(2, 2);
    const step = { upToPx: pair.at(0).number(0, layout.anyDisplayPx), scale: pair.at(1).integer(0, 100) };
    if (!scales.some((s) => s.scale === step.scale)) pair.fail('a scale of the package', step.scale);
    if (step.upToPx <= before.upToPx) pair.fail('a rising number');
    if (step.scale >= before.scale) pair.fail('a finer scale');
    return (before = step);
  });
  if (before.upToPx !== layout.anyDisplayPx || before.scale !== 0) at.fail('[1e9, 0] at the end');
  return steps;
}

/** Numbers that rise strictly. */
function readRising(at: JsonAt, most: number, rule: string, read: (item: JsonAt) => number): number[] {
  let before = -Infinity;
  return at.each(1, most, (item) => {
    const value = read(item);
    if (value <= before) item.fail('a rising number', `${value}`, rule);
    return (before = value);
  });
}

/** Proxies from an array for each field, all of one length. */
function readProxies(at: JsonAt): Pick<Manifest, 'proxySizesPx' | 'proxies'> {
  const proxySizesPx =
    readRising(at.at('sizesPx'), maxProxySizes, 'M23', (size) => size.number(1, maxProxySizePx));
  const { length: n } = readRising(at.at('bytes'), 8, 'M24', (bytes) => bytes.integer(1));
  const proxies = at.at('bytes').each(n, n, (_, i) => {
    const field = (name: string): JsonAt => {
      at.at(name).array(n, n);
      return at.at(name).at(i);
    };
    const losses = (name: string): number[] =>
      field(name).each(proxySizesPx.length, proxySizesPx.length, (loss) => loss.number(0, 1));
    return {
      glb: readRef({ at: field as JsonAt['at'] }, paths.proxyPath(i)),
      triangles: field('triangles').integer(1, 0xffffffff),
      vertices: field('vertices').integer(1, 0xffffffff),
      texturePx: field('texturePx').integer(0, maxProxyTexturePx),
      flip: losses('flip'),
      flipP95: losses('flipP95'),
    };
  });
  return { proxySizesPx, proxies };
}

/** Gives the stream's path to scales whose place is that of the stream: they are prefixes of it. */
function resolveStreamScales(at: JsonAt, scales: ManifestScale[], stream: StreamRef): void {
  let before = stream.headBytes;
  for (let i = scales.length - 1; i >= 0; --i) {
    const { glb } = scales[i];
    if (glb.offset !== stream.offset) continue;
    if (i === 0 || i === scales.length - 1) at.fail('GLBs of the finest and the coarsest scale', '', 'M18');
    if (glb.bytes <= before || glb.bytes > stream.bytes)
      at.fail(`prefixes of more than ${before} bytes`, glb.bytes, 'M19');
    before = glb.bytes;
    glb.path = layout.splitStreamPath;
  }
}

/**
 * Reads manifest.json: strict about fields of this version, ignores unknown fields, refuses an unknown major
 * version and unknown required features. FormatError names the place in the document.
 */
export function readManifest(json: Uint8Array): Manifest {
  const at = parseJson(json, paths.manifestPath, layout.bootstrapBytes);
  const version = readVersion(at);
  const bounds = at.at('bounds');
  const [boundsMin, boundsMax] = ['min', 'max'].map((name) => readVector(bounds.at(name)));
  boundsMax.forEach((most, i) => {
    if (boundsMin[i] > most) bounds.fail('at least the minimum', '', 'M03');
  });
  const scales = readScales(at.at('scales'));
  const stream = at.has('stream') ? readStream(at.at('stream')) : undefined;
  if (stream) resolveStreamScales(at.at('scales'), scales, stream);
  return {
    ...version,
    title: at.at('title').text(maxTitleBytes),
    origin: readVector(at.at('origin')),
    boundsMin,
    boundsMax,
    objectHeight: at.at('objectHeight').number(0, largest),
    surfaceArea: at.at('surfaceArea').number(0, largest),
    jnd: at.at('jnd').number(0, 1),
    scales,
    steps: readSteps(at.at('steps').by('M21'), scales),
    ...(at.has('proxies') ? readProxies(at.at('proxies').by('M23')) : { proxySizesPx: [], proxies: [] }),
    planeCount: at.at('planeCount').integer(0, maxPackagePlanes),
    index: readPagedRef(at.at('index'), paths.indexPath),
    tables: readPagedRef(at.at('tables'), paths.tablesPath),
    textures: readRef(at.at('textures'), paths.texturesPath),
    quality: readRef(at.at('quality'), paths.qualityPath),
    provenance: readRef(at.at('provenance'), paths.provenancePath),
    about: readRef(at.at('about'), paths.aboutPath),
    ...(stream ? { stream } : {}),
    ...(at.has('thesis') ? { thesis: readRef(at.at('thesis'), paths.thesisPath) } : {}),
    ...(at.has('annotations')
      ? { annotations: readRef(at.at('annotations'), paths.annotationsPath) } : {}),
    ...(at.has('poster') ? { poster: readPoster(at.at('poster')) } : {}),
  };
}

/** The bytes of manifest.json from the first bytes of a container (section 2). */
export function manifestOfContainer(head: Uint8Array, file: string): Uint8Array {
  const text = (begin: number, end: number): string => String.fromCharCode(...head.subarray(begin, end));
  if (text(0, 10) !== 'PK\x03\x04\n\0\0\0\0\0' || text(30, 43) !== paths.manifestPath || head.length < 64)
    throw new FormatError(file, 'byte 0', 'a texmesh package', '', 'K11');
  const bytes = new DataView(head.buffer, head.byteOffset).getUint32(22, true);
  const room = Math.min(head.length, layout.bootstrapBytes) - 64;
  if (bytes > room)
    throw new FormatError(file, paths.manifestPath, `at most ${room} bytes`, `${bytes}`, 'K12');
  return head.subarray(64, 64 + bytes);
}
