import { describe, expect, it } from 'vitest';
import { readdirSync } from 'node:fs';
import { FormatError, isWebUrl, readAbout } from '../../src/reader';
import { readBytes, root } from '../support/files';
import { openAt, problem, range } from '../support/scan';

const bytes = (text: string): Uint8Array => new TextEncoder().encode(text);
const examples = 'schemas/examples/about.v2';

describe('about.json', () => {
  it.each(readdirSync(`${root}/${examples}`))('%s', async (name) => {
    const error = await problem(() => readAbout(readBytes(`${examples}/${name}`)));
    if (name.startsWith('valid-')) expect(error).toBeUndefined();
    else expect(error).toBeInstanceOf(FormatError);
  });

  it('keeps what it knows and what strangers said', () => {
    const said = { title: 'A', licence: 'CC0-1.0', unit: { name: 'mm', metres: 0.001 },
      source: { format: 'obj', x: '\u0007' }, extras: [1] };
    expect(readAbout(bytes(JSON.stringify({ ...said, later: 1 })))).toEqual({ ...said, later: 1 });
    expect(readAbout(bytes('{}'))).toEqual({});
  });

  it('tells every truncation', async () => {
    const json = bytes(JSON.stringify({ title: 'A', dates: [{ event: 'found', text: '1897' }] }));
    for (let n = 0; n < json.length; ++n)
      expect(await problem(() => readAbout(json.slice(0, n)))).toBeInstanceOf(FormatError);
  });

  it('makes links of http and https alone', () => {
    for (const url of ['http://a', 'https://a.b/c?d#e']) expect(isWebUrl(url)).toBe(true);
    for (const url of ['', 'https://', 'https:///a', 'javascript:alert(1)', 'https://a b', 'ftp://a',
        'https://a"b', ' https://a', 'https://a\n']) expect(isWebUrl(url)).toBe(false);
  });

  it('is fetched when it is asked for, once', async () => {
    const server = range();
    const reader = await openAt(server);
    await reader.textures();
    const before = reader.requests.length;
    const [one, two] = await Promise.all([reader.about(), reader.about()]);
    expect(two).toBe(one);
    expect(reader.requests.length).toBe(before + 1);
    expect(one.unit).toEqual({ name: 'metre', metres: 1 });
    expect(one.upAxis).toBe('y');
  });
});
