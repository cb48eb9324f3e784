import { describe, expect, it } from 'vitest';
import { toHex } from '../src/format/bytes';
import { fragmentFilePath } from '../src/format/entry_paths';
import { sha256 } from '../src/format/sha256';
import { treeUrl } from '../src/http/without_ranges';
import { InputError, OpenOptions, PackageReader, TexmeshError } from '../src/reader';
import { FakeServer, Fault, FaultKind, bytesAskedTwice, fakeServer, treeFiles } from './fake_server';
import { golden } from './support';

const container = golden('v1.1-scan');
const url = 'http://host/a/scan.texmesh';
const quick: OpenOptions = { retryDelayS: 0.001, stallTimeoutS: 0.05, retries: 2 };

async function openAt(server: FakeServer, options: OpenOptions = {}): Promise<PackageReader> {
  return PackageReader.openUrl(url, { fetch: server.fetch, ...quick, ...options });
}
const range = (fault?: Fault): FakeServer => fakeServer({ '/a/scan.texmesh': container }, { fault });
async function tree(fault?: Fault): Promise<FakeServer> {
  const reader = await PackageReader.openBytes(container, 'golden');
  const entries = [...(await reader.index()), reader.manifest.index];
  const files = treeFiles('/a/scan/', container, await reader.store.manifest(), entries);
  return fakeServer({ ...files, '/a/scan.texmesh': container }, { ranges: false, fault });
}
/** Reads documents, a mesh and some fragments. */
async function readSome(reader: PackageReader): Promise<number> {
  const tables = await reader.tables();
  await reader.quality();
  let bytes = (await reader.scaleGlb(0)).length;
  for (const f of tables[0]!.order.slice(0, 5)) bytes += (await reader.completeFragment(0, 0, f)).length;
  return bytes;
}
async function failure(what: Promise<unknown>): Promise<Error> {
  try {
    await what;
  } catch (error) {
    return error as Error;
  }
  throw new Error('it should have failed');
}
const once =
  (kind: FaultKind, at: number): Fault =>
  ({ number }) =>
    number === at && kind;

const expected = await readSome(await PackageReader.openBytes(container, 'golden'));

describe('a server with ranges', () => {
  it('is asked for one range of 16 KiB at first', async () => {
    const server = range();
    const reader = await openAt(server);
    expect(server.log.map((r) => r.range)).toEqual([[0, 16383]]);
    expect(reader.form).toBe('range');
    expect(reader.requests[0]).toMatchObject({ kind: 'manifest', received: 16384, ok: true });
  });
  it('is asked for nothing twice', async () => {
    const server = range();
    const reader = await openAt(server);
    await reader.prefetchDocuments();
    await reader.firstPicture();
    await readSome(reader);
    await reader.tables();
    await reader.textures();
    await reader.preview(0);
    expect(bytesAskedTwice(server.log, url)).toBe(0);
  });
  it('two askers of one document share a request', async () => {
    const server = range();
    const reader = await openAt(server);
    await Promise.all([reader.textures(), reader.textures(), reader.tables(), reader.tables()]);
    expect(bytesAskedTwice(server.log, url)).toBe(0);
  });
  it('counts bytes by kind', async () => {
    const reader = await openAt(range());
    await readSome(reader);
    const total = Object.values(reader.bytesByKind).reduce((sum, n) => sum + n, 0);
    expect(total).toBe(reader.requests.reduce((sum, r) => sum + r.received, 0));
    expect(reader.bytesByKind.mesh).toBe(reader.manifest.scales[0].glb.bytes);
  });
});

describe('trouble', () => {
  const survived: FaultKind[] = ['status-500', 'refused', 'cut', 'stall', 'short', 'flip'];
  for (const kind of survived)
    for (const at of [1, 3])
      it(`${kind} of request ${at} is survived`, async () => {
        const server = range(once(kind, at));
        expect(await readSome(await openAt(server))).toBe(expected);
      });
  it('a cut transfer goes on where it broke', async () => {
    const server = range(once('cut', 0));
    await openAt(server);
    expect(server.log.map((r) => r.range)).toEqual([[0, 16383], [8192, 16383]]);
  });
  const fatal: [FaultKind, string][] = [
    ['status-404', 'status 404'],
    ['status-416', 'status 416'],
    ['long', 'more'],
    ['wrong-range', 'the range that was asked for'],
    ['whole', 'replaced'],
    ['other-etag', 'another one'],
  ];
  for (const [kind, words] of fatal)
    it(`${kind} is told`, async () => {
      const server = range(({ number }) => number > 0 && kind);
      const error = await failure(openAt(server).then(readSome));
      expect(error).toBeInstanceOf(TexmeshError);
      expect(error.message).toContain(words);
    });
  for (const kind of ['status-500', 'refused', 'stall', 'flip'] as const)
    it(`${kind} for ever ends in a clear error`, async () => {
      const server = range(({ number }) => number > 0 && kind);
      const error = await failure(openAt(server).then(readSome));
      expect(error).toBeInstanceOf(TexmeshError);
      expect(server.log.length).toBeLessThan(12);
    });
  it('no package at all', async () => {
    const error = await failure(openAt(fakeServer({ '/a/scan.texmesh': new Uint8Array(300) })));
    expect(error.message).toContain('a texmesh package');
  });
  it('cancelling ends a stalled read at once', async () => {
    const server = range(({ number }) => number > 0 && 'stall');
    const reader = await openAt(server, { stallTimeoutS: 30 });
    const abort = new AbortController();
    const reading = failure(reader.scaleGlb(0, { signal: abort.signal }));
    setTimeout(() => abort.abort(), 20);
    expect((await reading).name).toBe('AbortError');
  });
  it('opening can be cancelled', async () => {
    const abort = new AbortController();
    const opening = failure(openAt(range(once('stall', 0)), { stallTimeoutS: 30, signal: abort.signal }));
    setTimeout(() => abort.abort(), 20);
    expect((await opening).name).toBe('AbortError');
  });
  it('a cap holds transfers back', async () => {
    const begin = performance.now();
    await openAt(range(), { capBytesS: 100e3 });
    expect(performance.now() - begin).toBeGreaterThan(120);
  });
});

describe('a server without ranges', () => {
  it('the tree beside the container is taken', async () => {
    const server = await tree();
    const reader = await openAt(server);
    expect(reader.form).toBe('files');
    expect(await readSome(reader)).toBe(expected);
    const files = server.log.map((r) => r.url).filter((u) => !u.endsWith('fragments.json'));
    expect(new Set(files).size).toBe(files.length);
  });
  it('a damaged file is fetched again', async () => {
    const path = 'mesh/s00.glb';
    let damaged = false;
    const server = await tree(({ url: u }) => {
      if (!u.endsWith(path) || damaged) return false;
      damaged = true;
      return 'flip';
    });
    expect(await readSome(await openAt(server))).toBe(expected);
  });
  it('or the whole container, where there is no tree', async () => {
    const server = fakeServer({ '/a/scan.texmesh': container }, { ranges: false });
    const reader = await openAt(server);
    expect(reader.form).toBe('whole');
    expect(await readSome(reader)).toBe(expected);
  });
  it('unless ranges are insisted on', async () => {
    const server = fakeServer({ '/a/scan.texmesh': container }, { ranges: false });
    expect((await failure(openAt(server, { mode: 'range' }))).message).toContain('answers ranges');
  });
  it('a container that is too large is refused', async () => {
    const server = fakeServer({ '/a/scan.texmesh': container }, { ranges: false });
    expect((await failure(openAt(server, { maxWholeBytes: 1000 }))).message).toContain('at most 1000 bytes');
  });
  it('the URL of a tree keeps query and fragment', () => {
    expect(treeUrl('https://h/a/N.texmesh?v=1#x')).toBe('https://h/a/N/?v=1#x');
    expect(treeUrl('https://h/a/N.zip')).toBe('');
  });
});

describe('mirrors', () => {
  const mirrors = ['http://other/a/scan.texmesh'];
  it('one that is dead from the beginning is left alone', async () => {
    const server = range(({ url: u }) => u.startsWith('http://host') && 'refused');
    expect(await readSome(await openAt(server, { mirrors }))).toBe(expected);
  });
  it('one that dies with many requests under way loses none', async () => {
    let served = 0;
    const server = range(({ url: u }) => u.startsWith('http://host') && ++served > 3 && 'cut');
    const reader = await openAt(server, { mirrors });
    const tables = await reader.planeTables(0);
    const fragments = await Promise.all([...tables.order].map((f) => reader.fragment(0, 0, f)));
    expect(fragments.every((f) => f.length > 0)).toBe(true);
  });
  it('one that gives other bytes is found out', async () => {
    const server = range(({ url: u, number }) => u.startsWith('http://host') && number > 0 && 'flip');
    expect(await readSome(await openAt(server, { mirrors }))).toBe(expected);
  });
  it('all dead: the last one says why', async () => {
    const server = range(({ number }) => number > 0 && 'refused');
    const error = await failure(openAt(server, { mirrors }).then(readSome));
    expect(error.message).toContain('connection refused');
  });
  it('one that was too slow for somebody who cancelled may be asked again', async () => {
    const server = range(({ url: u, number }) => number === 1 && u.startsWith('http://host') && 'stall');
    const reader = await openAt(server, { mirrors, stallTimeoutS: 5 });
    const abort = new AbortController();
    const error = failure(reader.scaleGlb(0, { signal: abort.signal }));
    abort.abort();
    expect((await error).name).toBe('AbortError');
    await readSome(reader);
    expect(server.log.filter((r) => r.url.startsWith('http://host')).length).toBeGreaterThan(2);
  });
  it('one that knows no ranges leaves them to one that does', async () => {
    const server = range(({ url: u }) => u.startsWith('http://host') && 'whole');
    const reader = await openAt(server, { mirrors, mode: 'range' });
    expect(reader.form).toBe('range');
    expect(await readSome(reader)).toBe(expected);
    expect(server.log.filter((r) => r.url.startsWith('http://host')).length).toBe(1);
  });
  it('one that knows no ranges is met in the middle', async () => {
    const server = range(({ url: u, number }) => (u.startsWith('http://host') ? number > 0 && 'refused' : 'whole'));
    const error = await failure(openAt(server, { mirrors }).then(readSome));
    expect(error).toBeInstanceOf(InputError);
    expect(error.message).toContain('answers ranges');
  });
  it('a dead one and one without ranges: the whole file of the other', async () => {
    const server = range(({ url: u, range: r }) => (u.startsWith('http://host') ? 'refused' : r !== undefined && 'whole'));
    const reader = await openAt(server, { mirrors });
    expect(reader.form).toBe('whole');
    expect(await readSome(reader)).toBe(expected);
  });
  it('one that has something else instead of the whole file is left alone', async () => {
    const page = new TextEncoder().encode('<html>');
    const server = fakeServer({ '/a/scan.texmesh': page, '/b/scan.texmesh': container }, { ranges: false });
    expect(await readSome(await openAt(server, { mirrors: ['http://other/b/scan.texmesh'] }))).toBe(expected);
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
      const reader = await openAt(server, { mirrors, mode: 'files' });
      expect(await reader.fragmentFile(0, 0, first)).toEqual(wanted);
      await reader.fragmentFile(0, 0, second);
      expect(server.log.filter((r) => r.url.startsWith('http://host') && isFragment(r.url)).length).toBe(1);
    });
  it('are asked for once more where they were damaged on the way', async () => {
    let times = 0;
    const server = at(({ url: u }) => isFragment(u) && ++times === 1 && 'flip');
    const reader = await openAt(server, { mode: 'files' });
    expect(await reader.fragmentFile(0, 0, first)).toEqual(wanted);
    expect(times).toBe(2);
  });
  it('that cannot be had say why', async () => {
    const reader = await openAt(at(({ url: u }) => isFragment(u) && 'status-500'), { mode: 'files' });
    expect((await failure(reader.fragmentFile(0, 0, first))).message).toContain('status 500');
    expect((await failure(reader.fragmentFile(0, 99, first))).message).toContain('a file');
  });
  it('are not needed where there is no word of them, which is no mistake of a mirror', async () => {
    const server = at(({ url: u }) => u.endsWith('fragments.json') && (u.startsWith('http://host') ? 'status-404' : 'status-500'));
    const reader = await openAt(server, { mirrors, mode: 'files' });
    expect(await reader.fragmentFiles()).toBeUndefined();
    await readSome(reader);
    expect(server.log.filter((r) => !r.url.startsWith('http://host')).length).toBe(0);
  });
});
