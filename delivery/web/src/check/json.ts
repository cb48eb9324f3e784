import { FormatError } from '../format/errors';
import { requireRule } from './fields';
import { Dict, Value } from './values';

/** A value that JSON.parse gave. */
export function ofJson(value: unknown): Value {
  if (Array.isArray(value)) return value.map(ofJson);
  if (typeof value === 'object' && value) return new Map(Object.entries(value).map(([name, member]) => [name, ofJson(member)]));
  return value as Value;
}

const blanks = /[ \t\n\r]*/y;
const text = /"(?:[^"\\]|\\.)*"/y;
const plain = /[^,\]} \t\n\r]+/y;

/** Reads text that is known to be JSON once more, for what JSON.parse does not tell. */
class Reader {
  private at_ = 0;
  constructor(
    private readonly json_: string,
    private readonly what_: string,
  ) {}
  private next_(pattern: RegExp): string {
    pattern.lastIndex = this.at_;
    const [found] = pattern.exec(this.json_)!;
    this.at_ += found.length;
    return found;
  }
  private sign_(): string {
    this.next_(blanks);
    return this.json_[this.at_];
  }
  private text_(isFree: boolean): string {
    const value = JSON.parse(this.next_(text)) as string;
    requireRule(isFree || !/[\u0000-\u001f\u007f]/.test(value), 'J03', this.what_, 'no control characters');
    return value;
  }
  private members_(end: string, read: () => void): void {
    for (++this.at_; this.sign_() !== end; ) {
      if (this.json_[this.at_] === ',') ++this.at_;
      this.next_(blanks);
      read();
    }
    ++this.at_;
  }
  value(free: readonly string[], level = 1, isFree = false): Value {
    const sign = this.sign_();
    if (sign === '"') return this.text_(isFree);
    if (sign !== '{' && sign !== '[') return this.plain_();
    requireRule(level <= 64, 'J10', this.what_, 'at most 64 levels');
    const list: Value[] = [];
    const names: Dict = new Map();
    if (sign === '[') this.members_(']', () => list.push(this.value(free, level + 1, isFree)));
    else
      this.members_('}', () => {
        const name = this.text_(isFree);
        requireRule(!names.has(name), 'J10', this.what_, `${name} once`);
        this.sign_();
        ++this.at_;
        names.set(name, this.value(free, level + 1, isFree || free.includes(name)));
      });
    return sign === '[' ? list : names;
  }
  private plain_(): Value {
    const word = this.next_(plain);
    const value = JSON.parse(word) as boolean | null | number;
    if (typeof value !== 'number') return value;
    const good = /^-?\d+$/.test(word) ? Math.abs(value) < 2 ** 53 || BigInt(word.replace('-', '')) <= 2n ** 53n : Number.isFinite(value);
    requireRule(good, 'J02', this.what_, 'a number of binary64');
    return value;
  }
}

/** A document of at most so many bytes; texts below members that are named in `free` may hold control characters. */
export function parseDocument(data: Uint8Array, most: number, what: string, free: readonly string[] = []): Dict {
  requireRule(data.length <= most, 'L09', what, `at most ${most} bytes`);
  let json = '';
  let whole: unknown;
  try {
    json = new TextDecoder('utf-8', { fatal: true, ignoreBOM: true }).decode(data);
    whole = JSON.parse(json);
  } catch (error) {
    throw new FormatError('', what, 'JSON', String(error), 'J01');
  }
  requireRule(typeof whole === 'object' && whole && !Array.isArray(whole), 'J01', what, 'an object');
  return new Reader(json, what).value(['extensions', 'extras', ...free]) as Dict;
}
