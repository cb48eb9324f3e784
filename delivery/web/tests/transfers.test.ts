import { afterEach, describe, expect, it, vi } from 'vitest';
import {
  FormatError, FragmentList, HtcStep, PackageReader, defaultHtcOptions, fragmentList, fullSize, planOptions,
} from '../src/reader';
import { finerWhereSeen } from '../src/decide/scale_choice';
import { defaultDeliveryRequest, planDelivery } from '../src/decide/delivery_plan';
import { groupBytes, groupedList, throughputOf } from '../src/decide/request_groups';
import { UncheckedPlan } from '../src/decide/unchecked_plan';
import { playPlan } from '../src/scene/play_plan';
import { Transfers, Wish } from '../src/scene/transfers';
import { WorkerPool } from '../src/worker/pool';
import { packError } from '../src/worker';
import { samePrefix } from '../src/format/bytes';
import { sha256 } from '../src/format/sha256';
import type { WorkerRequest } from '../src/worker/protocol';
import { HttpClient } from '../src/http/client';
import { Fault, bytesAskedTwice, fakeServer } from './fake_server';
import { golden } from './support';

const url = 'http://host/scan.texmesh';

/** Instead of a worker: checks digests, decodes nothing. */
async function decode(request: WorkerRequest): Promise<[unknown, Transferable[]]> {
  if (request.op !== 'decode') throw new Error('not asked for here');
  for (const [i, digest] of request.digests.entries())
    if (!samePrefix(await sha256(request.streams[i]), digest)) throw new FormatError('fragment', '', 'a digest', 'another');
  return [[{ streams: request.streams.length }], []];
}

async function setUp(fault?: Fault) {
  const server = fakeServer({ '/scan.texmesh': golden('v1.1-scan') }, { fault });
  const reader = await PackageReader.openUrl(url, { fetch: server.fetch, retryDelayS: 0.001, retries: 1 });
  await reader.prefetchDocuments();
  const data = await reader.data();
  const decoded: Wish[] = [];
  const lost: Wish[] = [];
  const transfers = new Transfers(reader, data.textures, new WorkerPool({ decode }), {
    decoded: (wish) => decoded.push(wish),
    lost: (wish) => lost.push(wish),
  });
  await transfers.prepare(data.textures.map((_, p) => p));
  await reader.tableStream(0, 0);
  const list = fragmentList(data, fullSize(data.textures), { scale: 0 });
  const settled = async (): Promise<void> => {
    while (transfers.pending > 0) await new Promise((go) => setTimeout(go, 1));
  };
  return { server, reader, data, transfers, decoded, lost, list, settled };
}
const wishesOf = (list: FragmentList, rung: number): Wish[] =>
  list.fragments.map((f, offer) => ({ ...f, rung: Math.min(rung, list.offers[offer].bytes.length - 1), offer }));

describe('fragment list', () => {
  it('leaves to the preview what no rung shows better', async () => {
    const { data, list } = await setUp();
    const tables = data.tables.map((t, p) => (t && p === 0 ? { ...t, skipDssim: t.skipDssim.map(() => 0) } : t));
    const shorter = fragmentList({ ...data, tables }, fullSize(data.textures), { scale: 0 });
    expect(shorter.fragments).toEqual(list.fragments.filter((f) => f.plane !== 0));
    expect(shorter.fragments.length).toBeLessThan(list.fragments.length);
    expect([shorter.totalWeight, shorter.previewLoss]).toEqual([list.totalWeight, 0]);
  });
});

describe('transfers', () => {
  it('neighbours of a rung share a request, nothing comes twice', async () => {
    const s = await setUp();
    const before = s.server.log.length;
    const arrived: Wish[] = [];
    const wishes = wishesOf(s.list, 0);
    await s.transfers.fetch(wishes, { gapBytes: 0, mostBytes: Infinity }, (w) => arrived.push(w), () => undefined);
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
    await s.transfers.fetch(wishesOf(s.list, 0), { gapBytes: 0, mostBytes: 2000 }, () => undefined, () => undefined);
    for (const { range } of s.server.log.slice(before)) if (range) expect(range[1] - range[0]).toBeLessThan(5000);
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
    const t = await setUp(({ range }) => range !== undefined && range[0] >= pack.offset && range[0] < pack.offset + pack.bytes && 'status-404');
    const failed: Wish[] = [];
    const wishes = wishesOf(t.list, 0);
    await t.transfers.fetch(wishes, { gapBytes: 0, mostBytes: Infinity }, () => undefined, (w) => failed.push(w));
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
    const textures = s.data.textures.map((t) => ({ ...t, fragmentWidthPx: 1 << 20, fragmentHeightPx: 1 << 20 }));
    const transfers = new Transfers(s.reader, textures, new WorkerPool({ decode: watch }), { decoded: () => undefined, lost: () => undefined });
    await transfers.prepare([0]);
    await transfers.fetch(wishesOf(s.list, 0).slice(0, 1), { gapBytes: 0, mostBytes: Infinity }, () => undefined, () => undefined);
    while (transfers.pending > 0) await new Promise((go) => setTimeout(go, 1));
    expect(most.length).toBe(2);
    expect(Math.max(...most)).toBeLessThan(2048);
  });
  it('cancelling fails what is under way', async () => {
    const s = await setUp();
    const abort = new AbortController();
    const failed: Wish[] = [];
    const done = s.transfers.fetch(
      wishesOf(s.list, 2), { gapBytes: 0, mostBytes: 3000, signal: abort.signal }, () => undefined, (w) => failed.push(w),
    );
    abort.abort();
    await done;
    expect(failed.length).toBe(s.list.offers.length);
  });
});

describe('groups', () => {
  it('keep all bytes and losses, and the order of packs', async () => {
    const { list } = await setUp();
    const grouped = groupedList(list, 3000, 40000);
    expect(grouped.offers.length).toBeLessThan(list.offers.length);
    expect(grouped.groups.flat()).toEqual(list.fragments);
    const sum = (offers: { bytes: number[] }[]): number => offers.reduce((n, o) => n + o.bytes[0], 0);
    expect(sum(grouped.offers)).toBe(sum(list.offers));
    for (const g of grouped.groups) expect(new Set(g.map((f) => f.plane)).size).toBe(1);
  });
  it('one each where requests cost nothing, one per plane where only whole rungs come', async () => {
    const { list } = await setUp();
    expect(groupedList(list, 0, 1e5).offers.length).toBe(list.offers.length);
    expect(groupedList(list, Infinity, 1e5).offers.length).toBe(new Set(list.fragments.map((f) => f.plane)).size);
  });
  it('grow with the round trip, but leave enough decisions', () => {
    expect(groupBytes(250e3, 0.04, 4)).toBeCloseTo(6000);
    expect(groupBytes(250e3, 1, 4)).toBeCloseTo((250e3 * 4) / 48);
  });
  it('throughput is bytes over the time in which bytes came', () => {
    const record = { url, offset: 0, bytes: 0, kind: 'mesh', firstByte: 0.1, status: 206, ok: true } as const;
    const requests = [
      { ...record, started: 0, ended: 1.1, received: 100e3 },
      { ...record, started: 0.5, firstByte: 0.6, ended: 1.1, received: 100e3 },
    ];
    expect(throughputOf(requests, 0.1)).toBeCloseTo(200e3);
  });
});

describe('a timed fetch', () => {
  async function fetchInTime(fault: Fault | undefined, mostS: number, signal = new AbortController().signal) {
    const s = await setUp(fault);
    const list = groupedList(s.list, 2000, 60000);
    const plan = new UncheckedPlan(list.offers, planOptions({ ...defaultHtcOptions(), timeLimitS: 2, rttS: 0.002 }));
    const ended: HtcStep[] = [];
    const decided = (step: HtcStep): void => void (step.doneS >= 0 && ended.push(step));
    const run = playPlan(plan, list, s.transfers, signal, mostS, { decided, lost: () => undefined });
    return { ...s, list, plan, ended, run };
  }
  it('ends when every offer was decided and has come', async () => {
    const t = await fetchInTime(undefined, 10);
    await t.run;
    await t.settled();
    expect(t.plan.finished()).toBe(true);
    const wanted = t.plan.steps.flatMap((s) => (s.rung < 0 ? [] : t.list.groups[s.offer]));
    expect(t.decoded.length).toBe(wanted.length);
    expect(bytesAskedTwice(t.server.log, url)).toBe(0);
    expect(new Set(t.ended.map((step) => step.offer)).size).toBe(t.list.offers.length);
  });
  it('gives up what does not come', async () => {
    const t = await fetchInTime(({ range }) => range !== undefined && range[0] > 100000 && 'stall', 0.3);
    const begin = performance.now();
    await t.run;
    expect(performance.now() - begin).toBeLessThan(3000);
    expect(t.plan.finished()).toBe(true);
    expect(t.plan.steps.map((s) => s.rung)).toContain(-1);
  });
  it('can be cancelled', async () => {
    const abort = new AbortController();
    const t = await fetchInTime(() => false, 10, abort.signal);
    abort.abort();
    await expect(t.run).rejects.toThrow('cancelled');
  });
});

describe('the scale', () => {
  it('is the wanted one when time is plenty, the coarsest when there is none', async () => {
    const { reader, data } = await setUp();
    const quality = await reader.quality();
    const at = (timeLimitS: number, scale = -1) => {
      const base = defaultDeliveryRequest();
      return planDelivery(data, quality, { ...base, displayedPx: 1e6, timeLimitS, scale });
    };
    const coarsest = data.manifest.scales[data.manifest.scales.length - 1].scale;
    expect(at(1e3)).toMatchObject({ scale: 0, late: false });
    expect(at(1e-3)).toMatchObject({ scale: coarsest, late: true });
    expect(at(1e-3, 0)).toMatchObject({ scale: 0, late: true }); // as it was asked for
    expect(at(1e3, 98)).toBeUndefined();
  });
});

it('a finer scale is taken while it was measured to be seen', () => {
  const ssim = Float32Array.from([0.9, 0.999, 0.89, 0.998, 0.88, 0.97, 0.8, 0.9]);
  const table = { views: 4, sizePx: 192, scales: [0, 2, 5, 9], rungs: [10, 90], ssim, difference: ssim };
  expect(finerWhereSeen(table, 9, 400)).toBe(2);
  expect(finerWhereSeen(table, 2, 400)).toBe(2);
  expect(finerWhereSeen(table, 9, 100)).toBe(9); // smaller than it was measured at
  expect(finerWhereSeen(table, 7, 400)).toBe(7); // not in the table
});

it('workers are sent the bytes that they need, not the package that they lie in', async () => {
  const sent: WorkerRequest[] = [];
  const pool = new WorkerPool({ decode: async (request) => (sent.push(request), [[], []]) });
  const whole = Uint8Array.from({ length: 1000 }, (_, i) => i & 255);
  const [tables, stream] = [whole.subarray(0, 10), whole.subarray(500, 540)];
  await pool.decode({ codec: 'jpeg', tables, streams: [stream, whole], digests: [], complete: false, levels: 1, most: [9, 9] });
  await pool.addSplits(1, stream);
  const [decode, splits] = sent as [WorkerRequest & { op: 'decode' }, WorkerRequest & { op: 'split-add' }];
  for (const [found, expected] of [[decode.tables, tables], [decode.streams[0], stream], [splits.blocks, stream]]) {
    expect(found).toEqual(expected);
    expect(found.buffer.byteLength).toBe(expected.length);
  }
  expect(decode.streams[1]).toBe(whole); // nothing to copy
  pool.dispose();
});

it('errors keep their parts on the way from a worker', () => {
  expect(packError(new FormatError('f', 'p', 'e', 'x'))?.parts).toEqual(['f', 'p', 'e', 'x']);
  expect(packError(new Error('other'))?.message).toBe('other');
});

describe('the window', () => {
  afterEach(() => vi.restoreAllMocks());

  /** Requests under way at once, of 100 that are asked for behind the first. */
  async function mostAtOnce(protocol: string | undefined, options: { connections?: number; streams?: number } = {}): Promise<number> {
    const entries = protocol === undefined ? [] : [{ nextHopProtocol: protocol }];
    const told = vi.spyOn(performance, 'getEntriesByName').mockReturnValue(entries as unknown as PerformanceEntryList);
    let [now, most] = [0, 0];
    const slow = async (): Promise<Response> => {
      most = Math.max(most, ++now);
      await new Promise((go) => setTimeout(go, 2));
      --now;
      return new Response('x', { status: 206, headers: { 'Content-Range': 'bytes 0-0/9' } });
    };
    const client = new HttpClient({ fetch: slow, ...options });
    const get = () => client.get(url, { range: { offset: 0, bytes: 1 }, maxBytes: 1, kind: 'other' });
    await get();
    const answers = await Promise.all(Array.from({ length: 100 }, get));
    expect(answers.every((a) => a.complete && a.status === 206)).toBe(true);
    expect(now).toBe(0);
    expect(told).toHaveBeenCalledWith(url, 'resource');
    return most;
  }
  it('is 32 streams where the first answer came over HTTP/2 or 3', async () => {
    for (const protocol of ['h2', 'h3', 'h3-29']) expect(await mostAtOnce(protocol)).toBe(32);
  });
  it('is six connections over HTTP/1.1, and where nobody says', async () => {
    for (const protocol of ['http/1.1', '', undefined]) expect(await mostAtOnce(protocol)).toBe(6);
  });
  it('tells of bytes when the cap lets them through, not before', async () => {
    const client = new HttpClient({ fetch: fakeServer({ '/x': new Uint8Array(4000) }).fetch, capBytesS: 20000 });
    const begin = performance.now();
    const told: [number, number][] = [];
    await client.get('http://host/x', { maxBytes: 4000, kind: 'other', onBytes: (n) => told.push([n, (performance.now() - begin) / 1000]) });
    expect(told.at(-1)?.[0]).toBe(4000);
    for (const [bytes, s] of told) expect(s).toBeGreaterThan(bytes / 20000 - 0.005);
  });
  it('is as large as was asked for', async () => {
    expect(await mostAtOnce('h2', { streams: 9 })).toBe(9);
    expect(await mostAtOnce('http/1.1', { connections: 2, streams: 9 })).toBe(2);
  });
});
