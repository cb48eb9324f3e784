import { describe, expect, it } from 'vitest';
import { FormatError, PackageReader, readTextures } from '../../src/reader';
import { golden } from '../support/files';

describe('small parts', () => {
  it('textures that keep their sources', async () => {
    const entry = await (await PackageReader.openBytes(golden('v2.0-scan'), 'golden')).entry('textures.json');
    const { textures } = JSON.parse(new TextDecoder().decode(entry));
    const withFirst = (more: object) => {
      const [first, ...others] = textures;
      return new TextEncoder().encode(
        JSON.stringify({ textures: [{ ...first, sourceRung: false, ...more }, ...others] }));
    };
    expect(readTextures(withFirst({}))[0]).toMatchObject({ sourceRung: false, source: '' });
    expect(readTextures(withFirst({ sourceRung: true }))[0].sourceRung).toBe(true);
    expect(readTextures(withFirst({ source: 'exr', sourceColours: false }))[0].source).toBe('exr');
    for (const bad of [{ sourceRung: 1 }, { source: 'gif', sourceColours: true }, { source: 'png' },
        { sourceRung: true, codec: 'webp' }])
      expect(() => readTextures(withFirst(bad)), JSON.stringify(bad)).toThrow(FormatError);
    const mip = textures.findIndex((t: { mip?: number }) => (t.mip ?? 0) > 0);
    textures[mip].sourceRung = true;
    expect(() => readTextures(withFirst({}))).toThrow(FormatError);
  });
});
