import { describe, expect, it } from 'vitest';
import { hasGlb } from '../../src/format/manifest';
import { InputError, PackageReader } from '../../src/reader';
import { container, openAt, quick, range, rejection, url } from '../support/scan';

describe('what is read ahead', () => {
  async function readAll(reader: PackageReader): Promise<void> {
    await reader.prefetchDocuments();
    await reader.data();
    await reader.quality();
    expect((await reader.splitStreamHead())!.length).toBe(reader.manifest.stream!.headBytes);
    expect((await reader.index()).length).toBeGreaterThan(5);
  }
  it('is fetched again when a bit has turned over', async () => {
    const server = range(({ number }) => number === 1 && 'flip');
    await readAll(await openAt(server));
  });
  it('is fetched elsewhere when a mirror gives other bytes', async () => {
    const server = range(({ url: u, number }) => u.startsWith('http://host') && number > 0 && 'flip');
    await readAll(await openAt(server, { mirrors: ['http://other/a/scan.texmesh'] }));
  });
  it('holds what came with the manifest to its digests, too', async () => {
    const { manifest } = await PackageReader.openBytes(container, 'golden');
    const refs = [manifest.index, manifest.tables, manifest.textures, manifest.quality,
      ...manifest.scales.filter(hasGlb).map((s) => s.glb)];
    const early = refs.find((r) => r.offset < 16384 && r.bytes > 0)!;
    const server = range();
    const first: typeof fetch = async (input, init) => {
      const answer = await server.fetch(input, init);
      if (server.log.length > 1) return answer;
      const body = new Uint8Array(await answer.arrayBuffer());
      body[early.offset] ^= 1;
      return new Response(body, answer);
    };
    const reader = await PackageReader.openUrl(url, { fetch: first, ...quick });
    const scale = manifest.scales.find((s) => s.glb === early)?.scale;
    if (scale === undefined) await readAll(reader);
    else expect((await reader.scaleGlb(scale)).length).toBe(early.bytes);
  });
  it('the head of the vertex splits comes from another mirror where it is bad', async () => {
    const { manifest } = await PackageReader.openBytes(container, 'golden');
    const server = range(({ url: u, range: r }) => u.startsWith('http://host') &&
      r?.[0] === manifest.stream!.offset && 'flip');
    const reader = await openAt(server, { mirrors: ['http://other/a/scan.texmesh'] });
    expect((await reader.splitStreamStart(0))!.length).toBe(manifest.stream!.headBytes);
  });
});

describe('a failure', () => {
  const asked: [string, (r: PackageReader) => Promise<unknown>][] = [
    ['a preview', (r) => r.preview(0)],
    ['tables', (r) => r.tables()],
    ['quality', (r) => r.quality()],
    ['a mesh', (r) => r.scaleGlb(0)],
  ];
  for (const [name, ask] of asked)
    it(`of ${name} is not for ever`, async () => {
      let down = false;
      const reader = await openAt(range(() => down && 'status-500'), { retries: 0 });
      down = true;
      expect(await rejection(ask(reader))).toBeInstanceOf(InputError);
      down = false;
      await ask(reader);
    });
  it('of one asker who cancels is not that of others', async () => {
    let stalls = true;
    const reader =
      await openAt(range(({ number }) => number > 0 && stalls && 'stall'), { stallTimeoutS: 30 });
    const abort = new AbortController();
    const one = rejection(reader.quality(abort.signal));
    const other = reader.quality();
    await new Promise((go) => setTimeout(go, 10));
    stalls = false;
    abort.abort();
    expect((await one).name).toBe('AbortError');
    await other;
  });
  it('nor of one who cancels while tables and index come', async () => {
    for (const ask of [
      (r: PackageReader, s?: AbortSignal) => r.data(undefined, s),
      (r: PackageReader, s?: AbortSignal) => r.planeFiles(0, s),
      (r: PackageReader, s?: AbortSignal) => r.quality(s),
      (r: PackageReader, s?: AbortSignal) => r.tableStream(0, 0, s),
    ]) {
      let stalls = true;
      const server = range(({ number }) => number > 0 && stalls && 'stall');
      const reader = await openAt(server, { stallTimeoutS: 30 });
      const abort = new AbortController();
      const one = rejection(ask(reader, abort.signal));
      const other = ask(reader);
      await new Promise((go) => setTimeout(go, 10));
      expect(server.log.length).toBeGreaterThan(1);
      stalls = false;
      abort.abort();
      expect((await one).name).toBe('AbortError');
      await other;
    }
  });
});
