import { FormatError } from './errors';
import { JsonAt, parseJson } from './json_fields';
import * as layout from './layout';

/** The manifest with its ZIP header fits in this many bytes, whatever the model: one request bootstraps a client. */
export const bootstrapBytes = 16384;
/** "Enough at any size": displayPx... of S_0 and the last step's upToPx. */
export const anyDisplayPx = 1e9;
/** Version of the format that this reader is for. */
export const formatMajor = 1;
export const formatMinor = 1;
/** Features that packages may require of this reader. */
export const knownFeatures: readonly string[] = ['codec-jpeg-progressive', 'codec-webp', 'mips'];
/** Previews whose place the manifest tells. */
export const mostManifestPreviews = 256;

/** Where an entry's data stands in the container, and its digest. */
export interface EntryRef {
  path: string;
  offset: number;
  bytes: number;
  sha256: Uint8Array;
}
/** An entry whose head tells where its pages are, and their digests. */
export interface PagedRef extends EntryRef {
  headBytes: number;
  headSha256: Uint8Array;
}
/** Where the stream of vertex splits stands. */
export interface StreamRef {
  offset: number;
  bytes: number;
  headBytes: number;
  headSha256: Uint8Array;
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
  /** Why it has more vertices than its scale asks for, or (on the last one) why none is coarser; mostly "". Since 1.1. */
  floor: string;
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
  /** Added to a mesh's position it gives the source's coordinates. */
  origin: Vector3;
  boundsMin: Vector3;
  boundsMax: Vector3;
  /** O_V: largest extent of the bounds. */
  objectHeight: number;
  /** Area of S_0; 0 = not said. */
  surfaceArea: number;
  jnd: number;
  /** S_0 first. */
  scales: ManifestScale[];
  /** Coarse to fine. */
  steps: ManifestStep[];
  /** Texture planes, mips included. */
  planeCount: number;
  firstPicture: ByteRange & { sha256: Uint8Array };
  previews: ByteRange[];
  index: PagedRef;
  tables: PagedRef;
  textures: EntryRef;
  quality: EntryRef;
  provenance: EntryRef;
  stream?: StreamRef;
}

const largest = 1e300;
const columns = [
  'triangles', 'vertices', 'offset', 'bytes', 'sha256', 'major', 'errorMax', 'errorRms', 'p95', 'p99', 'displayPxJnd',
  'displayPxError', 'displayPxEdge',
];

function readOffset(at: JsonAt): number {
  const offset = at.integer(64);
  if (offset % 64 !== 0) at.fail('a multiple of 64', `${offset}`);
  return offset;
}

function readRef(at: JsonAt, path: string): EntryRef {
  return {
    path,
    offset: readOffset(at.at('offset')),
    bytes: at.at('bytes').integer(1),
    sha256: at.at('sha256').digest(),
  };
}

function readHead(at: JsonAt, bytes: number): { headBytes: number; headSha256: Uint8Array } {
  return { headBytes: at.at('headBytes').integer(16, bytes), headSha256: at.at('headSha256').digest() };
}

function readPagedRef(at: JsonAt, path: string): PagedRef {
  const ref = readRef(at, path);
  return { ...ref, ...readHead(at, ref.bytes) };
}

function readStream(at: JsonAt): StreamRef {
  const bytes = at.at('bytes').integer(1);
  return { offset: readOffset(at.at('offset')), bytes, ...readHead(at, bytes) };
}

function readVector(at: JsonAt): Vector3 {
  at.array(3, 3);
  return [0, 1, 2].map((i) => at.at(i).number(-largest, largest)) as Vector3;
}

function readVersion(at: JsonAt): Pick<Manifest, 'version' | 'requiredFeatures'> {
  const format = at.at('format').text(100);
  if (format !== 'texmesh') at.at('format').fail('texmesh', format);
  const major = at.at('version').at('major').integer(0, 1e6);
  const minor = at.at('version').at('minor').integer(0, 1e6);
  if (major !== formatMajor)
    at.at('version').at('major').fail(`${formatMajor}`, `${major}, which another reader is for`);
  const features = at.at('requiredFeatures');
  const requiredFeatures: string[] = [];
  for (let i = 0, n = features.array(0, 100); i < n; ++i) {
    const name = features.at(i).text(100);
    if (!knownFeatures.includes(name)) features.at(i).fail('a feature that this reader knows', name);
    requiredFeatures.push(name);
  }
  return { version: { major, minor }, requiredFeatures };
}

function readScales(at: JsonAt): ManifestScale[] {
  const n = at.at('scale').array(1, 100);
  for (const column of columns) at.at(column).array(n, n);
  const floors = at.has('floor');
  if (floors) at.at('floor').array(n, n);
  const scales: ManifestScale[] = [];
  for (let i = 0; i < n; ++i) {
    const integer = (name: string, least: number, most?: number): number => at.at(name).at(i).integer(least, most);
    const number = (name: string, most: number): number => at.at(name).at(i).number(0, most);
    const scale = integer('scale', 0, 99);
    if (i === 0 ? scale !== 0 : scale <= scales[i - 1].scale)
      at.at('scale').at(i).fail(i === 0 ? '0' : 'a rising number', `${scale}`);
    scales.push({
      scale,
      triangles: integer('triangles', 1, 0xffffffff),
      vertices: integer('vertices', 1, 0xffffffff),
      glb: {
        path: layout.meshPath(scale),
        offset: readOffset(at.at('offset').at(i)),
        bytes: integer('bytes', 1),
        sha256: at.at('sha256').at(i).digest(),
      },
      major: at.at('major').at(i).boolean(),
      errorMax: number('errorMax', largest),
      errorRms: number('errorRms', largest),
      p95: number('p95', largest),
      p99: number('p99', largest),
      displayPxJnd: number('displayPxJnd', anyDisplayPx),
      displayPxError: number('displayPxError', anyDisplayPx),
      displayPxEdge: number('displayPxEdge', anyDisplayPx),
      floor: floors ? at.at('floor').at(i).text(100) : '',
    });
  }
  return scales;
}

function readSteps(at: JsonAt, scales: ManifestScale[]): ManifestStep[] {
  const n = at.array(1, 100);
  const steps: ManifestStep[] = [];
  for (let i = 0; i < n; ++i) {
    const pair = at.at(i);
    pair.array(2, 2);
    const step = { upToPx: pair.at(0).number(0, anyDisplayPx), scale: pair.at(1).integer(0, 100) };
    if (!scales.some((s) => s.scale === step.scale)) pair.at(1).fail('a scale of the package', `${step.scale}`);
    if (i > 0 && step.upToPx <= steps[i - 1].upToPx) pair.at(0).fail('a rising number', 'another');
    if (i > 0 && step.scale >= steps[i - 1].scale) pair.at(1).fail('a finer scale', `${step.scale}`);
    steps.push(step);
  }
  if (steps[n - 1].upToPx !== anyDisplayPx) at.at(n - 1).at(0).fail('1e9', 'less');
  if (steps[n - 1].scale !== 0) at.at(n - 1).at(1).fail('0', `${steps[n - 1].scale}`);
  return steps;
}

function readFirstPicture(
  at: JsonAt,
  coarsest: EntryRef,
  features: string[],
): Pick<Manifest, 'planeCount' | 'firstPicture' | 'previews'> {
  const planeCount = at.at('planeCount').integer(0, 10000);
  const first = at.at('firstPicture');
  const offset = readOffset(first.at('offset'));
  if (offset !== coarsest.offset)
    first.at('offset').fail(`the offset of the coarsest mesh, ${coarsest.offset}`, `${offset}`);
  const firstPicture = {
    offset,
    bytes: first.at('bytes').integer(coarsest.bytes),
    sha256: first.at('sha256').digest(),
  };
  const most = Math.min(planeCount, mostManifestPreviews);
  const n = at.at('previews').array(features.includes('mips') ? Math.min(most, 1) : most, most);
  const previews: ByteRange[] = [];
  for (let i = 0; i < n; ++i) {
    const pair = at.at('previews').at(i);
    pair.array(2, 2);
    const range = { offset: readOffset(pair.at(0)), bytes: pair.at(1).integer(1) };
    if (range.offset < offset + coarsest.bytes || range.offset + range.bytes > offset + firstPicture.bytes)
      pair.fail('a range within the first picture, after the mesh', `${range.offset}`);
    previews.push(range);
  }
  return { planeCount, firstPicture, previews };
}

/**
 * Strict for what this version defines, ignores unknown fields, refuses an unknown major version and unknown required
 * features. FormatError names the place in the document.
 */
export function readManifest(json: Uint8Array): Manifest {
  const at = parseJson(json, layout.manifestPath, bootstrapBytes);
  const version = readVersion(at);
  const boundsMin = readVector(at.at('bounds').at('min'));
  const boundsMax = readVector(at.at('bounds').at('max'));
  for (let i = 0; i < 3; ++i)
    if (boundsMin[i] > boundsMax[i]) at.at('bounds').at('max').at(i).fail('at least the minimum', 'less');
  const scales = readScales(at.at('scales'));
  return {
    ...version,
    title: at.at('title').text(200),
    origin: readVector(at.at('origin')),
    boundsMin,
    boundsMax,
    objectHeight: at.at('objectHeight').number(0, largest),
    surfaceArea: at.has('surfaceArea') ? at.at('surfaceArea').number(0, largest) : 0,
    jnd: at.at('jnd').number(0, 1),
    scales,
    steps: readSteps(at.at('steps'), scales),
    ...readFirstPicture(at, scales[scales.length - 1].glb, version.requiredFeatures),
    index: readPagedRef(at.at('index'), layout.indexPath),
    tables: readPagedRef(at.at('tables'), layout.tablesPath),
    textures: readRef(at.at('textures'), layout.texturesPath),
    quality: readRef(at.at('quality'), layout.qualityPath),
    provenance: readRef(at.at('provenance'), layout.provenancePath),
    ...(at.has('stream') ? { stream: readStream(at.at('stream')) } : {}),
  };
}

/** The bytes of manifest.json from the first bytes of a container (section 2). */
export function manifestOfContainer(head: Uint8Array, file: string): Uint8Array {
  const start = [0x50, 0x4b, 3, 4, 10, 0, 0, 0, 0, 0];
  const isPackage =
    head.length >= 64 &&
    start.every((byte, i) => head[i] === byte) &&
    String.fromCharCode(...head.subarray(30, 43)) === layout.manifestPath;
  if (!isPackage) throw new FormatError(file, 'byte 0', 'a texmesh package', 'something else');
  const bytes = new DataView(head.buffer, head.byteOffset).getUint32(22, true);
  const room = Math.min(head.length, bootstrapBytes) - 64;
  if (bytes > room) throw new FormatError(file, 'entry manifest.json', `at most ${room} bytes`, `${bytes}`);
  return head.subarray(64, 64 + bytes);
}
