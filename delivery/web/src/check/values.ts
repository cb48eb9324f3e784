import { concat, toHex } from '../format/bytes';

/** What the rules of format/rules.txt compute with: Python's values, in JavaScript's types. A tuple is an array. */
export type Value = null | boolean | number | string | Uint8Array | RegExp | Value[] | Dict | SetOf | Numbers | Call | Iterable<Value>;
export type Dict = Map<string | number, Value>;
export type Call = (args: Value[], named: ReadonlyMap<string, Value>) => Value;

/** What a rule asks of a value that has no such thing: a field that is missing, a number that is a text. */
export class Mismatch extends Error {}

/** A set. Its members are told apart by their text. */
export class SetOf {
  readonly of = new Map<string, Value>();
  constructor(members: Iterable<Value> = []) {
    for (const member of members) this.of.set(keyOf(member), member);
  }
}

/** An array of numbers of one or more axes, the last one fastest; `raw` is what it was read from. */
export class Numbers {
  constructor(
    readonly data: Float64Array,
    readonly shape: readonly number[],
    readonly raw = new Uint8Array(0),
  ) {}
  row(at: number): Value {
    const [rows, ...shape] = this.shape;
    const k = at < 0 ? at + rows : at;
    if (!(k >= 0 && k < rows)) throw new Mismatch(`element ${at} of ${rows}`);
    const n = shape.reduce((product, side) => product * side, 1);
    return shape.length === 0 ? this.data[k] : new Numbers(this.data.subarray(k * n, (k + 1) * n), shape);
  }
  map(change: (value: number) => number): Numbers {
    return new Numbers(this.data.map(change), this.shape);
  }
}

/** A text that two values share exactly where Python takes them for equal. */
export function keyOf(value: Value): string {
  if (value === null) return 'N';
  if (typeof value === 'boolean' || typeof value === 'number') return `n${Number(value)}`;
  if (typeof value === 'string') return `s${JSON.stringify(value)}`;
  if (value instanceof Uint8Array) return `b${toHex(value)}`;
  if (Array.isArray(value)) return `[${value.map(keyOf).join()}]`;
  if (value instanceof SetOf) return `{${[...value.of.keys()].sort().join()}}`;
  if (value instanceof Map) return `{${[...value].map(([name, member]) => `${keyOf(name)}:${keyOf(member)}`).sort().join()}}`;
  throw new Mismatch('a value that is neither equal nor different');
}
export function equal(a: Value, b: Value): boolean {
  if (Array.isArray(a) && Array.isArray(b)) return a.length === b.length && a.every((item, k) => equal(item, b[k]));
  if (typeof a === 'string' || typeof b === 'string') return a === b;
  if (isNumber(a) && isNumber(b)) return Number(a) === Number(b);
  return keyOf(a) === keyOf(b);
}
const isNumber = (value: Value): value is number | boolean => typeof value === 'number' || typeof value === 'boolean';

export function isTrue(value: Value): boolean {
  if (value instanceof Numbers) {
    if (value.data.length !== 1) throw new Mismatch('one number');
    return value.data[0] !== 0;
  }
  if (value === null || isNumber(value) || typeof value === 'string') return !!value;
  if (value instanceof Uint8Array || Array.isArray(value)) return value.length > 0;
  return value instanceof Map ? value.size > 0 : value instanceof SetOf ? value.of.size > 0 : true;
}
export function numberOf(value: Value): number {
  if (isNumber(value)) return Number(value);
  throw new Mismatch(`${shown(value)} for a number`);
}
export function textOf(value: Value): string {
  if (typeof value === 'string') return value;
  throw new Mismatch(`${shown(value)} for a text`);
}
export function bytesOf(value: Value): Uint8Array {
  if (value instanceof Uint8Array) return value;
  throw new Mismatch(`${shown(value)} for bytes`);
}
export function dictOf(value: Value): Dict {
  if (value instanceof Map) return value;
  throw new Mismatch(`${shown(value)} for an object`);
}
export function listOf(value: Value): Value[] {
  return Array.isArray(value) ? value : [...each(value)];
}
export function lengthOf(value: Value): number {
  if (typeof value === 'string' || value instanceof Uint8Array || Array.isArray(value)) return value.length;
  return value instanceof Map ? value.size : value instanceof SetOf ? value.of.size : value instanceof Numbers ? value.shape[0] : listOf(value).length;
}
export function* each(value: Value): Iterable<Value> {
  if (value instanceof SetOf) yield* value.of.values();
  else if (value instanceof Map) yield* value.keys();
  else if (value instanceof Numbers) for (let k = 0; k < value.shape[0]; ++k) yield value.row(k);
  else if (typeof value === 'object' && value && Symbol.iterator in value) yield* value;
  else if (typeof value === 'string') yield* value;
  else throw new Mismatch(`${shown(value)} for a list`);
}
/** A value as messages show it. */
export function shown(value: Value): string {
  return value instanceof Map ? 'an object' : value instanceof Uint8Array ? `${value.length} bytes` : String(value).slice(0, 60);
}

/** Which of two values comes first: below 0, 0, above 0; NaN where they have no order. */
export function compare(a: Value, b: Value): number {
  if (isNumber(a) && isNumber(b)) return a < b ? -1 : a > b ? 1 : Number(a) === Number(b) ? 0 : NaN;
  if (typeof a === 'string' && typeof b === 'string') return a < b ? -1 : a > b ? 1 : 0;
  if (!Array.isArray(a) || !Array.isArray(b)) throw new Mismatch(`order of ${shown(a)} and ${shown(b)}`);
  for (let k = 0; k < Math.min(a.length, b.length); ++k) if (!equal(a[k], b[k])) return compare(a[k], b[k]);
  return a.length - b.length;
}
export function contains(whole: Value, part: Value): boolean {
  if (whole instanceof Map) return whole.has(part as string);
  if (whole instanceof SetOf) return whole.of.has(keyOf(part));
  if (typeof whole === 'string') return whole.includes(textOf(part));
  return listOf(whole).some((item) => equal(item, part));
}
const within = (small: SetOf, large: SetOf): boolean => [...small.of.keys()].every((key) => large.of.has(key));

const comparisons: Record<string, (a: Value, b: Value) => boolean> = {
  '==': equal,
  '!=': (a, b) => !equal(a, b),
  '<': (a, b) => compare(a, b) < 0,
  '>': (a, b) => compare(a, b) > 0,
  '<=': (a, b) => (a instanceof SetOf && b instanceof SetOf ? within(a, b) : compare(a, b) <= 0),
  '>=': (a, b) => compare(a, b) >= 0,
  in: (a, b) => contains(b, a),
  'not in': (a, b) => !contains(b, a),
  is: (a, b) => a === b,
  'is not': (a, b) => a !== b,
};
const arithmetic: Record<string, (a: number, b: number) => number> = {
  '+': (a, b) => a + b,
  '-': (a, b) => a - b,
  '*': (a, b) => a * b,
  '/': (a, b) => a / b,
  '//': (a, b) => Math.floor(a / b),
  '%': (a, b) => a - b * Math.floor(a / b),
  '**': (a, b) => a ** b,
  '<<': (a, b) => a * 2 ** b,
  '>>': (a, b) => Math.floor(a / 2 ** b),
  '&': (a, b) => Number(BigInt(a) & BigInt(b)),
};

/** Two operands and what stands between them. */
export function operate(operator: string, a: Value, b: Value): Value {
  if (operator in comparisons && !(a instanceof Numbers || b instanceof Numbers)) return comparisons[operator](a, b);
  const compute = operator in comparisons ? (x: number, y: number) => Number(comparisons[operator](x, y)) : arithmetic[operator];
  if (a instanceof Numbers || b instanceof Numbers) {
    if (a instanceof Numbers && b instanceof Numbers) {
      if (a.data.length !== b.data.length) throw new Mismatch('arrays of one size');
      return new Numbers(a.data.map((x, k) => compute(x, b.data[k])), a.shape);
    }
    if (a instanceof Numbers) return a.map((x) => compute(x, numberOf(b)));
    return (b as Numbers).map((y) => compute(numberOf(a), y));
  }
  if (operator === '+' && a instanceof Uint8Array) return concat([a, bytesOf(b)]);
  if (operator === '+' && Array.isArray(a) && Array.isArray(b)) return [...a, ...b];
  if (operator === '*' && Array.isArray(a)) return Array.from({ length: Math.max(0, numberOf(b)) }, () => a).flat();
  if (operator === '|' && a instanceof Map && b instanceof Map) return new Map([...a, ...b]);
  if (a instanceof SetOf && b instanceof SetOf) {
    const isKept = operator === '&';
    return new SetOf([...a.of].filter(([key]) => b.of.has(key) === isKept).map(([, member]) => member));
  }
  return compute(numberOf(a), numberOf(b));
}

/** The element of that number or name. */
export function item(of: Value, at: Value): Value {
  if (of instanceof Map) {
    const found = of.get(at as string);
    if (found === undefined) throw new Mismatch(`no ${shown(at)}`);
    return found;
  }
  const k = numberOf(at);
  if (of instanceof Numbers) return of.row(k);
  if (!Array.isArray(of) && !(of instanceof Uint8Array)) throw new Mismatch(`element of ${shown(of)}`);
  const found = of[k < 0 ? k + of.length : k] as Value | undefined;
  if (found === undefined) throw new Mismatch(`element ${k} of ${of.length}`);
  return found;
}
/** Elements from `begin` to `end`, every `step`th. */
export function slice(of: Value, begin: Value, end: Value, step: Value): Value {
  const [from, to] = [begin ?? 0, end ?? lengthOf(of)].map(numberOf);
  if (of instanceof Uint8Array || typeof of === 'string' || Array.isArray(of)) {
    const cut = of.slice(from, to);
    return step === null ? cut : [...cut].filter((_, k) => k % numberOf(step) === 0);
  }
  throw new Mismatch(`part of ${shown(of)}`);
}
