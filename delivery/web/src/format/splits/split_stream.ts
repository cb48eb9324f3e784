import { samePrefix, sha256 } from '../sha256';
import { BytesIn } from '../bytes_in';
import { FormatError } from '../errors';
import { splitStreamPath as file } from '../layout';
import { mostPerByte, mostSplits, splitStreamMajor } from '../shared_numbers';
import { SplitCodec } from './split_codec';
import { ValueDecoder, valueModelCount } from './split_coder';
import { SplitMesh } from './split_mesh';

/** Kinds of attributes: TEXCOORD_0, TEXCOORD_1, normals, colours. */
export type SplitKind = 'uv0' | 'uv1' | 'normal' | 'colour';
const kinds: readonly SplitKind[] = ['uv0', 'uv1', 'normal', 'colour'];

/** value = place * (range / (2^bits - 1)) + origin, in binary32, operation by operation. */
export interface SplitGrid {
  bits: number;
  origin: number[];
  range: number;
}
/** An attribute that every wedge has a value of. */
export interface SplitAttribute {
  kind: SplitKind;
  components: number;
  grid: SplitGrid;
}
/** A scale that the stream passes: complete after its first `blocks` blocks. */
export interface SplitScale {
  scale: number;
  blocks: number;
  points: number;
  wedges: number;
  faces: number;
  /** Number of faces with three different places. */
  triangles: number;
}
/** A block is decoded at once. */
export interface SplitBlock {
  isPatch: boolean;
  /** Number of faces or splits. */
  count: number;
  /** Offset in the stream. */
  offset: number;
  /** Bytes of connectivity, positions, attributes. */
  parts: number[];
  bytes: number;
  /** First 8 bytes of its SHA-256. */
  digest: Uint8Array;
}
/** Head of mesh/stream.bin (format/SPEC.md, section 11). */
export interface SplitStreamHead {
  position: SplitGrid;
  attributes: SplitAttribute[];
  /** Groups of faces that share material and part (number of the node). */
  groups: { material: number; part: number }[];
  /** Scales, coarsest first. */
  scales: SplitScale[];
  blocks: SplitBlock[];
  models: Uint8Array[];
  bytes: number;
}

const mostPoints = 2 ** 27;
const mostFaces = 2 ** 28;

function readVarint(input: BytesIn): number {
  let value = 0;
  for (let k = 0; k < 5; ++k) {
    const byte = input.u8();
    value += (byte & 0x7f) * 2 ** (7 * k);
    if (byte >= 0x80) continue;
    if (value > 0xffffffff || (byte === 0 && k > 0)) break;
    return value;
  }
  return input.fail('a short number', '', 'S06');
}

function readGrid(input: BytesIn, bits: number, axes: number): SplitGrid {
  const origin = Array.from({ length: axes }, () => input.f32());
  const range = input.f32();
  if (!origin.every(Number.isFinite)) input.fail('a finite origin', '', 'S04');
  if (!Number.isFinite(range) || !(range > 0)) input.fail('a finite range above 0', '', 'S04');
  return { bits, origin, range };
}
function readBits(input: BytesIn, least: number): number {
  const bits = input.u8();
  if (bits < least || bits > 24) input.fail(`${least} to 24 bits`, bits, 'S03');
  return bits;
}
function readAttributes(input: BytesIn, count: number): SplitAttribute[] {
  const attributes: SplitAttribute[] = [];
  let before = -1;
  for (let i = 0; i < count; ++i) {
    const number = input.u8();
    if (number >= kinds.length || number <= before) input.fail('rising attribute kinds', number, 'S03');
    before = number;
    const kind = kinds[number];
    const bits = readBits(input, kind === 'normal' ? 2 : 1);
    if (input.u16() !== 0) input.fail('0', '', 'S02');
    const grid = number < 2 ? readGrid(input, bits, 2) : { bits, origin: [], range: 1 };
    attributes.push({ kind, components: kind === 'colour' ? 4 : 2, grid });
  }
  return attributes;
}
function readScales(input: BytesIn, count: number, blocks: number): SplitScale[] {
  if (count === 0 || count > 100) input.fail('1 to 100 scales', count, 'S05');
  const scales: SplitScale[] = [];
  let before: SplitScale = { scale: 100, blocks: 0, points: 0, wedges: 0, faces: 0, triangles: 0 };
  for (let i = 0; i < count; ++i) {
    const s = { ...before, scale: input.u8() };
    for (const name of ['blocks', 'points', 'wedges', 'faces'] as const) {
      s[name] += readVarint(input);
      if (s[name] > 0xffffffff) input.fail('at most 32 bits', '', 'S05');
    }
    const hidden = readVarint(input);
    if (s.scale >= before.scale) input.fail('falling scale numbers', s.scale, 'S05');
    if (s.blocks <= before.blocks || s.blocks > blocks)
      input.fail(`rising numbers of blocks to ${blocks}`, s.blocks, 'S05');
    if (hidden > s.faces || s.wedges < s.points || s.faces === 0)
      input.fail('counts that can belong together', '', 'S05');
    s.triangles = s.faces - hidden;
    scales.push(s);
    before = s;
  }
  if (before.scale !== 0 || before.blocks !== blocks) input.fail('S_0 with all blocks', '', 'S05');
  return scales;
}
function readBlocks(input: BytesIn, count: number, partCount: number): SplitBlock[] {
  if (count > input.left / (partCount + 9)) input.fail('fewer blocks', count);
  const blocks: SplitBlock[] = [];
  for (let i = 0; i < count; ++i) {
    const code = readVarint(input);
    const b: SplitBlock = {
      isPatch: code % 2 === 1, count: Math.floor(code / 2), offset: 0, parts: [], bytes: 0,
      digest: new Uint8Array(0),
    };
    if (b.count === 0 || (!b.isPatch && b.count > mostSplits))
      input.fail(`1 to ${mostSplits} splits`, b.count, 'S07');
    for (let p = 0; p < partCount; ++p) b.parts.push(readVarint(input));
    b.bytes = b.parts.reduce((sum, n) => sum + n, 0);
    if (b.bytes < Math.floor(b.count / mostPerByte))
      input.fail(`a byte for every ${mostPerByte}`, b.bytes, 'S07');
    b.digest = input.raw(8);
    blocks.push(b);
  }
  return blocks;
}

/** Major version of streams that this reader is for; they have a version of their own. */

/** Reads the head of a stream; checks everything that can be checked without the blocks. */
export function readSplitHead(bytes: Uint8Array): SplitStreamHead {
  const input = new BytesIn(bytes, file, 'S08');
  input.expect('TXMS', 'S01');
  const major = input.u16();
  if (major !== splitStreamMajor) input.fail(`version ${splitStreamMajor}`, major, 'S01');
  input.u16();
  const positionBits = readBits(input, 1);
  const attributeCount = input.u8();
  const scaleCount = input.u8();
  if (input.u8() !== 0) input.fail('0', '', 'S02');
  const groupCount = input.u32();
  const blockCount = input.u32();
  const position = readGrid(input, positionBits, 3);
  const attributes = readAttributes(input, attributeCount);
  if (groupCount === 0 || groupCount > 65536 || groupCount > input.left / 4)
    input.fail('1 to 65536 groups', groupCount, 'S05');
  const groups = Array.from({ length: groupCount }, () => ({ material: input.u16(), part: input.u16() }));
  const scales = readScales(input, scaleCount, blockCount);
  const models = Array.from({ length: attributeCount + 1 }, () => input.raw(valueModelCount));
  const blocks = readBlocks(input, blockCount, attributeCount + 2);
  let at = input.at;
  for (const b of blocks) {
    b.offset = at;
    at += b.bytes;
  }
  return { position, attributes, groups, scales, blocks, models, bytes: input.at };
}

/** Builds the mesh, block by block. Memory grows with what has been decoded. */
export class SplitStreamReader {
  readonly head: SplitStreamHead;
  readonly mesh: SplitMesh;
  private readonly codec_: SplitCodec;
  private readonly positions_ = new ValueDecoder();
  private readonly values_: ValueDecoder[];
  private block_ = 0;
  private scale_ = 0;

  constructor(head: Uint8Array) {
    this.head = readSplitHead(head);
    const { attributes, scales, position, groups } = this.head;
    const last = scales[scales.length - 1];
    if (last.points > mostPoints || last.faces > mostFaces || last.wedges > 3 * mostFaces)
      throw new FormatError(file, 'head', `at most ${mostPoints} points and ${mostFaces} faces`, '', 'L09');
    this.mesh = new SplitMesh(attributes.map((a) => a.components));
    this.values_ = attributes.map(() => new ValueDecoder());
    const coded =
      attributes.map((a) => ({ normal: a.kind === 'normal', components: a.components, bits: a.grid.bits }));
    this.codec_ = new SplitCodec(this.mesh, coded, position.bits, groups.length, last, this.positions_,
      this.values_);
  }

  /** Number of blocks decoded so far. */
  get nextBlock(): number {
    return this.block_;
  }

  /** FormatError where whole blocks, from a place of the stream on, have other digests than the head says. */
  async check(from: number, bytes: Uint8Array): Promise<void> {
    for (const [i, { offset, bytes: size, digest }] of this.head.blocks.entries())
      if (offset >= from && offset + size <= from + bytes.length &&
          !samePrefix(await sha256(bytes.subarray(offset - from, offset - from + size)), digest))
        throw new FormatError(file, `block ${i}`, 'the digest of the head', '', 'S09');
  }
  /** Decodes whole blocks that stand one after the other, digests checked. */
  async addBlocks(bytes: Uint8Array): Promise<void> {
    for (let at = 0; at < bytes.length; ) {
      const b = this.head.blocks[this.block_];
      const fail = (expected: string, rule = 'S08'): never => {
        throw new FormatError(file, `block ${this.block_}`, expected, '', rule);
      };
      if (!b) return fail('no more blocks');
      const block = bytes.subarray(at, at + b.bytes);
      if (block.length !== b.bytes) fail(`${b.bytes} bytes`);
      if (!samePrefix(await sha256(block), b.digest)) fail('the digest of the head', 'S09');
      this.decode_(b, block);
      at += b.bytes;
    }
  }
  private decode_(b: SplitBlock, bytes: Uint8Array): void {
    const { scales } = this.head;
    if (this.block_ === 0 || this.block_ === scales[this.scale_].blocks) {
      if (this.block_ > 0) ++this.scale_;
      this.codec_.beginChapter();
    }
    let at = 0;
    const parts = b.parts.map((n) => bytes.subarray(at, (at += n)));
    this.codec_.start(parts[0]);
    [this.positions_, ...this.values_].forEach((v, i) => v.start(parts[i + 1], this.head.models[i]));
    if (b.isPatch) this.codec_.patch(b.count);
    else this.codec_.splits(b.count);
    ++this.block_;
    const scale = scales[this.scale_];
    if (this.block_ === scale.blocks) this.checkScale_(scale);
  }
  private checkScale_(scale: SplitScale): void {
    const { points, wedges, faceCount: faces } = this.mesh;
    const found = { points, wedges, faces, triangles: 0 };
    for (let face = 0; face < faces; ++face) found.triangles += Number(this.mesh.isVisible(face));
    for (const name of ['points', 'wedges', 'faces', 'triangles'] as const)
      if (scale[name] !== found[name])
        throw new FormatError(file, `scale ${scale.scale}`, `${scale[name]} ${name}`, `${found[name]}`,
          'S19');
  }
}
