import { describe, expect, it } from 'vitest';
import { HttpClient } from '../../src/http/client';
import { TreeStore } from '../../src/http/without_ranges';
import { FormatError } from '../../src/reader';
import { fakeServer } from '../support/fake_server';
import { quick, rejection } from '../support/scan';

describe('a failure', () => {
  it('nor in a tree of files', async () => {
    let stalls = true;
    const server =
      fakeServer({ '/a/x.bin': new Uint8Array(3000) }, { ranges: false, fault: () => stalls && 'stall' });
    const store =
      new TreeStore(['http://host/a/'], new HttpClient({ fetch: server.fetch, stallTimeoutS: 30 }));
    const abort = new AbortController();
    const place = { path: 'x.bin', offset: 0, bytes: 3000 };
    const one =
      rejection(store.read(place, { offset: 0, bytes: 10 }, { kind: 'other', signal: abort.signal }));
    const other = store.read(place, { offset: 0, bytes: 10 }, { kind: 'other' });
    await new Promise((go) => setTimeout(go, 10));
    stalls = false;
    abort.abort();
    expect((await one).name).toBe('AbortError');
    expect((await other).length).toBe(10);
  });
});

it('a tree whose files are others is left for a mirror', async () => {
  const file = Uint8Array.from({ length: 500 }, (_, i) => i & 255);
  const server = fakeServer({ '/a/x.bin': file },
    { ranges: false, fault: ({ url: u }) => u.startsWith('http://host') && 'flip' });
  const verify = async (got: Uint8Array): Promise<void> => {
    if (got.some((b, i) => b !== file[i])) throw new FormatError('x.bin', '', 'these bytes', 'others');
  };
  const read = (roots: string[]): Promise<Uint8Array> =>
    new TreeStore(roots, new HttpClient({ fetch: server.fetch, ...quick })).read({ path: 'x.bin', offset: 0,
      bytes: 500 }, { offset: 0, bytes: 500 }, { kind: 'other', verify });
  expect((await read(['http://host/a/', 'http://other/a/'])).length).toBe(500);
  expect(await rejection(read(['http://host/a/']))).toBeInstanceOf(FormatError);
  expect(server.log.length).toBe(4);
});
