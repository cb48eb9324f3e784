import type { WebGLRenderer } from 'three';
import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import type { LoadEvents } from '../../src/scene/api';
import { GpuRoom } from '../../src/scene/gpu';
import { fakeServer } from '../support/fake_server';
import { decodeNothing, fakeRenderer, loading, until } from '../support/loading';
import { files, turns, url } from '../support/scan';

/** A renderer whose GPU refuses once whenever `refuse` is called, and whose context `lose` takes. */
function scantRenderer(): { renderer: WebGLRenderer; refuse(): void; lose(): void } {
  const renderer = fakeRenderer([]);
  const gl = renderer.getContext();
  let refused = false;
  const getError = (): unknown => {
    const said = refused ? gl.OUT_OF_MEMORY : 0;
    refused = false;
    return said;
  };
  const scant =
    new Proxy(gl, { get: (own, name) => (name === 'getError' ? getError : Reflect.get(own, name)) });
  const domElement = new EventTarget();
  return {
    renderer: Object.assign(renderer, { getContext: () => scant, domElement }) as unknown as WebGLRenderer,
    refuse: () => (refused = true),
    lose: () => domElement.dispatchEvent(new Event('webglcontextlost')),
  };
}

// Previews that are made larger.
const picture = { width: 16, height: 16, close: () => undefined };
beforeEach(() => vi.stubGlobal('createImageBitmap', () => Promise.resolve(picture)));
const decode: typeof decodeNothing = (request) =>
  (request.op === 'enlarge' ? Promise.resolve([[picture], []]) : decodeNothing(request));
afterEach(() => vi.unstubAllGlobals());

it('a GPU that refuses storage gets a smaller picture, as good as the one before, and is asked again',
    async () => {
  const { renderer, refuse } = scantRenderer();
  const l = await loading(url, fakeServer(files), { renderer, decode, autoRefine: false });
  const told: LoadEvents['memory'][] = [];
  l.model.on('memory', (event) => told.push(event));
  await l.model.done;
  const bytes = [l.model.state.gpuBytes];
  for (let i = 0; i < 2; ++i) {
    const { planes } = l.model.state;
    refuse();
    void GpuRoom.of(renderer).ask();
    expect(await until(() => told.length > i)).toBe(true);
    expect(told[i].limitBytes).toBeCloseTo(0.75 * bytes[i], -1);
    expect(told[i].gpuBytes).toBeLessThanOrEqual(told[i].limitBytes);
    bytes.push(l.model.state.gpuBytes);
    expect(l.model.state.planes.length).toBe(planes.length);
    // Previews are no picture to stay with: of every texture most fragments are there again.
    for (const p of l.model.state.planes)
      expect([...p.rungs].filter((rung) => rung >= 0).length).toBeGreaterThan(0.5 * p.rungs.length);
  }
  expect(l.events.filter((e) => e.name === 'error')).toEqual([]);
  l.dispose();
  refuse();
  await GpuRoom.of(renderer).ask(); // nobody is left
  expect(told.length).toBe(2);
});

it('a GPU that has something to do is asked when it rests', async () => {
  const { renderer } = scantRenderer();
  const gl = renderer.getContext();
  let [busy, asked] = [true, 0];
  const getError = (): number => {
    ++asked;
    return 0;
  };
  const answers = {
    fenceSync: () => ({}), isSync: () => true, getSyncParameter: () => (busy ? 'UNSIGNALED' : 'SIGNALED'),
    getError,
  };
  const working = new Proxy(gl, { get: (own, name) => Reflect.get(name in answers ? answers : own, name) });
  const room = GpuRoom.of(Object.assign(renderer, { getContext: () => working }));
  room.add({ gpuBytes: () => 1e6 });
  const done = room.ask();
  await new Promise((go) => setTimeout(go, 1500)); // longer than a fence is waited for
  expect(asked).toBe(0);
  busy = false;
  await done;
  expect(asked).toBeGreaterThan(0);
});

it('a context that is lost with much in it lowers the limit; one with little in it does not', async () => {
  const { renderer, lose } = scantRenderer();
  const room = GpuRoom.of(renderer);
  expect(GpuRoom.of(renderer)).toBe(room);
  const leave = room.add({ gpuBytes: () => 20e6 });
  lose();
  expect(room.limitBytes).toBe(Infinity);
  room.add({ gpuBytes: () => 44e6 });
  lose();
  expect(room.limitBytes).toBe(32e6);
  lose();
  expect(room.limitBytes).toBe(24e6); // never as much again
  leave();
  lose();
  expect(room.limitBytes).toBe(18e6);
});

it('where nothing helps, nobody is asked again and again', async () => {
  const { renderer, refuse } = scantRenderer();
  const room = GpuRoom.of(renderer);
  let refusals = 0;
  room.add({ gpuBytes: () => 1.2e6, refused: () => ++refusals });
  for (let i = 0; i < 4; ++i) {
    refuse();
    await Promise.all([room.ask(), room.ask()]);
  }
  await turns();
  expect([refusals, room.limitBytes]).toEqual([1, 1e6]);
});
