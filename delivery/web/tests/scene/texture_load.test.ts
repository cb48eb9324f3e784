import { describe, expect, it } from 'vitest';
import { type Fault, fakeServer } from '../support/fake_server';
import { golden } from '../support/files';
import { type Loading, loading, until } from '../support/loading';
import { PackageReader } from '../../src/reader';
import type { LoadOptions } from '../../src/scene/api';
import { files, url } from '../support/scan';

it('who gives up an override in the timed part does not ask for everything', async () => {
  const server = fakeServer(files);
  const l = await loading(url, server, { rung: 0, time: 5, autoRefine: false });
  expect(await until(() => l.pkg.requests.some((q) => q.kind === 'texture'))).toBe(true);
  l.model.setOverride({});
  let inTime = -1;
  l.model.on('deadline', () => (inTime = Math.max(...l.model.state.planes.flatMap((p) => [...p.rungs]))));
  await l.model.done;
  expect(inTime).toBe(0);
  l.dispose();
});

it('planes with more texels take the time that is left where all that was chosen has come', async () => {
  const shown: number[][] = [];
  const l =
    await loading(url, fakeServer(files), { time: 3, beta0BytesS: 6000, display: 2000, autoRefine: false });
  l.model.on('plane', ({ base, widthPx }) => (shown[base] ??= []).push(widthPx));
  await l.model.done;
  expect(l.count('deadline')).toBe(1);
  expect(shown.some((px) => px.length > 1)).toBe(true);
  for (const px of shown) expect(px).toEqual([...new Set(px)].sort((a, b) => a - b)); // never fewer texels
  const at = (name: string): number[] => l.events.flatMap((e, i) => (e.name === name ? [i] : []));
  expect(Math.max(...at('plane'))).toBeLessThan(at('deadline')[0]);
  // of the last plane some came, too
  expect(Math.max(...at('fragment'))).toBeGreaterThan(Math.max(...at('plane')));
  expect(l.count('error')).toBe(0);
  l.dispose();
});

describe('a proxy that looks better than scales do in the time', async () => {
  const { manifest } = await PackageReader.openBytes(golden('v2.0-proxies'), 'golden');
  /** 30 kB/s; the proxies are as far from S_0 as `flips` say. Of equal ones none is a step to scales. */
  const [onTheWay, ahead] = [[0.24, 0.005], [0.0051, 0.005]];
  const load = (flips: number[], fault?: Fault, options: Partial<LoadOptions> = {}): Promise<Loading> =>
    loading('http://t/p.texmesh', fakeServer({ '/p.texmesh': golden('v2.0-proxies') }, { fault }),
      { time: 0.8, beta0BytesS: 30e3, display: 500, autoRefine: false, ...options }, {}, (pkg) =>
        pkg.manifest.proxies.forEach(({ flip }, k) => flip.fill(flips[k])));
  /** Proxy, scale and number of textures. */
  const shown = ({ model: { state } }: Loading): number[] => [state.proxy, state.scale, state.planes.length];
  const larger = ({ range }: Parameters<Fault>[0]): boolean => range?.[0] === manifest.proxies[1].glb.offset;
  const finest = ({ range }: Parameters<Fault>[0]): boolean => range?.[0] === manifest.scales[0].glb.offset;
  it.each([onTheWay, ahead])('of %d and %d ends the timed part; refining goes on to scales',
      async (...flips) => {
    const l = await load(flips);
    await l.model.done;
    expect(shown(l)).toEqual([1, -1, 0]);
    expect([l.count('deadline'), l.count('decision')]).toEqual([1, 0]);
    await l.model.refine();
    expect(shown(l)).toEqual([-1, 0, 1]);
    expect(l.count('error')).toBe(0);
    l.dispose();
  });
  it('gives way to a mesh that comes behind the last fragment', async () => {
    let times = 0;
    const l = await load(ahead, (request) => finest(request) && ++times === 1 && 'status-404');
    await l.model.done;
    await l.model.refine();
    expect(shown(l)).toEqual([1, -1, 1]);
    expect(await until(() => l.model.state.scale === 0)).toBe(true); // asked for again
    expect(l.model.state.proxy).toBe(-1);
    l.dispose();
  });
  it.each([onTheWay, ahead])('of %d and %d that does not come leaves the smaller one at the limit',
      async (...flips) => {
    const l = await load(flips, (request) => larger(request) && 'stall');
    const from = performance.now();
    await l.model.done;
    expect(performance.now() - from).toBeLessThan(2000);
    expect(l.model.state.proxy).toBe(0);
    expect(l.count('deadline')).toBe(1);
    l.dispose();
  });
  it('is left alone where no time is left, or a scale is chosen by hand meanwhile', async () => {
    for (const options of [{ time: 0 }, { time: 0, scale: 1 }, { time: 0, policy: 'thesis' as const }]) {
      const l = await load(ahead, undefined, options);
      await l.model.done;
      expect(l.count('deadline')).toBe(1);
      l.dispose();
    }
    const l = await load(ahead, (request) => larger(request) && 'stall');
    expect(await until(() => l.count('proxy') > 0)).toBe(true);
    setTimeout(() => l.model.setOverride({ scale: 2 }), 100);
    await l.model.done;
    await l.model.refine();
    expect(await until(() => l.model.state.scale === 2)).toBe(true);
    l.dispose();
  });
  it('that cannot be had leaves the time to scales', async () => {
    const l = await load(onTheWay, (request) => larger(request) && 'status-404');
    await l.model.done;
    expect(l.count('decision')).toBeGreaterThan(0);
    expect(l.model.state.proxy).toBe(-1);
    l.dispose();
  });
  it('shows nothing any more when it is cancelled on its way', async () => {
    const l = await load(ahead, (request) => larger(request) && 'stall');
    expect(await until(() => l.count('proxy') > 0)).toBe(true);
    setTimeout(() => l.model.cancel(), 100);
    await expect(l.model.done).rejects.toThrow();
    expect(l.model.state.phase).toBe('cancelled');
    expect(l.count('deadline')).toBe(0);
    l.dispose();
  });
  it('is not for policy thesis, nor where scales look better', async () => {
    for (const l of [await load(ahead, undefined, { policy: 'thesis' }), await load([0.24, 0.2])]) {
      await l.model.done;
      expect(l.count('decision')).toBeGreaterThan(0);
      l.dispose();
    }
  });
});
