import { FormatError } from './errors';

/** A value in a JSON document: checks type and range before anyone uses it, and names its place when it is wrong. */
export class JsonAt {
  constructor(
    private readonly value_: unknown,
    private readonly file_: string,
    private readonly path_ = '',
  ) {}

  fail(expected: string, found: string): never {
    throw new FormatError(this.file_, this.path_, expected, found);
  }
  private shown_(): string {
    return this.value_ === undefined ? 'nothing' : String(JSON.stringify(this.value_)).slice(0, 40);
  }
  has(name: string): boolean {
    return typeof this.value_ === 'object' && this.value_ !== null && Object.hasOwn(this.value_, name);
  }
  at(name: string | number): JsonAt {
    const ok = typeof name === 'number' ? Array.isArray(this.value_) : !Array.isArray(this.value_);
    if (!ok || typeof this.value_ !== 'object' || this.value_ === null)
      this.fail(typeof name === 'number' ? 'an array' : 'an object', this.shown_());
    const child = Object.hasOwn(this.value_, name) ? (this.value_ as Record<string | number, unknown>)[name] : undefined;
    return new JsonAt(child, this.file_, `${this.path_}/${name}`);
  }
  array(least: number, most: number): number {
    if (!Array.isArray(this.value_)) this.fail('an array', this.shown_());
    const n = this.value_.length;
    if (n < least || n > most) this.fail(least === most ? `${least} elements` : `${least} to ${most} elements`, `${n}`);
    return n;
  }
  number(least: number, most: number): number {
    const v = this.value_;
    if (typeof v !== 'number' || !(v >= least && v <= most)) this.fail(`a number from ${least} to ${most}`, this.shown_());
    return v;
  }
  integer(least: number, most = 9007199254740992): number {
    const v = this.number(least, most);
    if (!Number.isInteger(v)) this.fail('a whole number', this.shown_());
    return v;
  }
  boolean(): boolean {
    if (typeof this.value_ !== 'boolean') this.fail('true or false', this.shown_());
    return this.value_;
  }
  text(mostBytes: number): string {
    const v = this.value_;
    if (typeof v !== 'string') this.fail('a text', this.shown_());
    if (new TextEncoder().encode(v).length > mostBytes) this.fail(`at most ${mostBytes} bytes`, `${v.length} characters`);
    if (/[\u0000-\u001f\u007f]/.test(v)) this.fail('a text without control characters', 'one');
    return v;
  }
  /** A SHA-256 as 64 lower-case hexadecimal digits. */
  digest(): Uint8Array {
    const v = this.text(64);
    if (!/^[0-9a-f]{64}$/.test(v)) this.fail('64 hexadecimal digits', this.shown_());
    return Uint8Array.from({ length: 32 }, (_, i) => parseInt(v.slice(2 * i, 2 * i + 2), 16));
  }
}

/** A document of at most so many bytes of UTF-8; FormatError where it is no JSON. */
export function parseJson(bytes: Uint8Array, file: string, mostBytes: number): JsonAt {
  if (bytes.length > mostBytes) throw new FormatError(file, '', `at most ${mostBytes} bytes`, `${bytes.length}`);
  try {
    return new JsonAt(JSON.parse(new TextDecoder('utf-8', { fatal: true }).decode(bytes)), file);
  } catch (error) {
    throw new FormatError(file, '', 'JSON', error instanceof Error ? error.message : String(error));
  }
}
