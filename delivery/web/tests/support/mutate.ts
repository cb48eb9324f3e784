import { createHash } from 'node:crypto';
import { manifestOfContainer } from '../../src/reader';

/* eslint-disable @typescript-eslint/no-explicit-any */
/** A parsed document that a test changes as it likes. */
export type Json = any;

const text = new TextEncoder();
const sha256 = (bytes: Uint8Array): Uint8Array => new Uint8Array(createHash('sha256').update(bytes).digest());
const hex = (bytes: Uint8Array): string => Buffer.from(bytes).toString('hex');

/** A container whose documents tests change in place, with sizes as before; seal() mends the digests. */
export class Mutant {
  readonly bytes: Uint8Array;
  readonly manifest: Json;
  private readonly view_: DataView;
  /** Where an entry's record stands, by path. */
  private readonly records_ = new Map<string, number>();
  private readonly manifestBytes_: Uint8Array;

  constructor(container: Uint8Array) {
    this.bytes = container.slice();
    this.view_ = new DataView(this.bytes.buffer);
    this.manifestBytes_ = manifestOfContainer(this.bytes, 'package');
    this.manifest = JSON.parse(new TextDecoder().decode(this.manifestBytes_));
    const { offset } = this.manifest.index;
    for (const page of this.pages_())
      for (let k = 0, at = page.begin; k < page.entries; ++k) {
        const length = this.bytes[at + 48];
        this.records_.set(new TextDecoder().decode(this.bytes.subarray(at + 49, at + 49 + length)), at);
        at += 49 + length;
      }
    if (offset === 0) throw new Error('no index');
  }
  private *pages_(): Generator<{ record: number; begin: number; end: number; entries: number }> {
    const { offset } = this.manifest.index;
    const count = this.view_.getUint32(offset + 8, true);
    let begin = offset + 16 + 44 * count;
    for (let i = 0; i < count; ++i) {
      const record = offset + 16 + 44 * i;
      const end = begin + this.view_.getUint32(record + 8, true);
      yield { record, begin, end, entries: this.view_.getUint32(record + 4, true) };
      begin = end;
    }
  }
  private number_(at: number): number {
    return Number(this.view_.getBigUint64(at, true));
  }
  /** The bytes of an entry, or of index.bin, to be changed. */
  entry(path: string): Uint8Array {
    const { index } = this.manifest;
    const at = this.records_.get(path);
    if (at === undefined) return this.bytes.subarray(index.offset, index.offset + index.bytes);
    return this.bytes.subarray(this.number_(at), this.number_(at) + this.number_(at + 8));
  }
  /** The section of a plane in tables.bin. */
  section(plane: number): DataView {
    const tables = this.entry('tables.bin');
    const view = new DataView(tables.buffer, tables.byteOffset);
    let at = 16 + 36 * view.getUint32(8, true);
    for (let p = 0; p < plane; ++p) at += view.getUint32(16 + 36 * p, true);
    return new DataView(tables.buffer, tables.byteOffset + at, view.getUint32(16 + 36 * plane, true));
  }
  /** Changes a JSON document; blanks fill what gets free. */
  json(path: string, change: (document: Json) => void): void {
    const bytes = this.entry(path);
    const document = JSON.parse(new TextDecoder().decode(bytes));
    change(document);
    Mutant.write_(bytes, document);
  }
  private static write_(room: Uint8Array, document: Json): void {
    const written = text.encode(JSON.stringify(document));
    if (written.length > room.length) throw new Error('the document grew');
    room.fill(32);
    room.set(written);
  }
  /** Another path, as long, in the index. */
  rename(from: string, to: string): void {
    this.bytes.set(text.encode(to), this.records_.get(from)! + 49);
  }
  /** Digests of index, tables and manifest; then a change of the manifest. */
  seal(change: (manifest: Json) => void = () => undefined): Uint8Array {
    const { manifest, view_, bytes } = this;
    const tables = this.entry('tables.bin');
    const sections = new DataView(tables.buffer, tables.byteOffset);
    for (let p = 0, at = manifest.tables.headBytes; p < sections.getUint32(8, true); ++p) {
      const end = at + sections.getUint32(16 + 36 * p, true);
      tables.set(sha256(tables.subarray(at, end)), 20 + 36 * p);
      at = end;
    }
    for (const at of this.records_.values())
      bytes.set(sha256(bytes.subarray(this.number_(at), this.number_(at) + this.number_(at + 8))), at + 16);
    for (const { record, begin, end } of this.pages_())
      bytes.set(sha256(bytes.subarray(begin, end)), record + 12);
    for (const name of ['index', 'tables', 'textures', 'quality'])
      manifest[name].sha256 =
        hex(sha256(this.entry(`${name}.${name === 'index' || name === 'tables' ? 'bin' : 'json'}`)));
    for (const name of ['index', 'tables']) {
      const { offset, headBytes } = manifest[name];
      manifest[name].headSha256 = hex(sha256(bytes.subarray(offset, offset + headBytes)));
    }
    if (view_.byteLength !== bytes.length) throw new Error('another size');
    change(manifest);
    Mutant.write_(this.manifestBytes_, manifest);
    return bytes;
  }
}
