import { toHex } from '../format/bytes';
import { sha256Js } from '../format/sha256_js';
import { Call, Mismatch, Numbers, SetOf, Value, bytesOf, compare, each, equal, isTrue, lengthOf, listOf, numberOf, textOf } from './values';
import { numbersOf } from './fields';

const rises = (values: Value[]): boolean => values.every((v, k) => k === 0 || compare(values[k - 1], v) < 0);
const plain = (value: Value): Float64Array =>
  value instanceof Numbers ? value.data : Float64Array.from(Array.isArray(value) ? value : [value], numberOf);
const widthOf = (values: Float64Array): number => {
  let width = 1;
  for (let most = values.reduce((a, b) => Math.max(a, b), 0); most >= 256 ** width; ) ++width;
  return width;
};
function extreme(sign: number): Call {
  return (args, named) => {
    const values = args.length === 1 ? listOf(args[0]) : args;
    if (values.length === 0 && named.has('default')) return named.get('default')!;
    if (values.length === 0) throw new Mismatch('none');
    return values.reduce((best, value) => (sign * compare(value, best) > 0 ? value : best));
  };
}
/** Numbers of little-endian digits, which are the last axis. */
function joined(digits: Numbers): Numbers {
  const n = digits.shape.at(-1)!;
  const values = new Float64Array(digits.data.length / n);
  for (let k = 0; k < values.length; ++k) for (let d = n - 1; d >= 0; --d) values[k] = values[k] * 256 + digits.data[k * n + d];
  return new Numbers(values, digits.shape.slice(0, -1));
}
function numbers(value: Value): Numbers {
  if (value instanceof Numbers) return value;
  throw new Mismatch('an array of numbers');
}
function* enumerated(values: Iterable<Value>): Iterable<Value> {
  let k = 0;
  for (const value of values) yield [k++, value];
}
/** A whole number as so many little-endian bytes. */
const unsigned = (bytes: number) => ([value]: Value[]): Value => {
  const values = plain(value);
  const raw = new Uint8Array(values.length * bytes);
  values.forEach((v, k) => {
    for (let i = 0, left = v; i < bytes; ++i, left = Math.floor(left / 256)) raw[k * bytes + i] = left % 256;
  });
  return new Numbers(values, [values.length], raw);
};

function npNames(): Map<string, Value> {
  const np: Record<string, Call> = {
    uint16: unsigned(2),
    uint64: unsigned(8),
    float32: ([v]) => numbers(v).map(Math.fround),
    float64: ([v]) => new Numbers(plain(v), [plain(v).length]),
    frombuffer: ([data, kind]) => numbersOf(bytesOf(data), textOf(kind), [Math.floor(lengthOf(data) / Number(textOf(kind).slice(-1)))]),
    isfinite: ([v]) => numbers(v).map((x) => Number(Number.isFinite(x))),
    signbit: ([v]) => numbers(v).map((x) => Number(x < 0 || Object.is(x, -0))),
    ptp: ([v]) => plain(v).reduce((a, b) => Math.max(a, b), -Infinity) - plain(v).reduce((a, b) => Math.min(a, b), Infinity),
  };
  return new Map(Object.entries(np));
}

const functions: Record<string, Call> = {
  len: ([v]) => lengthOf(v),
  all: ([v]) => {
    for (const member of each(v)) if (!isTrue(member)) return false;
    return true;
  },
  any: ([v]) => {
    for (const member of each(v)) if (isTrue(member)) return true;
    return false;
  },
  min: extreme(-1),
  max: extreme(1),
  sum: ([v]) => listOf(v).reduce<number>((total, member) => total + numberOf(member), 0),
  abs: ([v]) => Math.abs(numberOf(v)),
  int: ([v]) => Number(v),
  float: ([v]) => Number(v),
  list: ([v]) => [...each(v)],
  set: ([v]) => new SetOf(each(v)),
  bytes: ([count]) => new Uint8Array(numberOf(count)),
  dict: (_, named) => new Map(named),
  range: ([end]) => Array.from({ length: Math.max(0, numberOf(end)) }, (_, k) => k),
  reversed: ([v]) => listOf(v).slice().reverse(),
  enumerate: ([v]) => enumerated(each(v)),
  zip: (lists) => {
    const all = lists.map(listOf);
    return Array.from({ length: Math.min(...all.map((list) => list.length)) }, (_, k) => all.map((list) => list[k]));
  },
  next: ([v]) => {
    for (const member of each(v)) return member;
    throw new Mismatch('none');
  },
  sorted: ([v], named) => {
    const key = named.get('key') as Call | undefined;
    const keyed = listOf(v).map((value): [Value, Value] => [key ? key([value], new Map()) : value, value]);
    return keyed.sort(([a], [b]) => compare(a, b)).map(([, value]) => value);
  },
  rises: ([v]) => rises(listOf(v)),
  within: ([v, low, high]) => plain(v).every((x) => x >= numberOf(low) && x <= numberOf(high)),
  joined: ([v]) => joined(numbers(v)),
  width_of: ([v]) => widthOf(plain(v)),
  sha: ([v]) => toHex(sha256Js(bytesOf(v))),
};
/** Names that every rule may use. */
export const builtIns: ReadonlyMap<string, Value> = new Map<string, Value>([
  ...Object.entries(functions),
  ['np', npNames()],
  ['re', new Map<string, Value>([['compile', ([source]: Value[]) => new RegExp(textOf(source))]])],
]);

const ofDict: Record<string, (of: Map<string | number, Value>) => Call> = {
  get: (of) => ([name, other = null]) => of.get(name as string) ?? other,
  items: (of) => () => [...of].map(([name, value]) => [name, value]),
  values: (of) => () => [...of.values()],
};
const ofNumbers: Record<string, (of: Numbers) => Call> = {
  all: (of) => () => of.data.every((x) => x !== 0),
  any: (of) => () => of.data.some((x) => x !== 0),
  sum: (of) => () => of.data.reduce((a, b) => a + b, 0),
  min: (of) => (_, named) => of.data.reduce((a, b) => Math.min(a, b), numberOf(named.get('initial') ?? Infinity)),
  tolist: (of) => () => listOf(of),
  tobytes: (of) => () => of.raw,
};
const ofList: Record<string, (of: Value[]) => Call> = {
  index: (of) => ([value]) => {
    const at = of.findIndex((member) => equal(member, value));
    if (at < 0) throw new Mismatch('no such element');
    return at;
  },
};
const ofText: Record<string, (of: string) => Call> = {
  split: (of) => () => of.split(/\s+/).filter(Boolean),
};
const ofBytes: Record<string, (of: Uint8Array) => Call> = {
  decode: (of) => ([encoding]) => (encoding === 'latin-1' ? String.fromCharCode(...of) : new TextDecoder('utf-8', { fatal: true }).decode(of)),
  join: (of) => ([parts]) => Uint8Array.from(listOf(parts).flatMap((part, k) => [...(k > 0 ? of : []), ...bytesOf(part)])),
};
const ofPattern: Record<string, (of: RegExp) => Call> = {
  fullmatch: (of) => ([text]) => {
    const found = new RegExp(`^(?:${of.source})$`).exec(textOf(text));
    return found && found.map((group) => group ?? null);
  },
};

/** A method of a value, or undefined where its type has none of that name. */
export function method(of: Value, name: string): Call | undefined {
  const found = <T>(methods: Record<string, (of: T) => Call>, owner: T): Call | undefined =>
    Object.hasOwn(methods, name) ? methods[name](owner) : undefined;
  if (of instanceof Map) return found(ofDict, of);
  if (of instanceof Numbers) return found(ofNumbers, of);
  if (Array.isArray(of)) return found(ofList, of);
  if (of instanceof Uint8Array) return found(ofBytes, of);
  if (of instanceof RegExp) return found(ofPattern, of);
  return typeof of === 'string' ? found(ofText, of) : undefined;
}
