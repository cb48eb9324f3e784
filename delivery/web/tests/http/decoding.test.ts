import { describe, expect, it } from 'vitest';
import { FormatError, PackageReader } from '../../src/reader';
import { handle } from '../../src/worker';
import { WorkerPool } from '../../src/worker/pool';
import type { WorkerRequest } from '../../src/worker/protocol';
import { fakeServer } from '../support/fake_server';
import { container, files, openAt, quick, range, rejection, url } from '../support/scan';

describe('documents', () => {
  /** As a worker would: what is asked and answered is copied. */
  const elsewhere = (heard: WorkerRequest['op'][]): WorkerPool =>
    new WorkerPool({
      decode: async (request) => {
        heard.push(request.op);
        const [result, transfer] = await handle(structuredClone(request));
        return [structuredClone(result, { transfer }), []];
      },
    });
  it('say the same when workers decode them', async () => {
    const heard: WorkerRequest['op'][] = [];
    const [here, there] = [await openAt(range()), await openAt(range())];
    there.decodeDocument = elsewhere(heard).decodeDocument;
    expect(await there.data()).toEqual(await here.data());
    expect(await there.quality()).toEqual(await here.quality());
    expect(await there.planeFiles(1)).toEqual(await here.planeFiles(1));
    expect(heard.length).toBeGreaterThan(4);
    expect(new Set(heard)).toEqual(new Set(['document']));
  });
  it('are decoded here where workers cannot, or have ended', async () => {
    const pools = [new WorkerPool({ decode: () => Promise.reject(new Error('broken')) }),
      new WorkerPool({ decode: handle }), new WorkerPool()];
    pools[1].dispose();
    for (const pool of pools) {
      const reader = await openAt(range());
      reader.decodeDocument = pool.decodeDocument;
      expect((await reader.data()).tables.length).toBe(reader.manifest.planeCount);
    }
  });
  it('are decoded here where workers do not answer, from the manifest on', async () => {
    const silent = new WorkerPool({ decode: () => new Promise(() => undefined) });
    const reader =
      await PackageReader.openUrl(url, { fetch: range().fetch, ...quick }, silent.decodeDocument);
    expect((await reader.data()).tables.length).toBe(reader.manifest.planeCount);
    silent.dispose();
  });
  it('that are damaged are told, and not decoded twice', async () => {
    const heard: WorkerRequest['op'][] = [];
    const { decodeDocument } = elsewhere(heard);
    const { manifest } = await PackageReader.openBytes(container, 'golden');
    const bytes =
      container.slice(manifest.textures.offset, manifest.textures.offset + manifest.textures.bytes);
    expect((await decodeDocument('textures', bytes, manifest)).length).toBe(manifest.planeCount);
    expect(await rejection(decodeDocument('textures', bytes, { ...manifest, planeCount: 99 })))
      .toBeInstanceOf(FormatError);
    const damaged = bytes.slice();
    damaged[0] ^= 1;
    const forged = await openAt(range());
    forged.decodeDocument = (name, ...args) =>
      decodeDocument(name, ...(args.map((a) => (a instanceof Uint8Array ? damaged : a)) as typeof args));
    heard.length = 0;
    expect(await rejection(forged.textures())).toBeInstanceOf(FormatError);
    expect(heard).toEqual(['document']);
  });
});

it('who cancels while a document is decoded has no other thread decode it', async () => {
  const reader = await PackageReader.openUrl(url, { fetch: fakeServer(files).fetch });
  const abort = new AbortController();
  let here = 0;
  const textures = reader.textures.bind(reader);
  reader.decodeDocument = () => {
    abort.abort();
    reader.decodeDocument = (() => ++here) as never;
    return Promise.reject(new Error('a worker broke'));
  };
  await expect(textures(abort.signal)).rejects.toThrow();
  expect(here).toBe(0);
});
