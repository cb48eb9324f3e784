import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import { type Clear, enlarge } from '../../src/scene/enlarge';
import type { PlaneComposer } from '../../src/scene/composer';
import type { UploadQueue } from '../../src/scene/upload_queue';
import type { WorkerPool } from '../../src/worker/pool';
import { rejection, turns } from '../support/scan';

// 4 x 4 fragments of 1024 px: a piece is a quarter of one, and four are under way at once.
const side = 1024;
interface Asked { x0: number; x1: number; y0: number; y1: number; end(): void; fail(): void }

beforeEach(() => vi.stubGlobal('createImageBitmap', async () => ({ close: () => undefined })));
afterEach(() => void vi.unstubAllGlobals());

function setUp(): { next: PlaneComposer; clear: Clear; asked: Asked[]; written: [number, number][];
    done: Promise<void> } {
  const asked: Asked[] = [];
  const written: [number, number][] = [];
  const next = {
    info: { columns: 4, rows: 4, fragmentWidthPx: side, fragmentHeightPx: side }, widthPx: 4 * side,
    heightPx: 4 * side, come: new Set<number>(),
    placeOf: (f: number) => [(f % 4) * side, Math.floor(f / 4) * side],
    uploads: (_: unknown, x: number, y: number) => [{ pixels: 1, run: () => written.push([x, y]) }],
  } as unknown as PlaneComposer;
  const pool = {
    enlarge: (piece: Asked) => new Promise((end, fail) =>
      asked.push({ ...piece, end: () => end([]), fail: () => fail(new Error('workers cannot draw')) })),
  } as unknown as WorkerPool;
  const uploads =
    { disposed: false, enqueue: async (_: number, run: () => void) => run() } as unknown as UploadQueue;
  const { clear, done } = enlarge(next, {} as ImageBitmap, pool, uploads);
  done.catch(() => undefined);
  return { next, clear: clear!, asked, written, done };
}
const settles = async (promise: Promise<unknown>): Promise<boolean> => {
  let settled = false;
  promise.then(() => (settled = true), () => (settled = true));
  await turns(10);
  return settled;
};

it('a fragment waits for the first piece and for those over it, and is left out of later ones', async () => {
  const { next, clear, asked, written, done } = setUp();
  await turns();
  expect(asked.map(({ x0, y0 }) => [x0, y0])).toEqual([0, 1024, 2048, 3072].map((x) => [x, 0]));
  for (const f of [1, 15]) next.come.add(f);
  const [over, far] = [clear(1), clear(15)];
  expect(await settles(far)).toBe(false); // nobody knows yet whether workers can draw
  asked[0].end();
  expect([await settles(far), await settles(over)]).toEqual([true, false]);
  expect(written).toEqual([[0, 0]]);
  asked[1].end();
  expect(await settles(over)).toBe(true);
  for (let i = 2; i < asked.length; ++i) {
    asked[i].end();
    await turns();
  }
  await done;
  expect(asked.reduce((px, { x0, x1, y0, y1 }) => px + (x1 - x0) * (y1 - y0), 0))
    .toBe(14 * side * side + 256 * side);
});
it('where workers cannot draw, fragments hear of it', async () => {
  const { clear, asked, done } = setUp();
  await turns();
  const waiting = rejection(clear(15));
  for (const piece of asked) piece.fail();
  expect((await waiting).message).toContain('cannot draw');
  expect((await rejection(done)).message).toContain('cannot draw');
});
