import { describe, expect, it } from 'vitest';
import type { Manifest } from '../../src/format/manifest';
import { WorkerPool } from '../../src/worker/pool';
import type { WorkerRequest } from '../../src/worker/protocol';
import { rejection, turns } from '../support/scan';
import { withWorkers } from '../support/workers';

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
  const decoding = rejection(pool.decode({ codec: 'jpeg', tables: none, streams: [none], digests: [],
    complete: true, levels: 1, most: [9, 9] }));
  pool.closeSplits(3);
  await Promise.resolve();
  pool.dispose();
  expect((await decoding).name).toBe('AbortError');
  await new Promise((go) => setTimeout(go, 20));
  expect(closed).toBeGreaterThan(0);
  expect(heard).toContain('split-close');
});

/** A pool whose jobs end one after the other, in the order in which they have begun. */
function slowPool(): { begun: string[]; decode: () => Promise<unknown>; enlarge: () => Promise<unknown>;
    end: (all: Promise<unknown>[]) => Promise<void> } {
  const begun: string[] = [];
  const letGo: (() => void)[] = [];
  const pool = new WorkerPool({
    decode: async ({ op }) => {
      begun.push(op);
      await new Promise<void>((go) => letGo.push(go));
      return [[], []];
    },
  });
  const none = new Uint8Array(0);
  return {
    begun,
    decode: () => pool.decode({ codec: 'jpeg', tables: none, streams: [none], digests: [], complete: true,
      levels: 1, most: [9, 9] }),
    enlarge: () => pool.enlarge({ picture: {} as ImageBitmap, width: 8, height: 8, x0: 0, x1: 8, y0: 0, y1: 8,
      levels: 1 }),
    end: async (all) => {
      await turns(5);
      for (; letGo.length > 0; await turns(5)) letGo.shift()!();
      await Promise.all(all);
      pool.dispose();
    },
  };
}

it('previews are enlarged when no fragment waits', async () => {
  const { begun, decode, enlarge, end } = slowPool();
  await end([...Array.from({ length: 12 }, enlarge), ...Array.from({ length: 4 }, decode)]);
  // eight were under way; one turn of four is the eldest's
  expect(begun.slice(8, 13).filter((op) => op === 'decode').length).toBe(4);
});

it('an enlarged preview does not wait for ever behind fragments', async () => {
  const { begun, decode, enlarge, end } = slowPool();
  await end([...Array.from({ length: 8 }, decode), enlarge(), ...Array.from({ length: 40 }, decode)]);
  expect(begun.length).toBe(49);
  expect(begun.indexOf('enlarge')).toBeLessThan(13);
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
      pool.decode({ codec: 'jpeg', tables: none, streams: [], digests: [], complete: true, levels: 1,
        most: [9, 9] }).then(() => ++ended[p], () => -1)));
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
      void pool.decode({ codec: 'jpeg', tables: none, streams: [], digests: [], complete: true, levels: 1,
        most: [9, 9] }).catch(() => undefined);
    void pool.decodeDocument('textures', none, {} as Manifest).catch(() => undefined);
    await new Promise((go) => setTimeout(go, 5));
    expect(posted.length).toBeLessThan(30);
    expect(posted).toContain('document');
    pool.dispose();
  });
});

it('workers are sent the bytes that they need, not the package that they lie in', async () => {
  const sent: WorkerRequest[] = [];
  const pool = new WorkerPool({ decode: async (request) => (sent.push(request), [[], []]) });
  const whole = Uint8Array.from({ length: 1000 }, (_, i) => i & 255);
  const [tables, stream] = [whole.subarray(0, 10), whole.subarray(500, 540)];
  await pool.decode({ codec: 'jpeg', tables, streams: [stream, whole], digests: [], complete: false,
    levels: 1, most: [9, 9] });
  await pool.addSplits(1, stream);
  const [decode, splits] = sent as [WorkerRequest & { op: 'decode' }, WorkerRequest & { op: 'split-add' }];
  for (const [found, expected] of [[decode.tables, tables], [decode.streams[0], stream],
        [splits.blocks, stream]]) {
    expect(found).toEqual(expected);
    expect(found.buffer.byteLength).toBe(expected.length);
  }
  expect(decode.streams[1]).toBe(whole); // nothing to copy
  pool.dispose();
});

describe('workers that break', () => {
  const worker = () => ({
    posted: [] as number[],
    onerror: undefined as ((e: { preventDefault(): void }) => void) | undefined,
    onmessage: undefined as ((e: { data: unknown }) => void) | undefined,
    postMessage({ id }: { id: number }): void {
      this.posted.push(id);
    },
    terminate: () => undefined,
    break(): void {
      this.onerror!({ preventDefault: () => undefined });
    },
  });
  const picture = { codec: 'jpeg', tables: new Uint8Array(0), streams: [], digests: [], complete: true,
    levels: 1, most: [9, 9] } as const;
  const asked = () => ({ ...picture, streams: [], digests: [], most: [9, 9] as [number, number] });
  it('cost what they had under way, not what waited for its turn', () => withWorkers(worker, async (all) => {
    const pool = new WorkerPool({ workers: 1 });
    const ends = Array.from({ length: 20 },
      () => pool.decode(asked()).then(() => 'done', (error: Error) => error.message));
    expect(all[0].posted.length).toBe(8);
    all[0].onmessage!({ data: { id: all[0].posted[0], result: [] } }); // it works
    await turns();
    all[0].break();
    all[1].break();
    await turns();
    // Eight more have their turn, at the third worker.
    expect(all[2].posted.length).toBe(8);
    for (let n = 0; n < all[2].posted.length; ++n)
      all[2].onmessage!({ data: { id: all[2].posted[n], result: [] } });
    await turns();
    for (let n = 0; n < all[2].posted.length; ++n)
      all[2].onmessage!({ data: { id: all[2].posted[n], result: [] } });
    const said = await Promise.all(ends);
    expect(said.filter((s) => s === 'a worker broke').length).toBe(8);
    expect(said.filter((s) => s === 'done').length).toBe(12);
    pool.dispose();
  }));
  it('one after the other, before any has worked: there are none', () => withWorkers(worker, async (all) => {
    const pool = new WorkerPool({ workers: 2 });
    const told: string[] = [];
    pool.onUnavailable = (error) => told.push(error.message);
    const ends = [0, 1].map(() => pool.decode(asked()).then(() => 'done', (error: Error) => error.message));
    for (const k of [0, 2, 1, 3]) {
      all[k].break();
      await turns();
    }
    expect((await Promise.all(ends)).every((message) => message.includes('texmesh/worker'))).toBe(true);
    expect([told.length, pool.isUnavailable, all.length]).toEqual([1, true, 4]);
    pool.dispose();
  }));
});
