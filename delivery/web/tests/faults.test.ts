import { Scene } from 'three';
import { describe, expect, it } from 'vitest';
import { imageSize } from '../src/format/image_size';
import { requireSelfContained } from '../src/format/self_contained_glb';
import { HttpClient, absolute } from '../src/http/client';
import { openStore } from '../src/http/open_store';
import { TreeStore } from '../src/http/tree_store';
import { TexmeshPackage } from '../src/open';
import { FormatError, InputError, OpenOptions, PackageReader } from '../src/reader';
import type { LoadOptions } from '../src/scene/api';
import { handle } from '../src/worker';
import { WorkerPool } from '../src/worker/pool';
import type { WorkerRequest } from '../src/worker/protocol';
import { FakeServer, Fault, fakeServer } from './fake_server';
import { golden } from './support';

const container = golden('v1.1-scan');
const url = 'http://host/a/scan.texmesh';
const quick: OpenOptions = { retryDelayS: 0.001, stallTimeoutS: 0.05, retries: 1 };
const range = (fault?: Fault): FakeServer => fakeServer({ '/a/scan.texmesh': container }, { fault });
const openAt = (server: FakeServer, options: OpenOptions = {}): Promise<PackageReader> =>
  PackageReader.openUrl(url, { fetch: server.fetch, ...quick, ...options });
const rejection = (what: Promise<unknown>): Promise<Error> =>
  what.then(() => { throw new Error('it should have failed'); }, (error: Error) => error);

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
    const refs = [manifest.index, manifest.tables, manifest.textures, manifest.quality, ...manifest.scales.map((s) => s.glb)];
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
    const server = range(({ url: u, range: r }) => u.startsWith('http://host') && r?.[0] === manifest.stream!.offset && 'flip');
    const reader = await openAt(server, { mirrors: ['http://other/a/scan.texmesh'] });
    expect((await reader.splitStreamStart(0))!.length).toBe(manifest.stream!.headBytes);
  });
});

describe('a failure', () => {
  const asked: [string, (r: PackageReader) => Promise<unknown>][] = [
    ['textures', (r) => r.textures()],
    ['tables', (r) => r.tables()],
    ['quality', (r) => r.quality()],
    ['the first picture', (r) => r.firstPicture()],
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
    const reader = await openAt(range(({ number }) => number > 0 && stalls && 'stall'), { stallTimeoutS: 30 });
    const abort = new AbortController();
    const one = rejection(reader.firstPicture({ signal: abort.signal }));
    const other = reader.firstPicture();
    await new Promise((go) => setTimeout(go, 10));
    stalls = false;
    abort.abort();
    expect((await one).name).toBe('AbortError');
    await other;
  });
  it('nor of one who cancels while tables and index come', async () => {
    for (const ask of [
      (r: PackageReader, s?: AbortSignal) => r.data(undefined, s), (r: PackageReader, s?: AbortSignal) => r.planeFiles(0, s),
      (r: PackageReader, s?: AbortSignal) => r.quality(s), (r: PackageReader, s?: AbortSignal) => r.tableStream(0, 0, s),
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
  it('nor in a tree of files', async () => {
    let stalls = true;
    const server = fakeServer({ '/a/x.bin': new Uint8Array(3000) }, { ranges: false, fault: () => stalls && 'stall' });
    const store = new TreeStore(['http://host/a/'], new HttpClient({ fetch: server.fetch, stallTimeoutS: 30 }));
    const abort = new AbortController();
    const place = { path: 'x.bin', offset: 0, bytes: 3000 };
    const one = rejection(store.read(place, { offset: 0, bytes: 10 }, { kind: 'other', signal: abort.signal }));
    const other = store.read(place, { offset: 0, bytes: 10 }, { kind: 'other' });
    await new Promise((go) => setTimeout(go, 10));
    stalls = false;
    abort.abort();
    expect((await one).name).toBe('AbortError');
    expect((await other).length).toBe(10);
  });
});

it('a tree whose files are others is left for a mirror', async () => {
  const file = Uint8Array.from({ length: 500 }, (_, i) => i & 255);
  const server = fakeServer({ '/a/x.bin': file }, { ranges: false, fault: ({ url: u }) => u.startsWith('http://host') && 'flip' });
  const verify = async (got: Uint8Array): Promise<void> => {
    if (got.some((b, i) => b !== file[i])) throw new FormatError('x.bin', '', 'these bytes', 'others');
  };
  const read = (roots: string[]): Promise<Uint8Array> =>
    new TreeStore(roots, new HttpClient({ fetch: server.fetch, ...quick })).read({ path: 'x.bin', offset: 0, bytes: 500 }, { offset: 0, bytes: 500 }, { kind: 'other', verify });
  expect((await read(['http://host/a/', 'http://other/a/'])).length).toBe(500);
  expect(await rejection(read(['http://host/a/']))).toBeInstanceOf(FormatError);
  expect(server.log.length).toBe(4);
});

describe('hostile answers', () => {
  it('a size beyond the end of the file is refused before anything is made room for', async () => {
    const server = range();
    const client = new HttpClient({ fetch: server.fetch, ...quick });
    const { store } = await openStore(url, [], 'range', client);
    for (const bytes of [3e9, 2 ** 50]) {
      const place = { path: 'mesh/s00.glb', offset: 20000, bytes };
      expect(await rejection(store.read(place, place, { kind: 'mesh' }))).toBeInstanceOf(FormatError);
      // Overlapping what is known, too.
      expect(await rejection(store.read(place, { offset: 100, bytes }, { kind: 'mesh' }))).toBeInstanceOf(FormatError);
    }
    expect(server.log.length).toBe(1);
  });
  it('nothing is asked for where an entry is empty', async () => {
    const server = range();
    const { store } = await openStore(url, [], 'range', new HttpClient({ fetch: server.fetch, ...quick }));
    expect((await store.read({ path: 'texture/0/tables.pack', offset: 20000, bytes: 0 }, { offset: 20000, bytes: 0 }, { kind: 'texture' })).length).toBe(0);
    expect(server.log.length).toBe(1);
  });
  it('a server that gives its front page for everything has the whole container, too', async () => {
    const page = new TextEncoder().encode('<!doctype html><title>front page</title>'.repeat(20));
    const files = { '/a/scan.texmesh': container, '/a/scan/manifest.json': page, '/a/scan/fragments.json': page };
    const reader = await openAt(fakeServer(files, { ranges: false }));
    expect(reader.form).toBe('whole');
  });
  it('mode files wants a URL that has a tree', async () => {
    const opening = PackageReader.openUrl('http://host/a/scan.zip', { fetch: range().fetch, mode: 'files' });
    expect(await rejection(opening)).toBeInstanceOf(InputError);
  });
  /** Answers of another origin, which keeps Content-Range to itself, read by a page. */
  async function fromElsewhere(server: FakeServer, body: (read: typeof fetch) => Promise<void>): Promise<void> {
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
  it('a redirection to another origin may keep Content-Range to itself', () =>
    fromElsewhere(range(), async (read) => {
      const reader = await PackageReader.openUrl(url, { fetch: read, ...quick });
      expect((await reader.textures()).length).toBe(reader.manifest.planeCount);
      expect(absolute('a.texmesh')).toBe('http://host/a.texmesh');
    }));
  it('then the length tells what is not whole', () =>
    fromElsewhere(range(({ number }) => number > 0 && 'short'), async (read) => {
      const { store } = await openStore(url, [], 'range', new HttpClient({ fetch: read, ...quick }));
      const place = { path: 'mesh/S02.glb', offset: 20000, bytes: 500 };
      const error = await rejection(store.read(place, place, { kind: 'mesh' }));
      expect(error).toBeInstanceOf(FormatError);
      expect(error.message).toContain('expected 500 bytes, found 499');
    }));
  const [jsonChunk, binChunk] = [0x4e4f534a, 0x004e4942];
  /** A GLB of these chunks. */
  function glb(...chunks: (string | [number, string])[]): Uint8Array {
    const all = chunks.map((c): [number, Uint8Array] =>
      typeof c === 'string' ? [jsonChunk, new TextEncoder().encode(c)] : [c[0], new TextEncoder().encode(c[1])]);
    const out = new Uint8Array(all.reduce((n, [, text]) => n + 8 + text.length, 12));
    const view = new DataView(out.buffer);
    [0x46546c67, 2, out.length].forEach((v, i) => view.setUint32(4 * i, v, true));
    let at = 12;
    for (const [type, text] of all) {
      view.setUint32(at, text.length, true);
      view.setUint32(at + 4, type, true);
      out.set(text, at + 8);
      at += 8 + text.length;
    }
    return out;
  }
  it('a GLB whose JSON loaders may read otherwise is refused', () => {
    const nice = '{"buffers":[{"byteLength":1}]}';
    const evil = '{"buffers":[{"uri":"http://evil.example/"}]}';
    requireSelfContained(glb(nice, [binChunk, 'bytes']));
    for (const chunks of [[nice, evil], [[1, nice], evil], [nice, [binChunk, 'a'], evil], [nice, [1, 'a']], [[binChunk, 'a'], nice]])
      expect(() => requireSelfContained(glb(...(chunks as string[])))).toThrow(FormatError);
    for (const name of ['buffers', 'images'])
      for (const list of [{ 0: { uri: 'http://evil.example/' } }, [null], 'http://evil.example/', [{ uri: ['data:'] }], [{ uri: null }]])
        expect(() => requireSelfContained(glb(JSON.stringify({ [name]: list })))).toThrow(FormatError);
    const [longer, shorter] = [glb(nice), glb(nice)]; // than the file says it is
    new DataView(longer.buffer).setUint32(8, longer.length + 4, true);
    new DataView(shorter.buffer).setUint32(8, shorter.length - 4, true);
    for (const bad of [longer, shorter]) expect(() => requireSelfContained(bad)).toThrow(FormatError);
  });
  it('a GLB with pictures larger than previews is refused', () => {
    const withPicture = (side: number, view: object = {}, image: object = {}): Uint8Array => {
      const bufferViews = [{ buffer: 0, byteLength: 12, ...view }];
      const out = glb(JSON.stringify({ buffers: [{ byteLength: 12 }], bufferViews, images: [{ bufferView: 0, ...image }] }), [binChunk, ' '.repeat(12)]);
      out.set([0xff, 0xd8, 0xff, 0xc0, 0, 17, 8, side >> 8, side & 255, side >> 8, side & 255, 3], out.length - 12);
      return out;
    };
    requireSelfContained(withPicture(4096));
    // Previews with coverage are PNG.
    const withPng = (width: number, height: number): Uint8Array => {
      const bufferViews = [{ buffer: 0, byteLength: 24 }];
      const out = glb(JSON.stringify({ buffers: [{ byteLength: 24 }], bufferViews, images: [{ bufferView: 0, mimeType: 'image/png' }] }), [binChunk, ' '.repeat(24)]);
      out.set([0x89, 0x50, 0x4e, 0x47, 13, 10, 26, 10, 0, 0, 0, 13, 0x49, 0x48, 0x44, 0x52], out.length - 24);
      new DataView(out.buffer).setUint32(out.length - 8, width);
      new DataView(out.buffer).setUint32(out.length - 4, height);
      return out;
    };
    requireSelfContained(withPng(4096, 1));
    for (const [w, h] of [[4097, 1], [1, 4097], [0, 8], [8, 0], [0x80000001, 8], [65536 * 4, 8]]) expect(() => requireSelfContained(withPng(w, h))).toThrow(FormatError);
    for (const bad of [
      withPicture(4097), withPicture(0), withPicture(65535), withPicture(64, { byteLength: 6 }), withPicture(64, { byteOffset: 1 }), withPicture(64, { buffer: 1 }),
      withPicture(64, { byteOffset: -12 }), withPicture(64, { extensions: {} }), withPicture(64, {}, { bufferView: 1 }), withPicture(64, {}, { bufferView: undefined }),
    ])
      expect(() => requireSelfContained(bad)).toThrow(FormatError);
  });
  it('a GLB that names other hosts is refused', async () => {
    for (const uri of ['http://evil.example/x.png', '//evil.example/x', 'x.bin', 'blob:y', 'data:image/png;base64,']) {
      for (const name of ['images', 'buffers'])
        expect(() => requireSelfContained(glb(JSON.stringify({ [name]: [{}, { uri }] })))).toThrow(FormatError);
    }
    requireSelfContained(glb(JSON.stringify({ images: [], buffers: [{ byteLength: 3 }] })));
    const whole = glb('{}');
    for (let n = 0; n < whole.length; ++n) expect(() => requireSelfContained(whole.subarray(0, n))).toThrow(FormatError);
    expect(() => requireSelfContained(glb('{"images":'))).toThrow(FormatError);
    const reader = await PackageReader.openBytes(container, 'golden');
    for (const { scale } of reader.manifest.scales) requireSelfContained(await reader.scaleGlb(scale));
  });
});

describe('a load', () => {
  const options = { renderer: {}, gltfLoader: () => { throw new Error('not asked for here'); } } as unknown as LoadOptions;
  const pkg = async (server: FakeServer): Promise<TexmeshPackage> => TexmeshPackage.openUrl(url, { fetch: server.fetch, ...quick });
  it('takes every policy by its names, and no other', async () => {
    const opened = await pkg(range());
    for (const policy of ['guard', 'htc', 'htca', 'price', 'proportional', 'static', undefined] as const)
      opened.load(new Scene(), { ...options, policy }).dispose();
    expect(() => opened.load(new Scene(), { ...options, policy: 'foo' as 'htc' })).toThrow(InputError);
  });
  it('takes no option that is none', async () => {
    const opened = await pkg(range());
    const good = { order: 'finest', rule: 'edge', meshes: 'auto', time: Infinity, display: 0 } as const;
    opened.load(new Scene(), { ...options, ...good }).dispose();
    for (const bad of [{ order: 'foo' }, { rule: 'foo' }, { meshes: '' }, { time: NaN }, { time: 'soon' }, { display: NaN }, { display: -5 }])
      expect(() => opened.load(new Scene(), { ...options, ...(bad as Partial<LoadOptions>) })).toThrow(InputError);
  });
  it('takes whole numbers for scale and rung', async () => {
    const opened = await pkg(range());
    for (const v of [1.5, -1, NaN, Infinity, '1' as unknown as number])
      for (const name of ['scale', 'rung']) expect(() => opened.load(new Scene(), { ...options, [name]: v })).toThrow(InputError);
    const model = opened.load(new Scene(), { ...options, rung: 99, scale: 0 });
    expect(() => model.setOverride({ rung: 0.5 })).toThrow(InputError);
    model.setOverride({});
    model.dispose();
  });
  it('that was cancelled before it began asks for nothing', async () => {
    const server = range();
    const opened = await pkg(server);
    const model = opened.load(new Scene(), { ...options, signal: AbortSignal.abort() });
    expect((await rejection(model.done)).name).toBe('AbortError');
    expect(model.state.phase).toBe('cancelled');
    expect(server.log.length).toBe(1);
  });
  it('that was disposed of is forgotten, and listens to no signal', async () => {
    const opened = await pkg(range());
    const { signal } = new AbortController();
    let listeners = 0;
    const [add, remove] = [signal.addEventListener.bind(signal), signal.removeEventListener.bind(signal)];
    signal.addEventListener = (...a: Parameters<typeof add>) => (++listeners, add(...a));
    signal.removeEventListener = (...a: Parameters<typeof remove>) => (--listeners, remove(...a));
    const model = opened.load(new Scene(), { ...options, signal });
    model.dispose();
    await rejection(model.done);
    expect(listeners).toBe(0);
    expect((opened as unknown as { loads_: Set<unknown> }).loads_.size).toBe(0);
  });
});

it('a cap does not hold back who cancels', async () => {
  const abort = new AbortController();
  const begin = performance.now();
  const opening = openAt(range(), { capBytesS: 100, signal: abort.signal });
  setTimeout(() => abort.abort(), 20);
  expect((await rejection(opening)).name).toBe('AbortError');
  expect(performance.now() - begin).toBeLessThan(3000);
});

it('pictures that nobody waits for are closed, and streams are told of their end', async () => {
  let closed = 0;
  const heard: WorkerRequest['op'][] = [];
  const pool = new WorkerPool({
    decode: async (request) => {
      heard.push(request.op);
      await new Promise((go) => setTimeout(go, 5));
      return [[{ close: () => ++closed }], []];
    },
  });
  const none = new Uint8Array(0);
  const decoding = rejection(pool.decode({ codec: 'jpeg', tables: none, streams: [none], digests: [], complete: true, levels: 1, most: [9, 9] }));
  pool.closeSplits(3);
  await Promise.resolve();
  pool.dispose();
  expect((await decoding).name).toBe('AbortError');
  await new Promise((go) => setTimeout(go, 20));
  expect(closed).toBeGreaterThan(0);
  expect(heard).toContain('split-close');
});

describe('pictures', () => {
  it('say how large they are before they are decoded', async () => {
    const reader = await PackageReader.openBytes(container, 'golden');
    const [info] = await reader.textures();
    for (const f of (await reader.planeTables(0)).order.slice(0, 8)) {
      const [w, h] = imageSize(await reader.completeFragment(0, 0, f));
      expect(w > 0 && w <= info.fragmentWidthPx && h > 0 && h <= info.fragmentHeightPx).toBe(true);
    }
    const riff = (kind: string, at: number, data: number[]): Uint8Array => {
      const b = new Uint8Array(40);
      b.set(new TextEncoder().encode(`RIFF    WEBP${kind}`));
      b.set(data, at);
      return b;
    };
    expect(imageSize(riff('VP8 ', 26, [0x80, 0, 0x40, 1]))).toEqual([128, 320]);
    expect(imageSize(riff('VP8L', 20, [0x2f, 0x7f, 0xc0, 0x4f, 0]))).toEqual([128, 320]);
    expect(imageSize(riff('VP8X', 24, [0x7f, 0, 0, 0x3f, 1, 0]))).toEqual([128, 320]);
    const png = (name: string): Uint8Array => Uint8Array.from([0x89, ...new TextEncoder().encode(`PNG\r\n\x1a\n\0\0\0\r${name}`), 0, 0, 1, 64, 0, 1, 0, 2, 8, 6]);
    expect(imageSize(png('IHDR'))).toEqual([320, 65538]);
    expect(imageSize(png('tEXt'))).toEqual([0, 0]); // no decoder takes what does not begin with it
    for (let n = 0; n < 20; ++n) expect(Math.min(...imageSize(png('IHDR').subarray(0, n)))).toBe(0);
    // Markers that have no length, behind which decoders find another frame than readers who think that they have one.
    const frame = [0xff, 0xc0, 0, 17, 8, 0, 16, 0, 16, 3];
    expect(imageSize(Uint8Array.from([0xff, 0xd8, ...frame]))).toEqual([16, 16]);
    for (const marker of [0x01, 0xd0, 0xd7, 0xd8, 0xd9])
      expect(imageSize(Uint8Array.from([0xff, 0xd8, 0xff, marker, 0, 4, 0, 0, ...frame]))).toEqual([0, 0]);
    expect(imageSize(Uint8Array.from([0xff, 0xd8, 0xff, 0xe0, 0, 1, 0, ...frame]))).toEqual([0, 0]);
    for (const none of [[], [0xff], [0xff, 0xd8], [0xff, 0xd8, 0xff, 0xe0, 0, 0], [1, 2, 3]]) expect(imageSize(Uint8Array.from(none))).toEqual([0, 0]);
  });
  it('that are larger than their fragment are refused', async () => {
    const bomb = Uint8Array.from([0xff, 0xd8, 0xff, 0xc0, 0, 17, 8, 0xff, 0xff, 0xff, 0xff, 3]);
    expect(imageSize(bomb)).toEqual([65535, 65535]);
    const none = new Uint8Array(0);
    const request = { op: 'decode', codec: 'jpeg', tables: none, streams: [bomb], digests: [], complete: true, levels: 1, most: [128, 128] } as const;
    expect(await rejection(handle(request as unknown as WorkerRequest))).toBeInstanceOf(FormatError);
  });
});

it('a worker that breaks is replaced once, then there are none', async () => {
  const started: Broken[] = [];
  class Broken {
    onerror?: (e: { preventDefault(): void }) => void;
    onmessage?: (e: { data: unknown }) => void;
    posted = 0;
    constructor() {
      started.push(this);
    }
    postMessage(): void {
      ++this.posted;
    }
    terminate(): void {}
  }
  const before = Object.getOwnPropertyDescriptor(globalThis, 'Worker');
  Object.defineProperty(globalThis, 'Worker', { value: Broken, configurable: true });
  try {
    const pool = new WorkerPool({ workers: 1 });
    const job = rejection(pool.openSplits(1, new Uint8Array(4)));
    started[0].onerror!({ preventDefault: () => undefined });
    expect(started.map((w) => w.posted)).toEqual([1, 1]);
    started[1].onerror!({ preventDefault: () => undefined });
    expect((await job).message).toContain('decode');
    expect(started.length).toBe(2);
    // One that has worked does not make all useless: what it broke on fails, and another takes its place.
    const other = new WorkerPool({ workers: 1 });
    const fine = other.openSplits(1, new Uint8Array(4));
    started[2].onmessage!({ data: { id: 1, result: 7 } });
    expect(await fine).toBe(7);
    const lost = rejection(other.openSplits(2, new Uint8Array(4)));
    for (const k of [2, 3]) started[k].onerror!({ preventDefault: () => undefined });
    expect((await lost).message).toContain('broke');
    expect(started.length).toBe(5);
  } finally {
    if (before) Object.defineProperty(globalThis, 'Worker', before);
    else Reflect.deleteProperty(globalThis, 'Worker');
  }
});

describe('documents', () => {
  /** As a worker would: what is asked and answered is copied. */
  const elsewhere = (heard: WorkerRequest['op'][]): WorkerPool =>
    new WorkerPool({
      decode: async (request) => {
        heard.push(request.op);
        const [result, transfer] = await handle(structuredClone(request));
        return [structuredClone(result, { transfer }), []];
      },
    });
  it('say the same when workers decode them', async () => {
    const heard: WorkerRequest['op'][] = [];
    const [here, there] = [await openAt(range()), await openAt(range())];
    there.decodeDocument = elsewhere(heard).decodeDocument;
    expect(await there.data()).toEqual(await here.data());
    expect(await there.quality()).toEqual(await here.quality());
    expect(await there.planeFiles(1)).toEqual(await here.planeFiles(1));
    expect(heard.length).toBeGreaterThan(4);
    expect(new Set(heard)).toEqual(new Set(['document']));
  });
  it('are decoded here where workers cannot, or have ended', async () => {
    const pools = [new WorkerPool({ decode: () => Promise.reject(new Error('broken')) }), new WorkerPool({ decode: handle }), new WorkerPool()];
    pools[1].dispose();
    for (const pool of pools) {
      const reader = await openAt(range());
      reader.decodeDocument = pool.decodeDocument;
      expect((await reader.data()).tables.length).toBe(reader.manifest.planeCount);
    }
  });
  it('are decoded here where workers do not answer, from the manifest on', async () => {
    const silent = new WorkerPool({ decode: () => new Promise(() => undefined) });
    const reader = await PackageReader.openUrl(url, { fetch: range().fetch, ...quick }, silent.decodeDocument);
    expect((await reader.data()).tables.length).toBe(reader.manifest.planeCount);
    silent.dispose();
  });
  it('that are damaged are told, and not decoded twice', async () => {
    const heard: WorkerRequest['op'][] = [];
    const { decodeDocument } = elsewhere(heard);
    const { manifest } = await PackageReader.openBytes(container, 'golden');
    const bytes = container.slice(manifest.textures.offset, manifest.textures.offset + manifest.textures.bytes);
    expect((await decodeDocument('textures', bytes, manifest)).length).toBe(manifest.planeCount);
    expect(await rejection(decodeDocument('textures', bytes, { ...manifest, planeCount: 99 }))).toBeInstanceOf(FormatError);
    const damaged = bytes.slice();
    damaged[0] ^= 1;
    const forged = await openAt(range());
    forged.decodeDocument = (name, ...args) => decodeDocument(name, ...(args.map((a) => (a instanceof Uint8Array ? damaged : a)) as typeof args));
    heard.length = 0;
    expect(await rejection(forged.textures())).toBeInstanceOf(FormatError);
    expect(heard).toEqual(['document']);
  });
  it('and pictures of all loads of a page have their turns one after the other', async () => {
    let [now, most, all] = [0, 0, 0];
    let letGo: (() => void)[] = [];
    const decode = async (): Promise<[unknown, Transferable[]]> => {
      ++all;
      most = Math.max(most, ++now);
      await new Promise<void>((go) => letGo.push(go));
      --now;
      return [[], []];
    };
    const none = new Uint8Array(0);
    const pools = [0, 1, 2].map(() => new WorkerPool({ decode }));
    const ended = [0, 0, 0];
    const jobs = pools.map((pool, p) => Array.from({ length: 10 }, () =>
      pool.decode({ codec: 'jpeg', tables: none, streams: [], digests: [], complete: true, levels: 1, most: [9, 9] }).then(() => ++ended[p], () => -1)));
    const settle = (): Promise<void> => new Promise((go) => setTimeout(go, 2));
    await settle();
    expect([now, all, ...pools.map((p) => p.pending())]).toEqual([8, 8, 10, 10, 10]);
    pools[0].dispose(); // what it had under way and what waits makes room
    expect(await Promise.all(jobs[0])).toEqual(Array(10).fill(-1));
    await settle();
    expect([all, ...pools.map((p) => p.pending())]).toEqual([16, 0, 10, 10]);
    most = now = 8; // those of the first are nobody's any more
    letGo = letGo.slice(8);
    while (ended[1] + ended[2] < 20) {
      letGo.splice(0).forEach((go) => go());
      await settle();
    }
    expect([most, now, all, ...ended]).toEqual([8, 0, 28, 0, 10, 10]);
    pools.forEach((pool) => pool.dispose());
  });
  it('do not wait behind pictures', async () => {
    const posted: WorkerRequest['op'][] = [];
    const pool = new WorkerPool({
      decode: (request) => {
        posted.push(request.op);
        return new Promise(() => undefined);
      },
    });
    const none = new Uint8Array(0);
    for (let i = 0; i < 30; ++i)
      void pool.decode({ codec: 'jpeg', tables: none, streams: [], digests: [], complete: true, levels: 1, most: [9, 9] }).catch(() => undefined);
    void pool.decodeDocument('quality', none).catch(() => undefined);
    await new Promise((go) => setTimeout(go, 5));
    expect(posted.length).toBeLessThan(30);
    expect(posted).toContain('document');
    pool.dispose();
  });
});
