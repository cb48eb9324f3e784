import { describe, expect, it } from 'vitest';
import { workerPool } from '../src/worker_pool';

const turns = (ms = 5): Promise<void> => new Promise((go) => setTimeout(go, ms));

/** Workers that do what a test says, instead of the browser's. */
async function withWorkers<T extends object>(made: (number: number) => T, body: (all: T[]) => Promise<void>): Promise<void> {
  const all: T[] = [];
  const before = Object.getOwnPropertyDescriptor(globalThis, 'Worker');
  const value = function (): T {
    return all[all.push(made(all.length)) - 1];
  };
  Object.defineProperty(globalThis, 'Worker', { value, configurable: true });
  try {
    await body(all);
  } finally {
    if (before) Object.defineProperty(globalThis, 'Worker', before);
    else Reflect.deleteProperty(globalThis, 'Worker');
  }
}

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
  const picture = { codec: 'jpeg', tables: new Uint8Array(0), complete: true, levels: 1 } as const;
  const asked = () => ({ ...picture, streams: [], digests: [], most: [9, 9] as [number, number] });
  it('one after the other, before any has worked: there are none', () => withWorkers(worker, async (all) => {
    const pool = workerPool({ workers: 2 });
    const told: string[] = [];
    pool.onNone = (error) => told.push(error.message);
    const ends = [0, 1].map(() => pool.decode(asked()).then(() => 'done', (error: Error) => error.message));
    for (const k of [0, 2, 1, 3]) {
      all[k].break();
      await turns();
    }
    expect((await Promise.all(ends)).every((message) => message.includes('texmesh/worker'))).toBe(true);
    expect([told.length, pool.none, all.length]).toEqual([1, true, 4]);
    pool.dispose();
  }));
});
