import { type BufferGeometry, type EventDispatcher, type Material, type Mesh, PerspectiveCamera,
  SphereGeometry } from 'three';
import { describe, expect, it } from 'vitest';
import { scaleBytes, textureBytes } from '../../src/decide/gpu_size';
import { selectScale, stepFunction } from '../../src/decide/viewing';
import { leastTrianglePx2 } from '../../src/format/shared_numbers';
import { InputError, PackageReader } from '../../src/reader';
import { fakeServer } from '../support/fake_server';
import { golden } from '../support/files';
import { fakeGltf, loading, Loading, until } from '../support/loading';
import { container, files, url } from '../support/scan';

const reader = await PackageReader.openBytes(container, 'golden');
const planes = await reader.textures();
const top = planes[0].rungQuality.length - 1;
const rungsOf = (l: Loading, base = 0): number[] =>
  [...l.model.state.planes.find((p) => p.base === base)!.rungs];
/** Requests for bytes of these entries. */
const askedFor = (l: Loading, ...refs: { offset: number; bytes: number }[]): number =>
  l.pkg.requests.filter((q) =>
    refs.some((r) => q.offset < r.offset + r.bytes && q.offset + q.bytes > r.offset)).length;
const packs = (await reader.planeFiles(0)).packs;
const within = (range: [number, number] | undefined, e: { offset: number; bytes: number }): boolean =>
  range !== undefined && range[0] < e.offset + e.bytes && range[1] >= e.offset;

describe('a load', () => {
  it('shows everything that there is', async () => {
    const l = await loading(url, fakeServer(files));
    await l.model.done;
    expect(l.count('error')).toBe(0);
    expect(l.model.state.planes.length).toBe(planes.filter((p) => p.mip === 0).length);
    expect(l.count('fragment')).toBe(l.uploads.length);
    expect(l.model.state.scale).toBe(0);
    l.dispose();
  });
  it('that is cancelled stays so, whoever asks for more', async () => {
    const server = fakeServer(files);
    const l = await loading(url, server);
    await l.model.done;
    await l.model.refine();
    expect(l.model.state.phase).toBe('done');
    l.model.cancel();
    const asked = server.log.length;
    await l.model.refine();
    expect([l.model.state.phase, server.log.length]).toEqual(['cancelled', asked]);
    l.dispose();
  });
  it('takes the scale that the visible part asks for (Fig. 7.5)', async () => {
    // an error may be no more than half of its 2 px
    const narrow = { widthPx: 300, heightPx: 2, clipped: true };
    const nothing = { widthPx: 0, heightPx: 0, clipped: true };
    const wanted: number[] = [];
    for (const display of [{ heightPx: 20 }, { heightPx: 20, part: narrow }, { heightPx: 4000 },
          { heightPx: 4000, part: nothing }]) {
      const l = await loading(url, fakeServer(files), { display, rule: 'jnd' });
      await l.model.done;
      wanted.push(l.model.state.wantedScale);
      await l.model.refine();
      wanted.push(l.model.state.wantedScale);
      l.dispose();
    }
    const coarsest = reader.manifest.scales.at(-1)!.scale;
    expect(wanted).toEqual([coarsest, coarsest, 0, 0, 0, 0, coarsest, coarsest]);
  });
  it('in the time given sees to what the camera looks at', async () => {
    const { columns } = planes[0];
    const mean = (values: number[]): number => values.reduce((sum, v) => sum + v, 0) / values.length;
    for (const side of [1, -1]) {
      const camera = new PerspectiveCamera(30, 1, 0.1, 100);
      camera.position.set(0, 0, 5 * side);
      camera.lookAt(0, 0, 0);
      const gltfLoader = () => ({ register: () => undefined,
        parseAsync: () => Promise.resolve(fakeGltf(new SphereGeometry(1, 64, 32))) });
      const l = await loading(url, fakeServer(files),
        { camera, gltfLoader, time: 4, fullSize: true, autoRefine: false }, { capBytesS: 25000 });
      await l.model.done;
      // The half of a ball at +z has the texture's left half.
      const middle = (f: number): number => ((f % columns) + 0.5) / columns - 0.5;
      const rungs = rungsOf(l);
      const [seen, unseen] = [side, -side].map((s) =>
        mean(rungs.filter((_, f) => middle(f) * s < 0 && Math.abs(middle(f)) < 0.4)));
      expect(seen).toBeGreaterThan(unseen);
      l.dispose();
    }
  });
  it('keeps its scale when the display changes by less than a tenth in the timed part', async () => {
    const rule = 'jnd'; // by pictures a finer scale may come
    const [step, finer] = stepFunction(reader.manifest.scales, rule);
    for (const [from, to, scale] of [[0.98, 1.05, step.scale], [0.98, 1.15, finer.scale],
          [1.02, 0.95, finer.scale], [1.02, 0.85, step.scale]]) {
      let px = from * step.upToPx;
      const l = await loading(url, fakeServer(files), { time: 3, rule, display: () => px });
      const taken: number[] = [];
      l.model.on('decision', () => {
        if (taken.length > 0) return;
        taken.push(l.model.state.wantedScale);
        expect(l.count('deadline')).toBe(0);
        px = to * step.upToPx;
        l.model.update();
      });
      await l.model.done;
      await l.model.refine();
      expect(taken).toEqual([from < 1 ? step.scale : finer.scale]);
      expect([from, to, l.model.state.wantedScale]).toEqual([from, to, scale]);
      l.dispose();
    }
  });
  it('takes a finer scale where time is left, and keeps it as long as its triangles show', async () => {
    const { scales, steps: [{ scale, upToPx }] } = reader.manifest;
    let px = upToPx;
    const l = await loading(url, fakeServer(files), { time: 3, autoRefine: false, display: () => px });
    await l.model.done;
    expect(l.model.state.wantedScale).toBe(0);
    const leastPx = Math.sqrt(leastTrianglePx2 * scales[0].triangles);
    for (const [now, least, most] of [[leastPx + 0.01, 0, 0], [leastPx / 1.2, 1, scale], [1, scale, scale]]) {
      px = now;
      l.model.update();
      expect(l.model.state.wantedScale).toBeGreaterThanOrEqual(least);
      expect(l.model.state.wantedScale).toBeLessThanOrEqual(most);
    }
    l.dispose();
  });
  it('refines the mesh, too', async () => {
    const { steps: [{ scale, upToPx }] } = reader.manifest;
    for (const rule of ['flip', 'edge'] as const) {
      const l = await loading(url, fakeServer(files),
        { time: 0, rule, autoRefine: false, display: () => upToPx });
      await l.model.done;
      const before = l.model.state.wantedScale;
      expect(before).toBeGreaterThanOrEqual(scale);
      await l.model.refine();
      if (rule === 'flip') expect(l.model.state.wantedScale).toBeLessThan(scale);
      else expect(l.model.state.wantedScale).toBe(selectScale(reader.manifest, upToPx, undefined, rule));
      l.dispose();
    }
  });
  it('refines no mesh that takes more than the memory', async () => {
    const { scales, steps: [{ scale, upToPx }] } = reader.manifest;
    const smallest = Math.max(...planes.map((p) => p.mip));
    const leastBytes = scaleBytes(scales.at(-2)!) + planes.filter((p) => p.mip === smallest)
      .reduce((sum, { widthPx, heightPx }) => sum + textureBytes(widthPx, heightPx), 0);
    for (const memoryBytes of [leastBytes - 1, leastBytes, 4e6]) {
      const l = await loading(url, fakeServer(files),
        { time: 0, memoryBytes, autoRefine: false, display: () => upToPx });
      await l.model.done;
      await l.model.refine();
      const { gpuBytes, wantedScale } = l.model.state;
      expect(gpuBytes).toBeLessThanOrEqual(memoryBytes);
      expect([memoryBytes, wantedScale < scale]).toEqual([memoryBytes, memoryBytes >= leastBytes]);
      l.dispose();
    }
  });
  it('lets no view wait for a mesh that refining has asked for', async () => {
    const { steps: [{ scale, upToPx }] } = reader.manifest;
    let px = upToPx / 3, end = (): void => undefined; // small planes do
    const slow = new Promise<void>((go) => (end = go));
    let isSlow = false;
    const parseAsync = () => (isSlow ? slow.then(() => fakeGltf()) : Promise.resolve(fakeGltf()));
    const l = await loading(url, fakeServer(files), { time: 0, autoRefine: false, display: () => px,
      gltfLoader: () => ({ register: () => undefined, parseAsync }) as never });
    await l.model.done;
    isSlow = true;
    const first = l.model.refine();
    expect(await until(() => l.model.state.wantedScale < scale)).toBe(true);
    const before = l.count('plane');
    px = 4000; // asks for larger planes
    l.model.update();
    void l.model.refine();
    expect(await until(() => l.count('plane') > before)).toBe(true);
    expect(l.model.state.scale).toBe(scale);
    end();
    await first;
    expect(l.model.state.scale).toBeLessThan(scale);
    l.dispose();
  });
  it('asks again for a mesh that refining has lost', async () => {
    const { scales, steps: [{ scale, upToPx }] } = reader.manifest;
    const meshes = scales.filter((s) => s.scale < scale).map((s) => s.glb);
    let faults = 0;
    const server = fakeServer(files, { fault: ({ range }) =>
      faults === 0 && meshes.some((m) => within(range, m)) && (++faults, 'status-404') });
    const l = await loading(url, server, { time: 0, autoRefine: false, display: () => upToPx });
    await l.model.done;
    await l.model.refine();
    expect([faults, l.count('error'), l.model.state.wantedScale]).toEqual([1, 1, scale]);
    expect(await until(() => l.model.state.scale < scale)).toBe(true); // two seconds later
    l.dispose();
  });
  it('does not ask again and again for what cannot be had', async () => {
    const server =
      fakeServer(files, { fault: ({ range }) => packs.some((p) => within(range, p)) && 'status-404' });
    const l = await loading(url, server, { time: 1 });
    await l.model.done;
    await l.model.refine();
    expect(Math.max(...rungsOf(l))).toBe(-1);
    expect(askedFor(l, ...packs)).toBeLessThan(200); // 47 fragments of three rungs
    const ranges = l.pkg.requests.filter((q) => packs.some((p) => q.offset >= p.offset &&
      q.offset < p.offset + p.bytes)).map((q) => `${q.offset}+${q.bytes}`);
    expect(new Set(ranges).size).toBe(ranges.length);
    l.dispose();
  });
  for (const [what, fault] of [['damaged', 'flip'], ['missing', 'status-404']] as const)
    it(`shows lower rungs where higher ones are ${what} for ever`, async () => {
      for (const time of [2, Infinity]) {
        const server = fakeServer(files, { fault: ({ range }) => within(range, packs[2]) && fault });
        const l = await loading(url, server, { time });
        await l.model.done;
        await l.model.refine();
        const rungs = rungsOf(l).filter((r) => r >= 0);
        expect(rungs.length).toBeGreaterThan(40);
        expect(rungs).not.toContain(fault === 'flip' ? -1 : 2);
        const before = server.log.length;
        await l.model.refine();
        expect(server.log.length).toBe(before);
        l.dispose();
      }
    });
  it('asks again for what could not be had for a while', async () => {
    let down = true;
    const server = fakeServer(files,
      { fault: ({ range }) => down && packs.some((p) => within(range, p)) && 'status-500' });
    const l = await loading(url, server, { autoRefine: false });
    await l.model.done;
    expect(Math.max(...rungsOf(l))).toBe(-1);
    down = false;
    await l.model.refine();
    expect(Math.max(...rungsOf(l))).toBe(top);
    l.dispose();
  });
  it('shows the rung of an override in place of a higher one, and asks once', async () => {
    const server = fakeServer(files);
    const l = await loading(url, server);
    await l.model.done;
    const highest = rungsOf(l);
    const above = l.model.state.planes.flatMap((p) => [...p.rungs]).filter((r) => r > 0).length;
    l.events.length = 0;
    l.model.setOverride({ rung: 0 });
    await l.model.refine();
    expect(rungsOf(l)).toEqual(highest.map((r) => Math.min(r, 0)));
    expect(l.count('fragment')).toBe(above);
    const before = server.log.length;
    await l.model.refine();
    expect(server.log.length).toBe(before);
    l.model.setOverride({});
    await l.model.refine();
    expect(Math.max(...rungsOf(l))).toBe(top);
    l.dispose();
  });
  it('takes no rung that is none', async () => {
    const server = fakeServer(files);
    for (const rung of [1.5, -1, NaN, Infinity])
      await expect(loading(url, server, { rung })).rejects.toThrow(InputError);
    const l = await loading(url, server, { autoRefine: false });
    expect(() => l.model.setOverride({ rung: 0.5 })).toThrow(InputError);
    l.dispose();
  });
  it('does what is asked for when it says that it is done', async () => {
    const l = await loading(url, fakeServer(files), { rung: 0 });
    let asked: Promise<void> | undefined;
    l.model.on('done', () => {
      if (asked) return;
      l.model.setOverride({ rung: 2 });
      asked = l.model.refine();
    });
    await until(() => asked !== undefined);
    await asked;
    expect(Math.max(...rungsOf(l))).toBe(2);
    expect(l.model.state.phase).toBe('done');
    l.dispose();
  });
  it('asks for a scale again that could not be had, though nothing moves', async () => {
    const [finest] = reader.manifest.scales;
    let times = 0;
    const server =
      fakeServer(files, { fault: ({ range }) => within(range, finest.glb) && ++times === 1 && 'status-404' });
    const l = await loading(url, server);
    await l.model.done;
    await l.model.refine();
    expect(l.model.state.scale).toBe(reader.manifest.scales.at(-1)!.scale);
    expect(await until(() => l.model.state.scale === finest.scale)).toBe(true);
    expect(times).toBe(2);
    l.dispose();
  });
  it('without workers says so once, and fetches no fragment for nothing', async () => {
    const server = fakeServer(files);
    // Node.js has no Worker of the web's kind
    const l = await loading(url, server, { decode: undefined, workers: 1 });
    await l.model.done;
    await l.model.refine();
    const errors = l.events.flatMap((e) => (e.name === 'error' ? [e.event] : []));
    expect(errors.map((e) => e.what)).toEqual(['workers']);
    expect(askedFor(l, ...packs)).toBe(0);
    l.dispose();
  });
});

/** Which of these are told that they are disposed of from now on. */
function watched(all: readonly unknown[]): Set<unknown> {
  const told = new Set<unknown>();
  for (const one of all)
    (one as EventDispatcher<{ dispose: object }>).addEventListener('dispose', () => told.add(one));
  return told;
}

it('a load that is disposed of frees textures, materials and geometries, and hears of nothing any more',
    async () => {
  const server = fakeServer(files);
  const l = await loading(url, server, { autoRefine: false });
  await l.model.done;
  const meshes: Mesh[] = [];
  l.model.object.traverse((o) => void ((o as Mesh).isMesh && meshes.push(o as Mesh)));
  const materials: Material[] = [...l.model.materials];
  const geometries: BufferGeometry[] = meshes.map((m) => m.geometry);
  const textures = l.model.state.planes.flatMap((p) => [...p.textures]);
  expect([materials, geometries, textures].every((all) => all.length > 0)).toBe(true);
  const all = [...materials, ...geometries, ...textures];
  const told = watched(all);
  l.model.dispose();
  expect(all.filter((one) => !told.has(one))).toEqual([]);
  expect([l.model.object.children, l.model.state.planes]).toEqual([[], []]);
  const before = l.count('request');
  const asked = server.log.length;
  await l.pkg.scaleGlb(0);
  expect(l.count('request')).toBe(before);
  expect(l.pkg.client.listeners.size).toBe(0);
  expect(server.log.length).toBeGreaterThan(asked);
  l.dispose();
});

it.each(['v2.0-proxies', 'v2.0-scan'])(
    'a turn without time leaves the first picture of %s, until somebody refines', async (name) => {
  const server = fakeServer({ '/a/scan.texmesh': golden(name) });
  const l = await loading(url, server, { turn: () => Promise.resolve({ seconds: 0 }), autoRefine: false });
  await l.model.done;
  expect(l.model.state).toMatchObject({ proxy: name === 'v2.0-proxies' ? 0 : -1, phase: 'done', planes: [] });
  expect(l.pkg.requests.some((q) => q.kind === 'texture')).toBe(false);
  await l.model.refine();
  expect(l.model.state.scale).toBeGreaterThanOrEqual(0);
  expect(l.model.state.planes.length).toBeGreaterThan(0);
  l.dispose();
});
