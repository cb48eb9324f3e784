import { FormatError } from './errors';
import { maxJsonInteger } from './shared_numbers';

/** A value in a JSON document, which checks type and range, and names the place of a wrong value. */
export class JsonAt {
  constructor(
    private readonly value_: unknown,
    private readonly file_: string,
    private readonly path_ = '',
    private readonly rule_ = 'J04',
  ) {}

  /** The same value; what is wrong with it or within it breaks this rule. */
  by(rule = this.rule_): JsonAt {
    return new JsonAt(this.value_, this.file_, this.path_, rule);
  }
  fail(expected: string, found: unknown = '', rule = this.rule_): never {
    throw new FormatError(this.file_, this.path_, expected, `${found}`, rule);
  }
  private shown_(): string {
    return this.value_ === undefined ? 'nothing' : String(JSON.stringify(this.value_)).slice(0, 40);
  }
  has(name: string): boolean {
    return this.at(name).value_ !== undefined;
  }
  at(name: string | number): JsonAt {
    const v = this.value_ as Record<string | number, unknown>;
    const ofArray = typeof name === 'number';
    if (typeof v !== 'object' || !v || Array.isArray(v) !== ofArray)
      this.fail(ofArray ? 'an array' : 'an object', this.shown_());
    return new JsonAt(Object.hasOwn(v, name) ? v[name] : undefined, this.file_, `${this.path_}/${name}`,
      this.rule_);
  }
  array(least: number, most: number): number {
    if (!Array.isArray(this.value_)) this.fail('an array', this.shown_());
    const n = this.value_.length;
    if (n < least || n > most) this.fail(`${least} to ${most} elements`, n);
    return n;
  }
  /** Reads each element of an array. */
  each<T>(least: number, most: number, read: (at: JsonAt, i: number) => T): T[] {
    return Array.from({ length: this.array(least, most) }, (_, i) => read(this.at(i), i));
  }
  number(least: number, most: number): number {
    const v = this.value_;
    if (typeof v !== 'number' || !(v >= least && v <= most))
      this.fail(`a number from ${least} to ${most}`, this.shown_());
    return v;
  }
  integer(least: number, most = maxJsonInteger): number {
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
    if (new TextEncoder().encode(v).length > mostBytes) this.fail(`at most ${mostBytes} bytes`);
    if (/[\u0000-\u001f\u007f]/.test(v)) this.fail('no control characters', '', 'J03');
    return v;
  }
  /** Whatever the value is. */
  value(): unknown {
    return this.value_;
  }
  /** A SHA-256 (or its first bytes) as lower-case hexadecimal digits. */
  digest(bytes = 32): Uint8Array {
    const v = this.text(2 * bytes);
    if (v.length !== 2 * bytes || /[^0-9a-f]/.test(v))
      this.fail(`${2 * bytes} hexadecimal digits`, this.shown_(), 'J07');
    return Uint8Array.from({ length: bytes }, (_, i) => parseInt(v.slice(2 * i, 2 * i + 2), 16));
  }
}

/** Bounded JSON of at most so many bytes of UTF-8. FormatError where it is longer, or no JSON. */
export function parseJson(bytes: Uint8Array, file: string, mostBytes: number): JsonAt {
  if (bytes.length > mostBytes)
    throw new FormatError(file, '', `at most ${mostBytes} bytes`, `${bytes.length}`, 'L09');
  try {
    const document: unknown = JSON.parse(new TextDecoder('utf-8', { fatal: true }).decode(bytes));
    if (document !== Object(document) || Array.isArray(document)) throw 'no object';
    return new JsonAt(document, file);
  } catch (error) {
    throw new FormatError(file, '', 'JSON', String(error), 'J01');
  }
}
