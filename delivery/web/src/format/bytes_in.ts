import { FormatError, otherMajor } from './errors';
import { formatMajor } from './shared_numbers';

/** Little-endian numbers from bytes; FormatError by `rule` names the place where bytes are missing. */
export class BytesIn {
  private readonly view_: DataView;
  private position_ = 0;

  constructor(private readonly bytes_: Uint8Array, private readonly name_: string,
      private readonly rule_: string) {
    this.view_ = new DataView(bytes_.buffer, bytes_.byteOffset, bytes_.byteLength);
  }

  get at(): number {
    return this.position_;
  }
  get left(): number {
    return this.bytes_.length - this.position_;
  }

  private advance_(bytes: number): number {
    if (bytes > this.left) this.fail(`${bytes} bytes`, this.left);
    const at = this.position_;
    this.position_ += bytes;
    return at;
  }
  u8(): number {
    return this.view_.getUint8(this.advance_(1));
  }
  u16(): number {
    return this.view_.getUint16(this.advance_(2), true);
  }
  u32(): number {
    return this.view_.getUint32(this.advance_(4), true);
  }
  /** A number of 8 bytes, at most 2^53. */
  u64(): number {
    const at = this.advance_(8);
    const value = this.view_.getUint32(at + 4, true) * 4294967296 + this.view_.getUint32(at, true);
    if (value > 9007199254740992) this.fail('at most 2^53', '', 'I05');
    return value;
  }
  f32(): number {
    return this.view_.getFloat32(this.advance_(4), true);
  }
  /** A number of 1 to 4 bytes. */
  number(width: number): number {
    let value = 0;
    const at = this.advance_(width);
    for (let i = width - 1; i >= 0; --i) value = value * 256 + this.bytes_[at + i];
    return value;
  }
  raw(bytes: number): Uint8Array {
    const at = this.advance_(bytes);
    return this.bytes_.subarray(at, at + bytes);
  }
  text(bytes: number): string {
    return String.fromCharCode(...this.raw(bytes));
  }
  expect(word: string, rule: string): void {
    if (this.text(word.length) !== word) this.fail(word, '', rule);
  }
  finish(): void {
    if (this.left !== 0) this.fail('the end', `${this.left} more bytes`);
  }
  fail(expected: string, found: unknown = '', rule = this.rule_): never {
    throw new FormatError(this.name_, `byte ${this.position_}`, expected, `${found}`, rule);
  }
}

/** Magic word (another breaks `rule`) and version of a binary document; gives the minor version. */
export function readEntryStart(input: BytesIn, magic: string, rule: string): number {
  input.expect(magic, rule);
  const major = input.u16();
  if (major !== formatMajor) input.fail(`version ${formatMajor}`, otherMajor(major), 'W03');
  return input.u16();
}
