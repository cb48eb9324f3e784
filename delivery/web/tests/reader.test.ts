import { describe, expect, it } from 'vitest';
import { readFragmentFiles } from '../src/format/fragment_files';
import {
  FormatError, InputError, PackageReader, TexmeshError, joinFragment, readIndex, readManifest, readQuality,
  readTablesHead, readTablesSection, readTextures, sha256, sha256Js, toHex,
} from '../src/reader';
import { readSplitHead } from '../src/format/splits/split_stream';
import { golden, goldenNames } from './support';

async function entryOf(name: string, path: string): Promise<Uint8Array> {
  const reader = await PackageReader.openBytes(golden(name), name);
  if (path === 'manifest.json') return reader.store.manifest();
  if (path === 'index.bin') {
    const { offset, bytes } = reader.manifest.index;
    return golden(name).slice(offset, offset + bytes);
  }
  return reader.entry(path);
}

async function readTables(bytes: Uint8Array): Promise<unknown> {
  const head = readTablesHead(bytes);
  const end = head.planes.at(-1);
  if (end && end.offset + end.bytes !== bytes.length) throw new FormatError('tables.bin', '', 'another length', '');
  return Promise.all(head.planes.map((s, p) => readTablesSection(head, p, bytes.subarray(s.offset, s.offset + s.bytes))));
}

const documents: Record<string, (bytes: Uint8Array) => unknown> = {
  'manifest.json': readManifest,
  'index.bin': readIndex,
  'textures.json': readTextures,
  'tables.bin': readTables,
  'quality.json': readQuality,
};

/** What reading ends with: undefined when it is well. */
async function problem(read: () => unknown): Promise<unknown> {
  try {
    await read();
    return undefined;
  } catch (error) {
    return error;
  }
}

describe.each(goldenNames)('%s', (name) => {
  it.each(Object.keys(documents))('%s: every truncation is told', async (path) => {
    const bytes = await entryOf(name, path);
    expect(await problem(() => documents[path](bytes))).toBeUndefined();
    const step = bytes.length > 4000 ? 37 : 1;
    for (let n = 0; n < bytes.length; n += step) {
      const error = await problem(() => documents[path](bytes.slice(0, n)));
      // Blanks may follow a JSON document.
      if (error === undefined && path === 'manifest.json') expect(new TextDecoder().decode(bytes.slice(n)).trim()).toBe('');
      else expect(error, `${n} bytes`).toBeInstanceOf(FormatError);
    }
  });

  it.each(Object.keys(documents))('%s: a flipped byte never breaks more than a FormatError', async (path) => {
    const bytes = await entryOf(name, path);
    const step = Math.max(1, Math.floor(bytes.length / 700));
    for (let at = 0; at < bytes.length; at += step) {
      const copy = bytes.slice();
      copy[at] ^= 1 << at % 8;
      const error = await problem(() => documents[path](copy));
      if (error !== undefined) expect(error, `byte ${at}`).toBeInstanceOf(FormatError);
    }
  });

  it('a flipped byte anywhere is found by the digests', async () => {
    const whole = golden(name);
    const well = await PackageReader.openBytes(whole, name);
    for (const { path, offset, bytes } of await well.index()) {
      const copy = whole.slice();
      copy[offset + (bytes >> 1)] ^= 4;
      const reader = await PackageReader.openBytes(copy, name);
      const error = await problem(() => reader.entry(path));
      expect(error, path).toBeInstanceOf(FormatError);
      expect(String((error as Error).message)).toContain('SHA-256');
    }
  });

  it('a truncated container says so', async () => {
    const whole = golden(name);
    for (let n = 0; n < whole.length; n += 501) {
      const error = await problem(async () => {
        const reader = await PackageReader.openBytes(whole.slice(0, n), name);
        for (const e of await reader.index()) await reader.entry(e.path);
      });
      if (error !== undefined) expect(error, `${n} bytes`).toBeInstanceOf(TexmeshError);
      else expect(n).toBeGreaterThan(0.95 * whole.length); // only the directory is missing, which nobody reads
    }
  });

  it('reads every fragment at every rung as a complete image', async () => {
    const reader = await PackageReader.openBytes(golden(name), name);
    const tables = await reader.tables();
    for (const [plane, t] of tables.entries())
      for (const fragment of t!.order)
        for (let rung = 0; rung < t!.rungQuality.length; ++rung) {
          const { bytes } = await reader.fragmentRange(plane, rung, fragment);
          if (bytes === 0) continue;
          const file = await reader.completeFragment(plane, rung, fragment);
          expect([file[0], file[1], file.at(-2), file.at(-1)]).toEqual([0xff, 0xd8, 0xff, 0xd9]);
        }
  });
});

describe('places that do not exist', async () => {
  const reader = await PackageReader.openBytes(golden('v1.1-scan'), 'golden');
  it.each([
    ['a plane', () => reader.planeTables(99)],
    ['a rung', () => reader.fragmentRange(0, 99, 0)],
    ['a scale', () => reader.scaleGlb(50)],
  ])('%s', async (_, read) => {
    expect(await problem(read)).toBeInstanceOf(InputError);
  });
  it('a rung', async () => expect(await problem(() => reader.tableStream(0, 99))).toBeInstanceOf(InputError));
  it('an entry', async () => expect(await problem(() => reader.entry('nothing.bin'))).toBeInstanceOf(FormatError));
  it('errors have names that survive bundling', () => {
    expect(new InputError('f', 'p', 'e', 'x').name).toBe('InputError');
    expect(new FormatError('f', 'p', 'e', 'x').message).toBe('f: p: expected e, found x');
    expect(new FormatError('', 'p', '', 'x').message).toBe('p: found x');
  });
});

describe('split stream', async () => {
  const reader = await PackageReader.openBytes(golden('v1.1-scan'), 'golden');
  const head = (await reader.splitStreamHead())!;
  it('every truncation of the head is told', async () => {
    for (let n = 0; n < head.length; ++n)
      expect(await problem(() => readSplitHead(head.slice(0, n))), `${n} bytes`).toBeInstanceOf(FormatError);
  });
  it('flipped bytes give no other error', async () => {
    for (let at = 0; at < head.length; ++at) {
      const copy = head.slice();
      copy[at] ^= 1 << at % 8;
      const error = await problem(() => readSplitHead(copy));
      if (error !== undefined) expect(error, `byte ${at}`).toBeInstanceOf(FormatError);
    }
  });
});

describe('small parts', () => {
  it('both SHA-256 agree', async () => {
    for (const n of [0, 1, 55, 56, 63, 64, 65, 119, 120, 1000]) {
      const bytes = Uint8Array.from({ length: n }, (_, i) => (i * 37) & 255);
      expect(toHex(sha256Js(bytes)), `${n} bytes`).toBe(toHex(await sha256(bytes)));
    }
  });
  it('joins fragments of every codec', () => {
    const soi = [0xff, 0xd8];
    const eoi = [0xff, 0xd9];
    const bytes = (...b: number[]): Uint8Array => new Uint8Array(b);
    expect([...joinFragment('jpeg', bytes(...soi, 1, ...eoi), [bytes(...soi, 2, ...eoi)])]).toEqual([...soi, 1, 2, ...eoi]);
    const scans = [bytes(7), bytes(8)];
    expect([...joinFragment('jpeg-progressive', bytes(...soi, 1, ...eoi), scans)]).toEqual([...soi, 1, 7, 8, ...eoi]);
    expect(() => joinFragment('jpeg-progressive', bytes(...soi, 1, ...eoi), [bytes(0xff)])).toThrow(FormatError);
    expect(() => joinFragment('jpeg', bytes(1, 2, 3, 4), [bytes(...soi, ...eoi)])).toThrow(FormatError);
    expect(() => joinFragment('jpeg', bytes(...soi, ...eoi), scans)).toThrow(FormatError);
    expect(() => joinFragment('webp', bytes(), [bytes(1, 2, 3)])).toThrow(FormatError);
  });
  it('textures that keep their sources', async () => {
    const entry = await (await PackageReader.openBytes(golden('v1.1-scan'), 'golden')).entry('textures.json');
    const { textures } = JSON.parse(new TextDecoder().decode(entry));
    const withFirst = (more: object) => {
      const [first, ...others] = textures;
      return new TextEncoder().encode(JSON.stringify({ textures: [{ ...first, ...more }, ...others] }));
    };
    expect(readTextures(withFirst({}))[0]).toMatchObject({ lossless: false, source: '' });
    expect(readTextures(withFirst({ lossless: true }))[0].lossless).toBe(true);
    expect(readTextures(withFirst({ source: 'exr', sourceColours: false }))[0].source).toBe('exr');
    for (const bad of [{ lossless: 1 }, { source: 'gif', sourceColours: true }, { source: 'png' }, { lossless: true, codec: 'webp' }])
      expect(() => readTextures(withFirst(bad)), JSON.stringify(bad)).toThrow(FormatError);
    const mip = textures.findIndex((t: { mip?: number }) => (t.mip ?? 0) > 0);
    textures[mip].lossless = true;
    expect(() => readTextures(withFirst({}))).toThrow(FormatError);
  });
  it('fragments.json', () => {
    const text = (value: unknown): Uint8Array => new TextEncoder().encode(JSON.stringify(value));
    const plane = { order: [3, 1], rungs: [{ bytes: [10, 0], sha256: ['00112233445566ff', '0000000000000000'] }] };
    const files = readFragmentFiles(text({ version: 1, planes: [plane] }));
    expect(files[0][0].get(3)).toEqual({ bytes: 10, sha256: new Uint8Array([0, 17, 34, 51, 68, 85, 102, 255]) });
    expect(files[0][0].has(1)).toBe(false);
    const broken = { ...plane, rungs: [{ bytes: [10], sha256: ['x'] }] };
    expect(() => readFragmentFiles(text({ version: 1, planes: [broken] }))).toThrow(FormatError);
    expect(() => readFragmentFiles(text({ version: 2, planes: [] }))).toThrow(FormatError);
  });
});
