import { describe, expect, it } from 'vitest';
import { InputError } from '../../src/reader';
import { fakeServer } from '../support/fake_server';
import { expected, readSome } from '../support/reading';
import { container, openRetrying, range, rejection } from '../support/scan';

describe('mirrors', () => {
  const mirrors = ['http://other/a/scan.texmesh'];
  it('one that is dead from the beginning is left alone', async () => {
    const server = range(({ url: u }) => u.startsWith('http://host') && 'refused');
    expect(await readSome(await openRetrying(server, { mirrors }))).toBe(expected);
  });
  it('one that dies with many requests under way loses none', async () => {
    let served = 0;
    const server = range(({ url: u }) => u.startsWith('http://host') && ++served > 3 && 'cut');
    const reader = await openRetrying(server, { mirrors });
    const tables = await reader.planeTables(0);
    const fragments = await Promise.all([...tables.order].map((f) => reader.fragment(0, 0, f)));
    expect(fragments.every((f) => f.length > 0)).toBe(true);
  });
  it('one that gives other bytes is found out', async () => {
    const server = range(({ url: u, number }) => u.startsWith('http://host') && number > 0 && 'flip');
    expect(await readSome(await openRetrying(server, { mirrors }))).toBe(expected);
  });
  it('all dead: the last one says why', async () => {
    const server = range(({ number }) => number > 0 && 'refused');
    const error = await rejection(openRetrying(server, { mirrors }).then(readSome));
    expect(error.message).toContain('connection refused');
  });
  it('one that was too slow for somebody who cancelled may be asked again', async () => {
    const server = range(({ url: u, number }) => number === 1 && u.startsWith('http://host') && 'stall');
    const reader = await openRetrying(server, { mirrors, stallTimeoutS: 5 });
    const abort = new AbortController();
    const error = rejection(reader.scaleGlb(0, { signal: abort.signal }));
    abort.abort();
    expect((await error).name).toBe('AbortError');
    await readSome(reader);
    expect(server.log.filter((r) => r.url.startsWith('http://host')).length).toBeGreaterThan(2);
  });
  it('one that knows no ranges leaves them to one that does', async () => {
    const server = range(({ url: u }) => u.startsWith('http://host') && 'whole');
    const reader = await openRetrying(server, { mirrors, mode: 'range' });
    expect(reader.form).toBe('range');
    expect(await readSome(reader)).toBe(expected);
    expect(server.log.filter((r) => r.url.startsWith('http://host')).length).toBe(1);
  });
  it('one that knows no ranges is met in the middle', async () => {
    const server =
      range(({ url: u, number }) => (u.startsWith('http://host') ? number > 0 && 'refused' : 'whole'));
    const error = await rejection(openRetrying(server, { mirrors }).then(readSome));
    expect(error).toBeInstanceOf(InputError);
    expect(error.message).toContain('answers ranges');
  });
  it('a dead one and one without ranges: the whole file of the other', async () => {
    const server =
      range(({ url: u, range: r }) => (u.startsWith('http://host') ? 'refused' : r !== undefined && 'whole'));
    const reader = await openRetrying(server, { mirrors });
    expect(reader.form).toBe('whole');
    expect(await readSome(reader)).toBe(expected);
  });
  it('one that has something else instead of the whole file is left alone', async () => {
    const page = new TextEncoder().encode('<html>');
    const server = fakeServer({ '/a/scan.texmesh': page, '/b/scan.texmesh': container }, { ranges: false });
    expect(await readSome(await openRetrying(server, { mirrors: ['http://other/b/scan.texmesh'] })))
      .toBe(expected);
  });
});
