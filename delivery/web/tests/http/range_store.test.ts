import { describe, expect, it } from 'vitest';
import { absolute, HttpClient } from '../../src/http/client';
import { openStore } from '../../src/http/package_reader';
import { FormatError, PackageReader, TexmeshError } from '../../src/reader';
import { bytesAskedTwice, fakeServer, FakeServer, FaultKind } from '../support/fake_server';
import { expected, once, readSome } from '../support/reading';
import { container, files, openRetrying, quick, range, rejection, url } from '../support/scan';

describe('hostile answers', () => {
  /** Answers of another origin, which keeps Content-Range to itself, read by a page. */
  async function fromElsewhere(server: FakeServer,
      body: (read: typeof fetch) => Promise<void>): Promise<void> {
    const before = Object.getOwnPropertyDescriptor(globalThis, 'location');
    Object.defineProperty(globalThis, 'location', { value: new URL('http://host/page'), configurable: true });
    try {
      await body(async (input, init) => {
        const answer = await server.fetch(input, init);
        const headers = new Headers(answer.headers);
        headers.delete('content-range');
        const other = new Response(answer.body, { status: answer.status, headers });
        Object.defineProperty(other, 'url', { value: 'https://cdn.example/scan.texmesh' });
        return other;
      });
    } finally {
      if (before) Object.defineProperty(globalThis, 'location', before);
      else Reflect.deleteProperty(globalThis, 'location');
    }
  }
  it('a size beyond the end of the file is refused before anything is made room for', async () => {
    const server = range();
    const client = new HttpClient({ fetch: server.fetch, ...quick });
    const { store } = await openStore(url, [], 'range', client);
    for (const bytes of [3e9, 2 ** 50]) {
      const place = { path: 'mesh/s00.glb', offset: 20000, bytes };
      expect(await rejection(store.read(place, place, { kind: 'mesh' }))).toBeInstanceOf(FormatError);
      // Overlapping what is known, too.
      expect(await rejection(store.read(place, { offset: 100, bytes }, { kind: 'mesh' })))
        .toBeInstanceOf(FormatError);
    }
    expect(server.log.length).toBe(1);
  });
  it('nothing is asked for where an entry is empty', async () => {
    const server = range();
    const { store } = await openStore(url, [], 'range', new HttpClient({ fetch: server.fetch, ...quick }));
    expect((await store.read({ path: 'texture/0/tables.pack', offset: 20000, bytes: 0 },
      { offset: 20000, bytes: 0 }, { kind: 'texture' })).length).toBe(0);
    expect(server.log.length).toBe(1);
  });
  it('a redirection to another origin may keep Content-Range to itself', () =>
    fromElsewhere(range(), async (read) => {
      const reader = await PackageReader.openUrl(url, { fetch: read, ...quick });
      expect((await reader.textures()).length).toBe(reader.manifest.planeCount);
      expect(absolute('a.texmesh')).toBe('http://host/a.texmesh');
    }));
  it('then it may answer less than was asked for, but not crumbs', () =>
    fromElsewhere(range(({ number }) => number > 0 && 'part'), async (read) => {
      expect(await readSome(await PackageReader.openUrl(url, { fetch: read, ...quick }))).toBe(expected);
    }));
  it('then what is not whole is told', () =>
    fromElsewhere(range(({ number }) => number > 0 && 'short'), async (read) => {
      const { store } = await openStore(url, [], 'range', new HttpClient({ fetch: read, ...quick }));
      const place = { path: 'mesh/S02.glb', offset: 20000, bytes: 500 };
      const error = await rejection(store.read(place, place, { kind: 'mesh' }));
      expect(error.message).toContain('an answer with status 206');
    }));
});

describe('a server with ranges', () => {
  it('is asked for one range of 44 KiB at first', async () => {
    const server = range();
    const reader = await PackageReader.openUrl(url, { fetch: server.fetch });
    expect(server.log.map((r) => r.range)).toEqual([[0, 45055]]);
    expect(reader.form).toBe('range');
    expect(reader.requests[0]).toMatchObject({ kind: 'manifest', received: 45056, ok: true });
  });
  it('gives the first picture with its first answer, and the documents with the second', async () => {
    const server = range();
    const reader = await PackageReader.openUrl(url, { fetch: server.fetch });
    const { scale, glb } = reader.manifest.scales.at(-1)!;
    expect(glb.offset + glb.bytes).toBeLessThanOrEqual(45056);
    await reader.scaleGlb(scale);
    expect(server.log.length).toBe(1);
    await reader.prefetchDocuments();
    await reader.data();
    await reader.tableStream(0, 0);
    expect(server.log.length).toBeLessThanOrEqual(2);
  });
  it('hears of no If-Range', async () => {
    const server = range(once('cut', 1));
    const headers: string[] = [];
    const fetch: typeof globalThis.fetch = (input, init) => {
      headers.push(...new Headers(init?.headers).keys());
      return server.fetch(input, init);
    };
    await readSome(await PackageReader.openUrl(url, { ...quick, fetch }));
    expect(new Set(headers)).toEqual(new Set(['range']));
  });
  it('is asked for nothing twice', async () => {
    const server = range();
    const reader = await openRetrying(server);
    await reader.prefetchDocuments();
    await reader.scaleGlb(reader.manifest.scales.at(-1)!.scale);
    await readSome(reader);
    await reader.tables();
    await reader.textures();
    await reader.preview(0);
    expect(bytesAskedTwice(server.log, url)).toBe(0);
  });
  it('two askers of one document share a request', async () => {
    const server = range();
    const reader = await openRetrying(server);
    await Promise.all([reader.textures(), reader.textures(), reader.tables(), reader.tables()]);
    expect(bytesAskedTwice(server.log, url)).toBe(0);
  });
});

describe('trouble', () => {
  const survived: FaultKind[] = ['status-500', 'refused', 'cut', 'stall', 'short', 'flip', 'no-total',
    'other-etag'];
  const fatal: [FaultKind, string][] = [
    ['status-404', 'status 404'],
    ['status-416', 'replaced, open it anew'],
    ['long', 'more'],
    ['wrong-range', 'the range that was asked for'],
    ['whole', 'ranges are no longer answered'],
    ['whole-other', 'replaced, open it anew'],
    ['whole-longer', 'replaced, open it anew'],
    ['other-file', 'replaced, open it anew'],
  ];
  for (const kind of survived)
    for (const at of [1, 3])
      it(`${kind} of request ${at} is survived`, async () => {
        const server = range(once(kind, at));
        expect(await readSome(await openRetrying(server))).toBe(expected);
      });
  it('servers behind one name may have ETags of their own: the manifest is asked for once more', async () => {
    const server = range(({ number }) => number % 2 === 1 && 'other-etag');
    const reader = await openRetrying(server);
    expect(await readSome(reader)).toBe(expected);
    expect(server.log.filter((r) => r.range![0] === 0).length).toBe(2);
  });
  it('but the first answer is not completed by another file', async () => {
    const server = range(({ number }) => (number === 0 ? 'cut' : number === 1 && 'other-etag'));
    expect(await readSome(await openRetrying(server))).toBe(expected);
    expect(server.log.slice(0, 3).map((r) => r.range![0])).toEqual([0, 8192, 0]);
  });
  it('a node with an ETag of its own that answers no ranges ends them', async () => {
    const server = range(({ number }) => number > 0 && (number < 4 ? 'other-etag' : 'whole-other'));
    const error = await rejection(openRetrying(server).then(readSome));
    expect(error.message).toContain('ranges are no longer answered');
  });
  it('bytes that are damaged again and again let the first ones be read once more', async () => {
    const server = range((request) => request.range![0] > 0 && 'flip');
    const reader = await openRetrying(server);
    for (const n of [0, 1, 2, 3]) await rejection(reader.scaleGlb(reader.manifest.scales[n % 2].scale));
    expect(server.log.filter((r) => r.range![0] === 0).length).toBe(2);
  });
  it('bytes of another package of the same length are told as such where no ETag tells', async () => {
    const { fetch } = range(({ number }) => number > 1 && 'other-file');
    const untold: typeof fetch = async (input, init) => {
      const answer = await fetch(input, init);
      answer.headers.delete('ETag');
      return answer;
    };
    const error = await rejection(PackageReader.openUrl(url, { ...quick, fetch: untold }).then(readSome));
    expect(error.message).toContain('replaced, open it anew');
  });
  it('a length that no answer tells is legal', async () => {
    expect(await readSome(await openRetrying(range(() => 'no-total')))).toBe(expected);
  });
  it('a server may answer less than was asked for, but not crumbs', async () => {
    const server = range(() => 'part');
    expect(await readSome(await openRetrying(server))).toBe(expected);
    expect(server.log.slice(0, 4).map((r) => r.range![0])).toEqual([0, 5000, 10000, 15000]);
    const error = await rejection(openRetrying(range(() => 'crumb')));
    expect(error.message).toContain('an answer with status 206');
  });
  it('a server that says when it wants to be asked again is asked then', async () => {
    const started = performance.now();
    await openRetrying(range(once('busy', 0)));
    expect(performance.now() - started).toBeGreaterThan(900);
  });
  it('a server that answers nothing any more is asked once for each thing', async () => {
    const server = range(({ number }) => number > 0 && 'status-500');
    const reader = await openRetrying(server);
    const asked = Array.from({ length: 20 }, (_, i) => i);
    for (const i of asked) await rejection(reader.store.read({ path: 'x', offset: 20000 + i, bytes: 9 },
      { offset: 20000 + i, bytes: 9 }, { kind: 'other' }));
    expect(server.log.length).toBeGreaterThan(20);
    expect(server.log.length).toBeLessThan(40); // not 60
  });
  it('a cut transfer goes on where it broke', async () => {
    const server = range(once('cut', 0));
    await openRetrying(server);
    expect(server.log.map((r) => r.range)).toEqual([[0, 16383], [8192, 16383]]);
  });
  for (const [kind, words] of fatal)
    it(`${kind} is told`, async () => {
      const server = range(({ number }) => number > 0 && kind);
      const error = await rejection(openRetrying(server).then(readSome));
      expect(error).toBeInstanceOf(TexmeshError);
      expect(error.message).toContain(words);
    });
  for (const kind of ['status-500', 'refused', 'stall', 'flip'] as const)
    it(`${kind} for ever ends in a clear error`, async () => {
      const server = range(({ number }) => number > 0 && kind);
      const error = await rejection(openRetrying(server).then(readSome));
      expect(error).toBeInstanceOf(TexmeshError);
      expect(server.log.length).toBeLessThan(12);
    });
  it('no package at all', async () => {
    const error = await rejection(openRetrying(fakeServer({ '/a/scan.texmesh': new Uint8Array(300) })));
    expect(error.message).toContain('a texmesh package');
  });
  it('cancelling ends a stalled read at once', async () => {
    const server = range(({ number }) => number > 0 && 'stall');
    const reader = await openRetrying(server, { stallTimeoutS: 30 });
    const abort = new AbortController();
    const reading = rejection(reader.scaleGlb(0, { signal: abort.signal }));
    setTimeout(() => abort.abort(), 20);
    expect((await reading).name).toBe('AbortError');
  });
  it('opening can be cancelled', async () => {
    const abort = new AbortController();
    const opening =
      rejection(openRetrying(range(once('stall', 0)), { stallTimeoutS: 30, signal: abort.signal }));
    setTimeout(() => abort.abort(), 20);
    expect((await opening).name).toBe('AbortError');
  });
});

it('bytes are told as they come, over a cut and what is known already', async () => {
  for (const offset of [20000, 10000]) {
    const server = fakeServer(files, { fault: ({ number }) => number === 1 && 'cut' });
    const reader =
      await PackageReader.openUrl(url, { fetch: server.fetch, startBytes: 16384, retryDelayS: 0.001 });
    const told: number[] = [];
    const range = { offset, bytes: 30000 };
    const got = await reader.store.read({ path: 'x', ...range }, range,
      { kind: 'other', onBytes: (n) => void told.push(n) });
    expect([...got]).toEqual([...container.subarray(offset, offset + 30000)]);
    expect(server.log.length).toBe(3); // the rest alone
    expect(told).toEqual([...told].sort((a, b) => a - b));
    const [from, to] = server.log[1].range!;
    expect(told.at(-1)).toBe(to - from + 1);
  }
});

it('what was damaged on the way is forgotten, and fetched again once', async () => {
  const server = fakeServer(files, { fault: ({ number }) => number === 1 && 'flip' });
  const reader =
    await PackageReader.openUrl(url, { fetch: server.fetch, startBytes: 16384, retryDelayS: 0.001 });
  const range = { offset: 20000, bytes: 5000 };
  const place = { path: 'x', ...range };
  await reader.store.read(place, range, { kind: 'other' }); // nobody checks
  const verify = (got: Uint8Array): Promise<void> =>
    got.every((b, i) => b === container[20000 + i]) ? Promise.resolve()
      : Promise.reject(new FormatError('x', '', 'these bytes', 'others'));
  for (let n = 0; n < 2; ++n) await reader.store.read(place, range, { kind: 'other', verify, once: n === 0 });
  expect(server.log.length).toBeLessThanOrEqual(4);
  await reader.store.read(place, { offset: 20000, bytes: 5000 }, { kind: 'other', verify });
  expect(server.log.length).toBe(4); // once, for nobody; and once to be kept
});
