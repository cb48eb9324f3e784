import { afterEach, expect, it, vi } from 'vitest';
import { bytesAt, linkBytesS, savesData } from '../../src/element/wording';

afterEach(() => {
  vi.unstubAllGlobals();
  vi.restoreAllMocks();
});
/** Files that came, as [bytes, seconds]. */
const came = (...files: [number, number][]): void =>
  void vi.spyOn(performance, 'getEntriesByType').mockReturnValue(files.map(
    ([transferSize, s]) => ({ transferSize, responseStart: 500, responseEnd: 500 + 1000 * s })) as never);

it('the link is as fast as the browser says, else as the fastest large file of the page', () => {
  vi.stubGlobal('navigator', {});
  came();
  expect([linkBytesS(), savesData()]).toEqual([0, false]);
  came([1000, 0.001], [60e3, 0.5], [200e3, 1], [0, 0]); // small ones and those of the cache say nothing
  expect(linkBytesS()).toBe(200e3);
  vi.stubGlobal('navigator', { connection: { downlink: 2, saveData: true } });
  expect([linkBytesS(), savesData()]).toEqual([250e3, true]);
});
it('a file is as large as its server says; unknown where it does not, or cannot be had', async () => {
  const answer = (status: number, headers: Record<string, string>) =>
      async (_: string, { method }: RequestInit) => {
    expect(method).toBe('HEAD');
    return new Response(null, { status, headers });
  };
  for (const [server, bytes] of [
    [answer(200, { 'content-length': '2500000' }), 2500000], [answer(200, {}), 0],
    [answer(404, { 'content-length': '12' }), 0],
    [answer(200, { 'content-length': 'many' }), 0], [() => Promise.reject(new TypeError('no network')), 0],
  ] as const) {
    vi.stubGlobal('fetch', server);
    expect(await bytesAt('http://host/a.texmesh')).toBe(bytes);
  }
});
