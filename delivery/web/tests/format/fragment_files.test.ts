import { describe, expect, it } from 'vitest';
import { readFragmentFiles } from '../../src/format/fragment_files';
import { FormatError } from '../../src/reader';

describe('small parts', () => {
  it('fragments.json', () => {
    const text = (value: unknown): Uint8Array => new TextEncoder().encode(JSON.stringify(value));
    const plane = { order: [3, 1],
      rungs: [{ bytes: [10, 0], sha256: ['00112233445566ff', '0000000000000000'] }] };
    const files = readFragmentFiles(text({ version: 1, planes: [plane] }));
    expect(files[0][0].get(3))
      .toEqual({ bytes: 10, sha256: new Uint8Array([0, 17, 34, 51, 68, 85, 102, 255]) });
    expect(files[0][0].has(1)).toBe(false);
    expect(readFragmentFiles(text({ version: 1, planes: [] }))).toEqual([]); // there are no such files
    const broken = { ...plane, rungs: [{ bytes: [10], sha256: ['x'] }] };
    expect(() => readFragmentFiles(text({ version: 1, planes: [broken] }))).toThrow(FormatError);
    expect(() => readFragmentFiles(text({ version: 2, planes: [] }))).toThrow(FormatError);
  });
});
