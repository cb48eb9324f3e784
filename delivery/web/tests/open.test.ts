import { Scene } from 'three';
import { describe, expect, it } from 'vitest';
import { open, TexmeshPackage } from '../src/open';
import { InputError } from '../src/reader';
import type { LoadOptions } from '../src/scene/api';
import { handle } from '../src/worker';
import type { WorkerRequest } from '../src/worker/protocol';
import { fakeServer, FakeServer } from './support/fake_server';
import { until } from './support/loading';
import { files, quick, range, rejection, turns, url } from './support/scan';
import { withWorkers } from './support/workers';

describe('a load', () => {
  const options =
    { renderer: {}, gltfLoader: () => { throw new Error('not asked for here'); } } as unknown as LoadOptions;
  const pkg = async (server: FakeServer): Promise<TexmeshPackage> =>
    TexmeshPackage.openUrl(url, { fetch: server.fetch, ...quick });
  it('takes every policy by its names, and no other', async () => {
    const opened = await pkg(range());
    for (const policy of ['guard', 'thesis', undefined] as const)
      opened.load(new Scene(), { ...options, policy }).dispose();
    for (const policy of ['foo', 'htc', 'price'])
      expect(() => opened.load(new Scene(), { ...options, policy: policy as 'guard' })).toThrow(InputError);
  });
  it('takes no option that is none', async () => {
    const opened = await pkg(range());
    const good = { rule: 'edge', meshes: 'auto', time: Infinity, display: 0 } as const;
    opened.load(new Scene(), { ...options, ...good }).dispose();
    for (const bad of [{ rule: 'foo' }, { meshes: '' }, { time: NaN }, { time: 'soon' }, { display: NaN },
        { display: -5 }])
      expect(() => opened.load(new Scene(), { ...options, ...(bad as Partial<LoadOptions>) }))
        .toThrow(InputError);
  });
  it('takes whole numbers for scale and rung', async () => {
    const opened = await pkg(range());
    for (const v of [1.5, -1, NaN, Infinity, '1' as unknown as number])
      for (const name of ['scale', 'rung'])
        expect(() => opened.load(new Scene(), { ...options, [name]: v })).toThrow(InputError);
    const model = opened.load(new Scene(), { ...options, rung: 99, scale: 0 });
    expect(() => model.setOverride({ rung: 0.5 })).toThrow(InputError);
    model.setOverride({});
    model.dispose();
  });
  it('that was cancelled before it began asks for nothing', async () => {
    const server = range();
    const opened = await pkg(server);
    const model = opened.load(new Scene(), { ...options, signal: AbortSignal.abort() });
    expect((await rejection(model.done)).name).toBe('AbortError');
    expect(model.state.phase).toBe('cancelled');
    expect(server.log.length).toBe(1);
  });
  it('that was disposed of is forgotten, and listens to no signal', async () => {
    const opened = await pkg(range());
    const { signal } = new AbortController();
    let listeners = 0;
    const [add, remove] = [signal.addEventListener.bind(signal), signal.removeEventListener.bind(signal)];
    signal.addEventListener = (...a: Parameters<typeof add>) => (++listeners, add(...a));
    signal.removeEventListener = (...a: Parameters<typeof remove>) => (--listeners, remove(...a));
    const model = opened.load(new Scene(), { ...options, signal });
    model.dispose();
    await rejection(model.done);
    expect(listeners).toBe(0);
    expect((opened as unknown as { loads_: Set<unknown> }).loads_.size).toBe(0);
  });
});

describe('open() that is cancelled while the manifest is decoded', () => {
  it('ends though the worker does not answer', async () => {
    const abort = new AbortController();
    const asked: string[] = [];
    const decode = (request: WorkerRequest): Promise<never> => {
      asked.push(request.op);
      return new Promise(() => undefined);
    };
    const opening = open(url, { fetch: fakeServer(files).fetch, signal: abort.signal, decode })
      .then(() => 'opened', (error: Error) => error.name);
    expect(await until(() => asked.length > 0)).toBe(true);
    abort.abort();
    expect(await Promise.race([opening, turns(500).then(() => 'still waits')])).toBe('AbortError');
  });
  it('gives no package, though the worker answers', async () => {
    const abort = new AbortController();
    const decode = (request: WorkerRequest): ReturnType<typeof handle> => {
      abort.abort();
      return handle(request);
    };
    const opening = open(url, { fetch: fakeServer(files).fetch, signal: abort.signal, decode })
      .then(() => 'opened', (error: Error) => error.name);
    expect(await opening).toBe('AbortError');
  });
});

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
    expect(() => pkg.load({} as never, { renderer: {}, gltfLoader: () => ({}), scale: 1.5 } as never))
      .toThrow('scale');
    pkg.dispose();
    expect(all.length).toBeGreaterThan(0);
    expect(all.every((w) => w.ended)).toBe(true);
  });
});
