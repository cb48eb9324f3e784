import { describe, expect, it } from 'vitest';
import { sha256, toHex } from '../../src/format/sha256';
import { fragmentFilePath } from '../../src/format/entry_paths';
import { FormatError, InputError, PackageReader, TexmeshError } from '../../src/reader';
import { fakeServer, FakeServer, Fault, treeFiles } from '../support/fake_server';
import { golden, goldenNames } from '../support/files';
import { readSome } from '../support/reading';
import { container, openRetrying, problem, range, rejection } from '../support/scan';

describe('a server with ranges', () => {
  it('counts bytes by kind', async () => {
    const reader = await openRetrying(range());
    await readSome(reader);
    const total = Object.values(reader.bytesByKind).reduce((sum, n) => sum + n, 0);
    expect(total).toBe(reader.requests.reduce((sum, r) => sum + r.received, 0));
    expect(reader.bytesByKind.mesh).toBe(reader.manifest.scales[0].glb.bytes);
  });
});

describe('files of fragments', async () => {
  const mirrors = ['http://other/a/scan.texmesh'];
  const packed = await PackageReader.openBytes(container, 'golden');
  const entries = [...(await packed.index()), packed.manifest.index];
  const files = treeFiles('/a/scan/', container, await packed.store.manifest(), entries);
  const planes = [];
  for (const [p, tables] of (await packed.tables()).entries()) {
    const order = [...tables!.order];
    const rungs = [];
    for (let r = 0; r < tables!.rungQuality.length; ++r) {
      const bytes: number[] = [];
      const sha: string[] = [];
      for (const f of order) {
        const file = await packed.completeFragment(p, r, f);
        files[`/a/scan/${fragmentFilePath(p, r, f, 'jpg')}`] = file;
        bytes.push(file.length);
        sha.push(toHex((await sha256(file)).subarray(0, 8)));
      }
      rungs.push({ bytes, sha256: sha });
    }
    planes.push({ order, rungs });
  }
  files['/a/scan/fragments.json'] = new TextEncoder().encode(JSON.stringify({ version: 1, planes }));
  const [first, second] = planes[0].order;
  const wanted = files[`/a/scan/${fragmentFilePath(0, 0, first, 'jpg')}`];
  const at = (fault?: Fault): FakeServer => fakeServer(files, { ranges: false, fault });
  const isFragment = (u: string): boolean => /\/r\d\d\/\d+\.jpg$/.test(u);

  for (const kind of ['status-500', 'status-404', 'flip', 'refused'] as const)
    it(`come from another mirror: ${kind}`, async () => {
      const server = at(({ url: u }) => u.startsWith('http://host') && isFragment(u) && kind);
      const reader = await openRetrying(server, { mirrors, mode: 'files' });
      expect(await reader.fragmentFile(0, 0, first)).toEqual(wanted);
      await reader.fragmentFile(0, 0, second);
      expect(server.log.filter((r) => r.url.startsWith('http://host') && isFragment(r.url)).length).toBe(1);
    });
  it('are asked for once more where they were damaged on the way', async () => {
    let times = 0;
    const server = at(({ url: u }) => isFragment(u) && ++times === 1 && 'flip');
    const reader = await openRetrying(server, { mode: 'files' });
    expect(await reader.fragmentFile(0, 0, first)).toEqual(wanted);
    expect(times).toBe(2);
  });
  it('that cannot be had say why', async () => {
    const reader = await openRetrying(at(({ url: u }) => isFragment(u) && 'status-500'), { mode: 'files' });
    expect((await rejection(reader.fragmentFile(0, 0, first))).message).toContain('status 500');
    expect((await rejection(reader.fragmentFile(0, 99, first))).message).toContain('a file');
  });
  it('are not needed where there is no word of them, which is no mistake of a mirror', async () => {
    const server = at(({ url: u }) => u.endsWith('fragments.json') &&
      (u.startsWith('http://host') ? 'status-404' : 'status-500'));
    const reader = await openRetrying(server, { mirrors, mode: 'files' });
    expect(await reader.fragmentFiles()).toBeUndefined();
    await readSome(reader);
    expect(server.log.filter((r) => !r.url.startsWith('http://host')).length).toBe(0);
  });
});

describe.each(goldenNames)('%s', (name) => {
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
      // only the directory is missing, which nobody reads
      else expect(n).toBeGreaterThan(0.95 * whole.length);
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
  const reader = await PackageReader.openBytes(golden('v2.0-scan'), 'golden');
  it.each([
    ['a plane', () => reader.planeTables(99)],
    ['a rung', () => reader.fragmentRange(0, 99, 0)],
    ['a scale', () => reader.scaleGlb(50)],
  ])('%s', async (_, read) => {
    expect(await problem(read)).toBeInstanceOf(InputError);
  });
  it('a rung', async () => expect(await problem(() => reader.tableStream(0, 99))).toBeInstanceOf(InputError));
  it('an entry',
    async () => expect(await problem(() => reader.entry('nothing.bin'))).toBeInstanceOf(FormatError));
});
