import { describe, expect, it } from 'vitest';
import { treeUrl } from '../../src/http/without_ranges';
import { InputError, PackageReader } from '../../src/reader';
import { FakeServer, fakeServer, treeFiles } from '../support/fake_server';
import { expected, readSome, tree } from '../support/reading';
import { container, openAt, openRetrying, range, rejection } from '../support/scan';

describe('hostile answers', () => {
  it('a server that gives its front page for everything has the whole container, too', async () => {
    const page = new TextEncoder().encode('<!doctype html><title>front page</title>'.repeat(20));
    const files = { '/a/scan.texmesh': container, '/a/scan/manifest.json': page,
      '/a/scan/fragments.json': page };
    const reader = await openAt(fakeServer(files, { ranges: false }));
    expect(reader.form).toBe('whole');
  });
  it('a page in the place of the package is called one', async () => {
    for (const ranges of [true, false]) {
      const error = await rejection(openAt(fakeServer({}, { ranges, fault: () => 'page' })));
      expect(error.message).toContain('status 200 (text/html; charset=utf-8)');
      expect(error.message).toContain('http://host/a/scan');
    }
  });
  it('mode files wants a URL that has a tree', async () => {
    const opening = PackageReader.openUrl('http://host/a/scan.zip', { fetch: range().fetch, mode: 'files' });
    expect(await rejection(opening)).toBeInstanceOf(InputError);
  });
});

describe('a server that stops answering ranges', () => {
  /** Ranges at first, then whole files; the tree beside the container. */
  const stopping = async (change?: (files: Record<string, Uint8Array>) => void) => {
    const reader = await PackageReader.openBytes(container, 'golden');
    const entries = [...(await reader.index()), reader.manifest.index];
    const files = { '/a/scan.texmesh': container,
      ...treeFiles('/a/scan/', container, await reader.store.manifest(), entries) };
    change?.(files);
    return fakeServer(files, { fault: ({ number, range: asked }) => number > 0 && !!asked && 'whole' });
  };
  it('is read on from the tree of the same package', async () => {
    const reader = await openRetrying(await stopping());
    expect(reader.form).toBe('range');
    expect(await readSome(reader)).toBe(expected);
    expect(reader.form).toBe('files');
  });
  it('is not mixed with another package', async () => {
    const server = await stopping(
      (files) => (files['/a/scan/manifest.json'] = new Uint8Array([...files['/a/scan/manifest.json'], 32])));
    expect((await rejection(openRetrying(server).then(readSome))).message)
      .toContain('replaced, open it anew');
  });
  it('is no longer read where ranges are insisted on', async () => {
    expect((await rejection(openRetrying(await stopping(), { mode: 'range' }).then(readSome))).message)
      .toContain('ranges are no longer answered');
  });
});

describe('a server that compresses whatever is asked for, or sends ranges that are none', () => {
  it('is read as one without ranges', async () => {
    for (const kind of ['gzip', 'gzip-refused', 'bare'] as const) {
      const server = range(() => kind);
      const reader = await openRetrying(server);
      expect(await readSome(reader)).toBe(expected);
      expect(reader.form).toBe('whole');
      expect(reader.client.compressed).toBe(kind !== 'bare');
      expect(server.log.length).toBeLessThan(12);
    }
  });
  it('is told with the header where ranges are insisted on', async () => {
    const error = await rejection(openAt(range(() => 'gzip'), { mode: 'range' }));
    expect(error.message).toContain('more bytes than were asked for, Content-Encoding: gzip');
  });
  it('one that is away is asked once more, and not for all', async () => {
    const server = range(() => 'refused');
    expect((await rejection(openAt(server))).message).toContain('connection refused');
    expect(server.log.length).toBe(3);
  });
});

describe('a server without ranges', () => {
  it('the tree beside the container is taken', async () => {
    const server = await tree();
    const reader = await openRetrying(server);
    expect(reader.form).toBe('files');
    expect(await readSome(reader)).toBe(expected);
    const files = server.log.map((r) => r.url).filter((u) => !u.endsWith('fragments.json'));
    expect(new Set(files).size).toBe(files.length);
  });
  it('a damaged file is fetched again', async () => {
    const path = 'mesh/s00.glb';
    let damaged = false;
    const server = await tree(({ url: u }) => {
      if (!u.endsWith(path) || damaged) return false;
      damaged = true;
      return 'flip';
    });
    expect(await readSome(await openRetrying(server))).toBe(expected);
  });
  it('or the whole container, where there is no tree', async () => {
    const server = fakeServer({ '/a/scan.texmesh': container }, { ranges: false });
    const reader = await openRetrying(server);
    expect(reader.form).toBe('whole');
    expect(await readSome(reader)).toBe(expected);
  });
  it('and one that refuses parts: an empty file is called so', async () => {
    const refusing = (file: Uint8Array): FakeServer =>
      fakeServer({ '/a/scan.texmesh': file }, { fault: ({ range }) => !!range && 'status-416' });
    expect((await openRetrying(refusing(container))).form).toBe('whole');
    const { message } = await rejection(openRetrying(refusing(new Uint8Array())));
    expect(message).not.toContain('replaced');
  });
  it('unless ranges are insisted on', async () => {
    const server = fakeServer({ '/a/scan.texmesh': container }, { ranges: false });
    expect((await rejection(openRetrying(server, { mode: 'range' }))).message).toContain('answers ranges');
  });
  it('a container that is too large is refused', async () => {
    const server = fakeServer({ '/a/scan.texmesh': container }, { ranges: false });
    expect((await rejection(openRetrying(server, { maxWholeBytes: 1000 }))).message)
      .toContain('at most 1000 bytes');
  });
  it('the URL of a tree keeps query and fragment', () => {
    expect(treeUrl('https://h/a/N.texmesh?v=1#x')).toBe('https://h/a/N/?v=1#x');
    expect(treeUrl('https://h/a/N.zip')).toBe('');
  });
});
