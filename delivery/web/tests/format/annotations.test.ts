import { describe, expect, it } from 'vitest';
import { readdirSync } from 'node:fs';
import { FormatError } from '../../src/reader';
import { isLanguageTag, readAnnotations } from '../../src/notes';
import { readBytes, root } from '../support/files';
import { problem } from '../support/scan';

const examples = 'schemas/examples/annotations.v2';

describe('annotations.json', () => {
  it.each(readdirSync(`${root}/${examples}`))('%s', async (name) => {
    const error = await problem(() => readAnnotations(readBytes(`${examples}/${name}`)));
    // A package has its own frame; files for the compiler may have the source's.
    if (name.startsWith('valid-') && name !== 'valid-source.json') expect(error).toBeUndefined();
    else expect(error).toBeInstanceOf(FormatError);
  });

  it('keeps texts as they are, and languages that it does not know', () => {
    const [note] = readAnnotations(readBytes(`${examples}/valid-full.json`));
    expect(note.texts[0]).toEqual({ language: 'en-GB', title: 'A nose', text: '<b>Mended</b> in 1820' });
    expect(note.texts[1]).toEqual({ language: 'x-klingon', title: '' });
    expect(note.camera!.fovDegrees).toBe(30);
  });

  it('tells a language by its form', () => {
    for (const good of ['en', 'de-AT', 'zh-Hans-CN', 'x-klingon']) expect(isLanguageTag(good)).toBe(true);
    for (const bad of ['', 'en-', 'en_GB', 'e1', 'toolongtag', 'en"><script>'])
      expect(isLanguageTag(bad)).toBe(false);
  });
});
