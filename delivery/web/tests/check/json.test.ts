import { expect, it } from 'vitest';
import { ofJson, parseDocument } from '../../src/check/json';

const parse = (text: string) => parseDocument(new TextEncoder().encode(text), 1000, 'a document');
it('reads what JSON.parse reads', () => {
  const text = ' {"a" : [1, -2.5e3, true , null, "x\\"}\\u0041\\\\", {} , []],"b":{"c":[[{"d":0}]]}} ';
  expect(parse(text)).toEqual(ofJson(JSON.parse(text)));
});
it.each([
  ['[]', 'J01'], ['{"a":}', 'J01'], ['{"a":NaN}', 'J01'], ['{"a":1}x', 'J01'], ['\ufeff{}', 'J01'],
  ['{"a":1,"b":{"c":1,"c":2}}', 'J10'], [`{"a":${'['.repeat(64)}${']'.repeat(64)}}`, 'J10'],
  ['{"a":"\\u0007"}', 'J03'], ['{"a\\n":1}', 'J03'],
  ['{"a":9007199254740993}', 'J02'], ['{"a":-9007199254740993}', 'J02'], ['{"a":1e999}', 'J02'],
  [`{"a":"${'x'.repeat(1000)}"}`, 'L09'],
])('%s', (text, rule) => {
  expect(() => parse(text)).toThrow(`[${rule}]`);
});
it('lets extensions have control characters, and numbers be 2^53', () => {
  parse('{"extras":{"a":"\\n"},"extensions":{"b":["\\t"]},"c":9007199254740992,"d":9007199254740993.0}');
});
