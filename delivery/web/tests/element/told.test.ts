import { expect, it } from 'vitest';
import { causeOf, slowHostNote } from '../../src/element/for_owners';
import { type Words, sentenceOf, words, wordsFor } from '../../src/element/wording';
import { FormatError, InputError } from '../../src/format/errors';

const page = 'https://museum.example/objects/17.html';
const own = 'https://museum.example/turtle.texmesh', foreign = 'https://files.example/turtle.texmesh';

it('every language has every sentence', () => {
  const keys = Object.keys(words.en).sort();
  for (const language of Object.values(words)) {
    expect(Object.keys(language).sort()).toEqual(keys);
    for (const sentence of Object.values(language)) expect(sentence).not.toBe('');
  }
});
it('the language of the page decides', () => {
  expect(wordsFor('de-AT')).toBe(words.de);
  expect(wordsFor('FR')).toBe(words.fr);
  expect(wordsFor()).toBe(words.en);
  for (const other of ['', 'xx', 'english']) expect(wordsFor(other)).toBe(words.en);
});

const asked = (url: string, found: string): InputError =>
  new InputError(url, 'byte 0', 'an answer with status 206', found);
const noPackage = new FormatError(own, 'byte 0', 'a texmesh package', 'status 200 (text/html)', 'K11');
const cases: [string, unknown, string, keyof Words, RegExp][] = [
  ['a file that is not there', asked(own, 'status 404'), own, 'missing', /status 404/],
  ['a file for others', asked(own, 'status 403 (text/html)'), own, 'missing', /status 403/],
  ['a server that has too much to do', asked(own, 'status 429'), own, 'unreachable', /status 429/],
  ['a server that fails', asked(own, 'status 503'), own, 'unreachable', /503/],
  ['no answer', asked(own, 'Failed to fetch'), own, 'unreachable', /did not answer, or it sends/],
  ['no answer from elsewhere', asked(foreign, 'Failed to fetch'), foreign, 'unreachable',
    /https:\/\/museum\.example.*Access-Control-Allow-Origin \(CORS\)/],
  ['a start page in its place', noPackage, own, 'unreadable', /start page/],
  ['damage', new FormatError(own, 'mesh', '3 bytes', '2', 'I08'), own, 'unreadable', /I08 is a rule of/],
  ['another file', new FormatError(own, 'byte 9', 'the file that reading began with',
    'another ETag: it was replaced, open it anew'), own, 'unreadable', /several versions/],
  ['decoders that a page forbids', new Error('the decoder of meshes gives no answer'), own, 'unreadable',
    /^$/],
  ['no workers', new ReferenceError('Worker is not defined'), own, 'no3d', /^$/],
  ['no WebGL', new Error('Error creating WebGL context.'), own, 'no3d', /^$/],
  ['a mistake of ours', new TypeError('x is undefined'), own, 'unreadable', /^$/],
  ['no error at all', 'gone', own, 'unreadable', /^$/],
];
it('what a policy forbids is named as it must be allowed', () => {
  const late = new Error('the decoder of meshes gives no answer');
  const unanswered = asked(foreign, 'Failed to fetch');
  const host = 'https://files.example';
  const told: [unknown, string[], string][] = [
    [late, ['script-src wasm-eval'], "must have script-src 'wasm-unsafe-eval'."],
    [late, ['script-src wasm-eval', 'worker-src blob', 'img-src data'], 'must have worker-src blob:.'],
    [unanswered, [`connect-src ${foreign}`], `must have connect-src ${host}.`],
    [unanswered, ['connect-src https://counter.example/x'], 'did not answer'],
    [unanswered, ['script-src wasm-eval', `img-src ${host}/pixel.gif`, `connect-src ${host}.evil.example/x`],
      'did not answer'],
    [asked(foreign, 'status 404'), ['worker-src blob'], 'status 404'],
    [late, ['require-trusted-types-for trusted-types-sink', 'trusted-types trusted-types-policy'],
      'must have trusted-types texmesh.'],
  ];
  const tried = new Error('THREE.GLTFLoader: WebP required by asset but unsupported.');
  told.push([tried, ['script-src wasm-eval', 'img-src data'], 'must have img-src data:.']);
  for (const [error, forbidden, words] of told)
    expect(causeOf(error, foreign, page, forbidden)).toContain(words);
  expect(causeOf(tried, foreign, page, [`img-src ${host}/pixel.gif`])).toBe('');
  // an address that is none
  expect(causeOf(late, 'https://[', page, ['connect-src data'])).toBe('');
  expect(causeOf(asked('https://[', 'Failed to fetch'), 'https://[', page)).toContain('did not answer');
});
it.each(cases)('%s: visitors get a sentence, the console the rest', (_, error, url, sentence, details) => {
  expect(sentenceOf(error)).toBe(sentence);
  expect(causeOf(error, url, page)).toMatch(details);
});

it('a host that costs speed is named once', () => {
  expect(slowHostNote('range', false, own)).toBe('');
  expect(slowHostNote('whole', false, own)).toMatch(/museum\.example sends no parts.*beside it\.$/);
  expect(slowHostNote('whole', true, own)).toBe('');
  expect(slowHostNote('files', false, foreign)).toBe('');
  expect(slowHostNote('files', true, foreign)).toMatch(/^https:\/\/files\.example compresses packages/);
  expect(slowHostNote('whole', true, 'https://both.example/a'))
    .toMatch(/sends no parts.* The host also compresses/);
});
