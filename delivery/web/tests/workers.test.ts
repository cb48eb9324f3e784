import { describe, expect, it } from 'vitest';
import { open } from '../src/open';
import { handle } from '../src/worker';
import { WorkerPool } from '../src/worker/pool';
import type { WorkerRequest } from '../src/worker/protocol';
import { fakeServer } from './fake_server';
import { golden } from './support';

const url = 'http://host/a/scan.texmesh';
const files = { '/a/scan.texmesh': golden('v1.1-scan') };
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

it('a load whose options are refused leaves no worker behind', async () => {
  const worker = () => ({
    ended: false,
    onmessage: undefined as ((e: { data: unknown }) => void) | undefined,
    postMessage(request: WorkerRequest & { id: number }): void {
      void handle(request).then(([result]) => this.onmessage?.({ data: { id: request.id, result } }));
    },
    terminate(): void {
      this.ended = true;
    },
  });
  await withWorkers(worker, async (all) => {
    const pkg = await open(url, { fetch: fakeServer(files).fetch });
    expect(all.map((w) => w.ended)).toEqual([false]);
    expect(() => pkg.load({} as never, { renderer: {}, gltfLoader: () => ({}), scale: 1.5 } as never)).toThrow('scale');
    pkg.dispose();
    expect(all.length).toBeGreaterThan(0);
    expect(all.every((w) => w.ended)).toBe(true);
  });
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
  const picture = { codec: 'jpeg', tables: new Uint8Array(0), streams: [], digests: [], complete: true, levels: 1, most: [9, 9] } as const;
  const asked = () => ({ ...picture, streams: [], digests: [], most: [9, 9] as [number, number] });
  it('cost what they had under way, not what waited for its turn', () => withWorkers(worker, async (all) => {
    const pool = new WorkerPool({ workers: 1 });
    const ends = Array.from({ length: 20 }, () => pool.decode(asked()).then(() => 'done', (error: Error) => error.message));
    expect(all[0].posted.length).toBe(8);
    all[0].onmessage!({ data: { id: all[0].posted[0], result: [] } }); // it works
    await turns();
    all[0].break();
    all[1].break();
    await turns();
    // Eight more have their turn, at the third worker.
    expect(all[2].posted.length).toBe(8);
    for (let n = 0; n < all[2].posted.length; ++n) all[2].onmessage!({ data: { id: all[2].posted[n], result: [] } });
    await turns();
    for (let n = 0; n < all[2].posted.length; ++n) all[2].onmessage!({ data: { id: all[2].posted[n], result: [] } });
    const said = await Promise.all(ends);
    expect(said.filter((s) => s === 'a worker broke').length).toBe(8);
    expect(said.filter((s) => s === 'done').length).toBe(12);
    pool.dispose();
  }));
  it('one after the other, before any has worked: there are none', () => withWorkers(worker, async (all) => {
    const pool = new WorkerPool({ workers: 2 });
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
