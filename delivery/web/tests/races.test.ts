import { describe, expect, it } from 'vitest';
import { FormatError } from '../src/format/errors';
import { open } from '../src/open';
import { PackageReader } from '../src/http/package_reader';
import type { TextureInfo } from '../src/format/textures';
import { Transfers, Wish } from '../src/scene/transfers';
import { WorkerPool } from '../src/worker/pool';
import { handle } from '../src/worker';
import type { WorkerRequest } from '../src/worker/protocol';
import { fakeServer } from './fake_server';
import { loading, until } from './loading';
import { golden } from './support';

const container = golden('v1.1-scan');
const url = 'http://host/a/scan.texmesh';
const files = { '/a/scan.texmesh': container };
const turns = (ms = 5): Promise<void> => new Promise((go) => setTimeout(go, ms));

describe('streams of several rungs', () => {
  /** One fragment of two rungs that follow each other; reads end when the test says so. */
  async function twoRungs() {
    const tables = { columns: 1, rows: 1, incremental: true, rungQuality: Uint8Array.of(20, 80), sizeBytes: Uint32Array.of(100, 50), digest: new Uint8Array(16) };
    const reads: { onBytes(n: number): void; done(bytes: Uint8Array): void; failed(error: Error): void }[] = [];
    const store = {
      read: (...args: unknown[]) =>
        new Promise<Uint8Array>((done, failed) => reads.push({ onBytes: (args.at(-1) as { onBytes(n: number): void }).onBytes, done, failed })),
    };
    const reader = {
      form: 'range', store,
      planeFiles: () => Promise.resolve({ tables, offsets: new Float64Array(2), packs: [0, 1].map(() => ({ path: 'pack', offset: 0, bytes: 100 })) }),
      tableStream: () => Promise.resolve(new Uint8Array(1)),
    } as unknown as PackageReader;
    const asked: number[][] = [];
    const decode = async (request: WorkerRequest): Promise<[unknown, Transferable[]]> => {
      if (request.op === 'decode') asked.push(Array.from(request.streams, (s) => s?.length ?? -1));
      return [[], []];
    };
    const heard: string[] = [];
    const info = { codec: 'jpeg-progressive', fragmentWidthPx: 16, fragmentHeightPx: 16, widthPx: 16, heightPx: 16 } as unknown as TextureInfo;
    const transfers = new Transfers(reader, [info], new WorkerPool({ decode }), {
      decoded: () => void heard.push('decoded'),
      lost: () => void heard.push('lost'),
    });
    await transfers.prepare([0]);
    const wish: Wish = { plane: 0, fragment: 0, rung: 1, offer: 0 };
    const run = transfers.fetch([wish], { gapBytes: 0, mostBytes: Infinity }, () => heard.push('arrived'), () => heard.push('failed'));
    return { reads, asked, heard, run, transfers };
  }
  it('are decoded once, when the last request has ended', async () => {
    const t = await twoRungs();
    expect(t.reads.length).toBe(2);
    t.reads[1].onBytes(50); // all its bytes are there, but the answer has not ended
    t.reads[0].done(new Uint8Array(100));
    await turns();
    expect([t.heard, t.asked]).toEqual([['arrived'], []]);
    t.reads[1].done(new Uint8Array(50));
    await t.run;
    await turns();
    expect([t.heard, t.asked]).toEqual([['arrived', 'decoded'], [[100, 50]]]);
    expect(t.transfers.pending).toBe(0);
  });
  it('are lost once, where what had arrived does not end well', async () => {
    const t = await twoRungs();
    t.reads[1].onBytes(50);
    t.reads[0].done(new Uint8Array(100));
    await turns();
    t.reads[1].failed(new Error('cut'));
    await t.run;
    await turns();
    expect([t.heard, t.asked]).toEqual([['arrived', 'lost'], []]);
  });
  it('that have failed do not arrive later', async () => {
    const t = await twoRungs();
    t.reads[0].onBytes(100);
    t.reads[0].failed(new Error('cut'));
    await turns();
    t.reads[1].done(new Uint8Array(50));
    await t.run;
    await turns();
    expect([t.heard, t.asked]).toEqual([['failed'], []]);
  });
  it('fail once, where both requests do', async () => {
    const t = await twoRungs();
    t.reads[0].failed(new Error('cut'));
    t.reads[1].failed(new Error('cut'));
    await t.run;
    expect([t.heard, t.asked]).toEqual([['failed'], []]);
  });
});

describe('open() that is cancelled while the manifest is decoded', () => {
  it('ends though the worker does not answer', async () => {
    const abort = new AbortController();
    const asked: string[] = [];
    const decode = (request: WorkerRequest): Promise<never> => {
      asked.push(request.op);
      return new Promise(() => undefined);
    };
    const opening = open(url, { fetch: fakeServer(files).fetch, signal: abort.signal, decode }).then(() => 'opened', (error: Error) => error.name);
    expect(await until(() => asked.length > 0)).toBe(true);
    abort.abort();
    expect(await Promise.race([opening, turns(500).then(() => 'still waits')])).toBe('AbortError');
  });
  it('gives no package, though the worker answers', async () => {
    const abort = new AbortController();
    const decode = (request: WorkerRequest): ReturnType<typeof handle> => {
      abort.abort();
      return handle(request);
    };
    const opening = open(url, { fetch: fakeServer(files).fetch, signal: abort.signal, decode }).then(() => 'opened', (error: Error) => error.name);
    expect(await opening).toBe('AbortError');
  });
});

it('who gives up an override in the timed part does not ask for everything', async () => {
  const server = fakeServer(files);
  const l = await loading(url, server, { rung: 0, time: 5, autoRefine: false });
  expect(await until(() => l.pkg.requests.some((q) => q.kind === 'texture'))).toBe(true);
  l.model.setOverride({});
  let inTime = -1;
  l.model.on('deadline', () => (inTime = Math.max(...l.model.state.planes.flatMap((p) => [...p.rungs]))));
  await l.model.done;
  expect(inTime).toBe(0);
  l.dispose();
});

it('who cancels while a document is decoded has no other thread decode it', async () => {
  const reader = await PackageReader.openUrl(url, { fetch: fakeServer(files).fetch });
  const abort = new AbortController();
  let here = 0;
  const textures = reader.textures.bind(reader);
  reader.decodeDocument = () => {
    abort.abort();
    reader.decodeDocument = (() => ++here) as never;
    return Promise.reject(new Error('a worker broke'));
  };
  await expect(textures(abort.signal)).rejects.toThrow();
  expect(here).toBe(0);
});

it('bytes are told as they come, over a cut and what is known already', async () => {
  for (const offset of [20000, 10000]) {
    const server = fakeServer(files, { fault: ({ number }) => number === 1 && 'cut' });
    const reader = await PackageReader.openUrl(url, { fetch: server.fetch, retryDelayS: 0.001 });
    const told: number[] = [];
    const range = { offset, bytes: 30000 };
    const got = await reader.store.read({ path: 'x', ...range }, range, { kind: 'other', onBytes: (n) => void told.push(n) });
    expect([...got]).toEqual([...container.subarray(offset, offset + 30000)]);
    expect(server.log.length).toBe(3); // the rest alone
    expect(told).toEqual([...told].sort((a, b) => a - b));
    const [from, to] = server.log[1].range!;
    expect(told.at(-1)).toBe(to - from + 1);
  }
});

it('what was damaged on the way is forgotten, and fetched again once', async () => {
  const server = fakeServer(files, { fault: ({ number }) => number === 1 && 'flip' });
  const reader = await PackageReader.openUrl(url, { fetch: server.fetch, retryDelayS: 0.001 });
  const range = { offset: 20000, bytes: 5000 };
  const place = { path: 'x', ...range };
  await reader.store.read(place, range, { kind: 'other' }); // nobody checks
  const verify = (got: Uint8Array): Promise<void> =>
    got.every((b, i) => b === container[20000 + i]) ? Promise.resolve() : Promise.reject(new FormatError('x', '', 'these bytes', 'others'));
  for (let n = 0; n < 2; ++n) await reader.store.read(place, range, { kind: 'other', verify, once: n === 0 });
  expect(server.log.length).toBeLessThanOrEqual(4);
  await reader.store.read(place, { offset: 20000, bytes: 5000 }, { kind: 'other', verify });
  expect(server.log.length).toBe(4); // once, for nobody; and once to be kept
});
