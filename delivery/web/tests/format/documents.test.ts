import { describe, expect, it } from 'vitest';
import {
  FormatError, PackageReader, readIndex, readManifest, readQuality, readTablesHead, readTablesSection,
  readTextures,
} from '../../src/reader';
import { hasGlb } from '../../src/format/manifest';
import { golden, goldenNames } from '../support/files';
import { problem } from '../support/scan';

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
  if (end && end.offset + end.bytes !== bytes.length)
    throw new FormatError('tables.bin', '', 'another length', '');
  return Promise.all(head.planes.map((s, p) =>
    readTablesSection(head, p, bytes.subarray(s.offset, s.offset + s.bytes))));
}
const documents: Record<string, (bytes: Uint8Array) => unknown> = {
  'manifest.json': readManifest,
  'index.bin': readIndex,
  'textures.json': readTextures,
  'tables.bin': readTables,
  'quality.json': readQuality,
};

describe.each(goldenNames)('%s', (name) => {
  it.each(Object.keys(documents))('%s: every truncation is told', async (path) => {
    const bytes = await entryOf(name, path);
    expect(await problem(() => documents[path](bytes))).toBeUndefined();
    const step = bytes.length > 4000 ? 37 : 1;
    for (let n = 0; n < bytes.length; n += step) {
      const error = await problem(() => documents[path](bytes.slice(0, n)));
      // Blanks may follow a JSON document.
      if (error === undefined && path === 'manifest.json')
        expect(new TextDecoder().decode(bytes.slice(n)).trim()).toBe('');
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
});

describe('scales that the vertex-split stream alone has', () => {
  /** The golden manifest, whose scale between the finest and the coarsest is a prefix of the stream. */
  async function manifestWith(change: (scales: Record<string, unknown[]>,
      stream: { offset: number; bytes: number; headBytes: number }) => void = () => undefined) {
    const json = JSON.parse(new TextDecoder().decode(await entryOf('v2.0-scan', 'manifest.json'))) as {
      scales: Record<string, unknown[]>;
      stream: { offset: number; bytes: number; headBytes: number };
    };
    change(json.scales, json.stream);
    return readManifest(new TextEncoder().encode(JSON.stringify(json)));
  }
  it('are prefixes of the stream', async () => {
    const { scales } = await manifestWith();
    expect(scales.map(hasGlb)).toEqual([true, false, true]);
    expect(scales[1].glb.path).toBe('mesh/stream.bin');
  });
  it('are neither the finest nor the coarsest, and lie in the stream', async () => {
    const bad: Parameters<typeof manifestWith>[0][] = [
      (s, { offset }) => (s.offset[0] = offset),
      (s, { offset }) => (s.offset[2] = offset),
      (s, { bytes }) => (s.bytes[1] = bytes + 1),
      (s, { headBytes }) => (s.bytes[1] = headBytes),
    ];
    for (const change of bad) expect(await problem(() => manifestWith(change))).toBeInstanceOf(FormatError);
  });
});
