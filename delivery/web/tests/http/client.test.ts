import { afterEach, describe, expect, it, vi } from 'vitest';
import { HttpClient } from '../../src/http/client';
import { fakeServer } from '../support/fake_server';
import { openAt, openRetrying, range, rejection } from '../support/scan';
import { url } from '../support/transferring';

it('a cap does not hold back who cancels', async () => {
  const abort = new AbortController();
  const begin = performance.now();
  const opening = openAt(range(), { capBytesS: 100, signal: abort.signal });
  setTimeout(() => abort.abort(), 20);
  expect((await rejection(opening)).name).toBe('AbortError');
  expect(performance.now() - begin).toBeLessThan(3000);
});

describe('trouble', () => {
  it('a cap holds transfers back', async () => {
    const begin = performance.now();
    await openRetrying(range(), { capBytesS: 100e3 });
    expect(performance.now() - begin).toBeGreaterThan(120);
  });
});

describe('the window', () => {
  afterEach(() => vi.restoreAllMocks());

  /** Requests under way at once, of 100 that are asked for behind the first. */
  async function mostAtOnce(protocol: string | undefined,
      options: { connections?: number; streams?: number } = {}): Promise<number> {
    const entries = protocol === undefined ? [] : [{ nextHopProtocol: protocol }];
    const told =
      vi.spyOn(performance, 'getEntriesByName').mockReturnValue(entries as unknown as PerformanceEntryList);
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
    const client =
      new HttpClient({ fetch: fakeServer({ '/x': new Uint8Array(4000) }).fetch, capBytesS: 20000 });
    const begin = performance.now();
    const told: [number, number][] = [];
    await client.get('http://host/x',
      { maxBytes: 4000, kind: 'other', onBytes: (n) => told.push([n, (performance.now() - begin) / 1000]) });
    expect(told.at(-1)?.[0]).toBe(4000);
    for (const [bytes, s] of told) expect(s).toBeGreaterThan(bytes / 20000 - 0.005);
  });
  it('is as large as was asked for', async () => {
    expect(await mostAtOnce('h2', { streams: 9 })).toBe(9);
    expect(await mostAtOnce('http/1.1', { connections: 2, streams: 9 })).toBe(2);
  });
});

it.each([
  ['gzip', 200, 'image/jpeg', true], ['br', 206, '', true], ['gzip', 200, 'application/json', false],
  ['gzip', 404, 'image/jpeg', false], ['gzip', 200, 'text/html', false], ['identity', 200, '', false],
  ['', 200, '', false],
])('a server that compresses what is compressed is noticed: %s %s %s', async (encoding, status, type, is) => {
  const headers = { 'Content-Encoding': encoding, 'Content-Type': type };
  const client = new HttpClient({ fetch: () => Promise.resolve(new Response('x', { status, headers })) });
  await client.get(url, { maxBytes: 9, kind: 'other' });
  expect(client.compressed).toBe(is);
});
