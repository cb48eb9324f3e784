import { describe, expect, it } from 'vitest';
import { WorkerPool } from '../../src/worker/pool';
import { SharedWorkers } from '../../src/worker/shared_workers';
import { rejection } from '../support/scan';
import { withWorkers } from '../support/workers';

class Fake {
  onmessage?: (e: { data: unknown }) => void;
  onerror?: (e: { preventDefault(): void }) => void;
  readonly posted: { id: number; op: string; key?: number }[] = [];
  ended = false;
  postMessage(request: { id: number; op: string; key?: number }): void {
    this.posted.push(request);
  }
  terminate(): void {
    this.ended = true;
  }
  answer(at: number, result: unknown): void {
    this.onmessage!({ data: { id: this.posted[at].id, result } });
  }
  break(): void {
    this.onerror!({ preventDefault: () => undefined });
  }
}
const head = new Uint8Array(4);

describe('shared workers', () => {
  it('are no more than was said, and answer the pool that asked', () =>
    withWorkers(() => new Fake(), async (workers) => {
      const shared = new SharedWorkers(2);
      const pools = Array.from({ length: 5 }, () => new WorkerPool({ workers: 3, shared }));
      expect(workers.length).toBe(2);
      const asked = pools.map((pool, i) => pool.openSplits(i, head));
      for (const worker of workers)
        worker.posted.forEach(({ key }, at) => worker.answer(at, `stream ${key}`));
      expect(await Promise.all(asked)).toEqual(['stream 0', 'stream 1', 'stream 2', 'stream 3', 'stream 4']);
      expect(workers.every((w) => w.posted.length > 1)).toBe(true); // pools begin with different ones
      for (const pool of pools) pool.dispose();
      expect(workers.some((w) => w.ended)).toBe(false);
      shared.dispose();
      expect(workers.every((w) => w.ended)).toBe(true);
    }));
  it('close pictures that come for a pool that is gone', () =>
    withWorkers(() => new Fake(), async (workers) => {
      const shared = new SharedWorkers(1);
      const pool = new WorkerPool({ workers: 1, shared });
      const lost = rejection(pool.decode({ codec: 'jpeg', tables: head, streams: [head], digests: [],
        complete: true, levels: 1, most: [1, 1] }));
      pool.dispose();
      expect((await lost).name).toBe('AbortError');
      let closed = 0;
      workers[0].answer(0, [{ close: () => ++closed }]);
      expect(closed).toBe(1);
    }));
  it('that break are replaced for all pools, whose requests are made once more', () =>
    withWorkers(() => new Fake(), async (workers) => {
      const shared = new SharedWorkers(1);
      const pools = [new WorkerPool({ workers: 1, shared }), new WorkerPool({ workers: 1, shared })];
      const asked = pools.map((pool, i) => pool.openSplits(i, head));
      expect(workers.length).toBe(1);
      workers[0].break();
      expect(workers.length).toBe(2);
      expect(workers[1].posted.map((p) => p.key)).toEqual([0, 1]);
      [0, 1].forEach((at) => workers[1].answer(at, at));
      expect(await Promise.all(asked)).toEqual([0, 1]);
    }));
  it('hear of streams that a pool leaves open, though all of them are busy', () =>
    withWorkers(() => new Fake(), async (workers) => {
      const shared = new SharedWorkers(1);
      const pool = new WorkerPool({ workers: 1, shared });
      const many = Array.from({ length: 20 }, (_, i) => rejection(pool.openSplits(i, head)));
      pool.closeSplits(3);
      expect(workers[0].posted.some((p) => p.op === 'split-close')).toBe(false); // it waits for its turn
      pool.dispose();
      expect(workers[0].posted.some((p) => p.op === 'split-close' && p.key === 3)).toBe(true);
      await Promise.all(many);
    }));
});
