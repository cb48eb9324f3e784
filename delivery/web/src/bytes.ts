import { FormatError } from './errors';

/** Reads little-endian numbers from bytes and says where they end too early. */
export class BytesIn {
  private readonly view: DataView;
  private position = 0;

  constructor(
    private readonly bytes: Uint8Array,
    private readonly name: string,
  ) {
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  }

  get at(): number {
    return this.position;
  }
  get left(): number {
    return this.bytes.length - this.position;
  }

  private take(bytes: number): number {
    if (bytes > this.left) this.fail(`${bytes} bytes`, `${this.left} bytes`);
    const at = this.position;
    this.position += bytes;
    return at;
  }
  u8(): number {
    return this.view.getUint8(this.take(1));
  }
  u16(): number {
    return this.view.getUint16(this.take(2), true);
  }
  u32(): number {
    return this.view.getUint32(this.take(4), true);
  }
  /** Of at most 2^53. */
  u64(): number {
    const at = this.take(8);
    const value = this.view.getUint32(at + 4, true) * 4294967296 + this.view.getUint32(at, true);
    if (value > 9007199254740992) this.fail('at most 2^53', 'more');
    return value;
  }
  f32(): number {
    return this.view.getFloat32(this.take(4), true);
  }
  /** Of 1 to 4 bytes. */
  number(width: number): number {
    let value = 0;
    const at = this.take(width);
    for (let i = width - 1; i >= 0; --i) value = value * 256 + this.bytes[at + i];
    return value;
  }
  raw(bytes: number): Uint8Array {
    const at = this.take(bytes);
    return this.bytes.subarray(at, at + bytes);
  }
  text(bytes: number): string {
    return String.fromCharCode(...this.raw(bytes));
  }
  expect(word: string): void {
    if (this.text(word.length) !== word) this.fail(`the magic ${word}`, 'other bytes');
  }
  finish(): void {
    if (this.left !== 0) this.fail('the end', `${this.left} more bytes`);
  }
  fail(expected: string, found: string): never {
    throw new FormatError(this.name, `byte ${this.position}`, expected, found);
  }
}

export function toHex(bytes: Uint8Array): string {
  let text = '';
  for (const byte of bytes) text += byte.toString(16).padStart(2, '0');
  return text;
}

/** Whether two byte strings are equal over the length of the shorter one. */
export function samePrefix(a: Uint8Array, b: Uint8Array): boolean {
  const n = Math.min(a.length, b.length);
  for (let i = 0; i < n; ++i) if (a[i] !== b[i]) return false;
  return true;
}
