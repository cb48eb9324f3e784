import { describe, expect, it } from 'vitest';
import type { TextureInfo } from '../../src/format/textures';
import { PackageReader } from '../../src/http/package_reader';
import { Transfers, Wish } from '../../src/scene/transfers';
import { WorkerPool } from '../../src/worker/pool';
import type { WorkerRequest } from '../../src/worker/protocol';
import { bytesAskedTwice } from '../support/fake_server';
import { turns } from '../support/scan';
import { decode, setUp, url, wishesOf } from '../support/transferring';

describe('transfers', () => {
  it('neighbours of a rung share a request, nothing comes twice', async () => {
    const s = await setUp();
    const before = s.server.log.length;
    const arrived: Wish[] = [];
    const wishes = wishesOf(s.list, 0);
    await s.transfers.fetch(wishes, { gapBytes: 0, mostBytes: Infinity }, (w) => arrived.push(w),
      () => undefined);
    await s.settled();
    expect(arrived.length).toBe(wishes.length);
    expect(s.decoded.length).toBe(wishes.length);
    const packs = s.server.log.length - before;
    expect(packs).toBeLessThanOrEqual(2 * 3); // a rung of three planes, and what decodes them
    expect(bytesAskedTwice(s.server.log, url)).toBe(0);
  });
  it('requests are no longer than asked for', async () => {
    const s = await setUp();
    const before = s.server.log.length;
    await s.transfers.fetch(wishesOf(s.list, 0), { gapBytes: 0, mostBytes: 2000 }, () => undefined,
      () => undefined);
    for (const { range } of s.server.log.slice(before)) if (range)
      expect(range[1] - range[0]).toBeLessThan(5000);
  });
  it('a damaged fragment is asked for once more, by itself', async () => {
    let first = true;
    const s = await setUp(({ range }) => {
      if (!range || range[0] < 40000 || !first) return false;
      first = false;
      return 'flip';
    });
    const wishes = wishesOf(s.list, 0).slice(0, 8);
    await s.transfers.fetch(wishes, { gapBytes: 0, mostBytes: Infinity }, () => undefined, () => undefined);
    await s.settled();
    expect(s.decoded.length).toBe(8);
    expect(s.lost.length).toBe(0);
  });
  it('a request that fails for good fails its fragments only', async () => {
    const s = await setUp();
    const [pack] = s.transfers.filesOf(0).packs;
    const t = await setUp(({ range }) => range !== undefined && range[0] >= pack.offset &&
      range[0] < pack.offset + pack.bytes && 'status-404');
    const failed: Wish[] = [];
    const wishes = wishesOf(t.list, 0);
    await t.transfers.fetch(wishes, { gapBytes: 0, mostBytes: Infinity }, () => undefined,
      (w) => failed.push(w));
    await t.settled();
    expect(failed.length).toBeGreaterThan(0);
    expect(failed.every((w) => w.plane === 0)).toBe(true);
    expect(t.decoded.length).toBe(wishes.length - failed.length);
  });
  it('no picture may be much larger than its plane, whatever is said of fragments', async () => {
    const s = await setUp();
    const most: number[] = [];
    const watch = async (request: WorkerRequest): Promise<[unknown, Transferable[]]> => {
      if (request.op === 'decode') most.push(...request.most);
      return decode(request);
    };
    const textures =
      s.data.textures.map((t) => ({ ...t, fragmentWidthPx: 1 << 20, fragmentHeightPx: 1 << 20 }));
    const transfers = new Transfers(s.reader, textures, new WorkerPool({ decode: watch }),
      { decoded: () => undefined, lost: () => undefined });
    await transfers.prepare([0]);
    await transfers.fetch(wishesOf(s.list, 0).slice(0, 1), { gapBytes: 0, mostBytes: Infinity },
      () => undefined, () => undefined);
    while (transfers.pending > 0) await new Promise((go) => setTimeout(go, 1));
    expect(most.length).toBe(2);
    expect(Math.max(...most)).toBeLessThan(2048);
  });
  it('cancelling fails what is under way', async () => {
    const s = await setUp();
    const abort = new AbortController();
    const failed: Wish[] = [];
    const done = s.transfers.fetch(wishesOf(s.list, 2),
      { gapBytes: 0, mostBytes: 3000, signal: abort.signal }, () => undefined, (w) => failed.push(w));
    abort.abort();
    await done;
    expect(failed.length).toBe(s.list.offers.length);
  });
});

describe('streams of several rungs', () => {
  /** One fragment of two rungs that follow each other; reads end when the test says so. */
  async function twoRungs() {
    const tables = { columns: 1, rows: 1, incremental: true, rungQuality: Uint8Array.of(20, 80),
      sizeBytes: Uint32Array.of(100, 50), digest: new Uint8Array(16) };
    const reads: { onBytes(n: number): void; done(bytes: Uint8Array): void;
      failed(error: Error): void }[] = [];
    const store = {
      read: (...args: unknown[]) =>
        new Promise<Uint8Array>((done, failed) =>
          reads.push({ onBytes: (args.at(-1) as { onBytes(n: number): void }).onBytes, done, failed })),
    };
    const reader = {
      form: 'range', store,
      planeFiles: () => Promise.resolve({ tables, offsets: new Float64Array(2),
        packs: [0, 1].map(() => ({ path: 'pack', offset: 0, bytes: 100 })) }),
      tableStream: () => Promise.resolve(new Uint8Array(1)),
    } as unknown as PackageReader;
    const asked: number[][] = [];
    const decode = async (request: WorkerRequest): Promise<[unknown, Transferable[]]> => {
      if (request.op === 'decode') asked.push(Array.from(request.streams, (s) => s?.length ?? -1));
      return [[], []];
    };
    const heard: string[] = [];
    const info = { codec: 'jpeg-progressive', fragmentWidthPx: 16, fragmentHeightPx: 16, widthPx: 16,
      heightPx: 16 } as unknown as TextureInfo;
    const transfers = new Transfers(reader, [info], new WorkerPool({ decode }), {
      decoded: () => void heard.push('decoded'),
      lost: () => void heard.push('lost'),
    });
    await transfers.prepare([0]);
    const wish: Wish = { plane: 0, fragment: 0, rung: 1, offer: 0 };
    const run = transfers.fetch([wish], { gapBytes: 0, mostBytes: Infinity }, () => heard.push('arrived'),
      () => heard.push('failed'));
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
