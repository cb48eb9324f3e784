import { FormatError } from '../format/errors';
import { Mismatch, Numbers, Value, listOf, numberOf } from './values';

/** Throws FormatError by a rule unless something is true. */
export function requireRule(good: unknown, rule: string, place: string, what: string): asserts good {
  if (!good) throw new FormatError('', place, what, '', rule);
}

/** A number of up to 8 bytes. Above 2^53 none is taken for 2^53. */
function unsignedAt(view: DataView, at: number, bytes: number): number {
  if (bytes === 1) return view.getUint8(at);
  if (bytes === 2) return view.getUint16(at, true);
  if (bytes === 4) return view.getUint32(at, true);
  const value = view.getBigUint64(at, true);
  return Number(value) === 2 ** 53 && value > 2n ** 53n ? 2 ** 53 + 2 : Number(value);
}
/** IEEE 754 binary16. */
function halfAt(view: DataView, at: number): number {
  const bits = view.getUint16(at, true);
  const [sign, exponent, fraction] = [bits & 0x8000 ? -1 : 1, (bits >> 10) & 31, bits & 1023];
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (exponent ? 2 ** (exponent - 15) * (1 + fraction / 1024) : 2 ** -14 * (fraction / 1024));
}
const sizeOf = (kind: string): number => Number(/\d+$/.exec(kind)![0]);
function numberAt(kind: string, view: DataView, at: number): number {
  if (!kind.includes('f')) return unsignedAt(view, at, sizeOf(kind));
  return sizeOf(kind) === 2 ? halfAt(view, at) : view.getFloat32(at, true);
}
/** Numbers of a kind (numpy's name: u1, <u4, <f2 ..) in bytes. */
export function numbersOf(bytes: Uint8Array, kind: string, shape: readonly number[]): Numbers {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const count = shape.reduce((product, side) => product * side, 1);
  const values = new Float64Array(count);
  for (let k = 0; k < count; ++k) values[k] = numberAt(kind, view, k * sizeOf(kind));
  return new Numbers(values, shape, bytes);
}

/** Fields of binary data, one after the other; what is missing breaks `rule`. */
export class Cursor {
  at = 0;
  constructor(
    readonly data: Uint8Array,
    readonly rule: string,
    readonly what: string,
  ) {}
  raw(count: number): Uint8Array {
    requireRule(count >= 0 && count <= this.data.length - this.at, this.rule, this.what, `${count} bytes at ${this.at}`);
    this.at += count;
    return this.data.subarray(this.at - count, this.at);
  }
  finish(): void {
    requireRule(this.at === this.data.length, this.rule, this.what, 'no further bytes');
  }
  private varint_(): number {
    let value = 0;
    for (let k = 0; k < 6; ++k) {
      const [byte] = this.raw(1);
      value += (byte & 127) * 128 ** k;
      if (byte > 127) continue;
      requireRule(value <= 0xffffffff && (byte > 0 || k === 0), 'S06', this.what, 'a varint in its shortest form');
      return value;
    }
    requireRule(false, 'S06', this.what, 'a varint in its shortest form');
  }
  private one_(kind: string): Value {
    const bytes = this.raw(sizeOf(kind));
    if (/^[SV]/.test(kind)) return bytes;
    return numberAt(kind, new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength), 0);
  }
  /** A number where there is no shape, a list of whole numbers or bytes, or an array. */
  field(kind: string, shape: Value): Value {
    if (kind === 'bytes') return this.raw(numberOf(shape));
    const sides = shape === null ? [] : (Array.isArray(shape) ? listOf(shape) : [shape]).map(numberOf);
    const count = sides.reduce((product, side) => product * side, 1);
    if (!(Number.isSafeInteger(count) && count >= 0)) throw new Mismatch(`${sides.join(' x ')} fields`);
    if (kind === 'varint') return shape === null ? this.varint_() : Array.from({ length: count }, () => this.varint_());
    const kinds = kind.split(',');
    if (shape === null) return this.one_(kind);
    const size = kinds.reduce((sum, k) => sum + sizeOf(k), 0);
    const bytes = this.raw(count * size);
    if (kinds.length === 1 && !/^[SV]/.test(kind)) {
      const numbers = numbersOf(bytes, kind, sides);
      return sides.length === 1 && !kind.includes('f') ? [...numbers.data] : numbers;
    }
    if (sides.length > 1) return new Numbers(new Float64Array(0), sides, bytes);
    const rows = new Cursor(bytes, this.rule, this.what);
    return Array.from({ length: count }, () => (kinds.length === 1 ? rows.one_(kind) : kinds.map((k) => rows.one_(k))));
  }
}
