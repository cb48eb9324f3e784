import { expect, it } from 'vitest';
import { Parser, Scope } from '../../src/check/expressions';
import { builtIns } from '../../src/check/functions';
import { Mismatch, Value } from '../../src/check/values';

const names = new Scope(new Map<string, Value>([...builtIns, ['a', [3, 1, 2]], ['d', new Map<string, Value>([['x', 1], ['get', 2]])], ['b', Uint8Array.of(255, 216, 7)]]));
const valueOf = (text: string): Value => new Parser(text).whole()(names);

// The values are Python's own: python3 -c 'print(EXPRESSION)'.
it.each<[string, Value]>([
  ['1 + 2 * 3 - -4', 11],
  ['-7 // 2', -4],
  ['-7 % 64', 57],
  ['-(-7 >> 1)', 4],
  ['2**53', 9007199254740992],
  ['-2**2', -4],
  ['0 < 2 <= 2 > 1', true],
  ['0 < 2 <= 1', false],
  ['1 if 0 else 2', 2],
  ['not 0 and 5 or 7', 5],
  ['3 not in a', false],
  ['5 & 3 == 1', true],
  ['True + True', 2],
  ['[0, *a[:2], 9]', [0, 3, 1, 9]],
  ['a[-1]', 2],
  ['a[1:]', [1, 2]],
  ['b[::2]', [255, 7]],
  ["b[:2] == b'\\xff\\xd8'", true],
  ['[x + i for i, x in enumerate(a) if x > 1]', [3, 4]],
  ['[(x, y) for x in a for y in a if x < y]', [[1, 3], [1, 2], [2, 3]]],
  ['sorted(a, key=lambda v: -v)', [3, 2, 1]],
  ['max(a), min(a), max([], default=-1)', [3, 1, -1]],
  ['sum(x for x in a)', 6],
  ['all(x / 0 > 1 for x in [])', true],
  ['{1, 2} <= set(a)', true],
  ['not {4} & set(a)', true],
  ['{x: x * x for x in a}[3]', 9],
  ["dict(y=5) == {'y': 5}", true],
  ["(d | {'y': 5}).y", 5],
  ["d.get('z', 7)", 7],
  ["'x' in d and d.x", 1],
  ['(1, [2]) == (1, [2])', true],
  ['(1, 2) < (1, 3) < (2,)', true],
  ["f'{7:03}.{a[0]}'", '007.3'],
  ["f'{1234567.0:.6g}'", '1.23457e+6'],
  ['[1, 2] * 2', [1, 2, 1, 2]],
  ["np.uint16([4660]).tobytes() == b'\\x34\\x12'", true],
  ["re.compile(r'a\\d+').fullmatch('a12') is None", false],
  ["re.compile(r'a\\d+').fullmatch('a12b')", null],
])('%s', (text, value) => {
  expect(valueOf(text)).toEqual(value);
});

it.each(['d.nothing', 'a[3]', 'a + 1', "len(5)", 'unknown', "'a' < 1"])('%s is no value', (text) => {
  expect(() => valueOf(text)).toThrow(Mismatch);
});
it.each(['1 +', 'a[', 'a ! b', 'import os', '[x for x]', '(1'])('%s is no expression', (text) => {
  expect(() => new Parser(text).whole()).toThrow();
});
