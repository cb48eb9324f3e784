import { describe, expect, it } from 'vitest';
import { type DeliveryPlan, defaultDeliveryRequest, planDelivery } from '../../src/decide/delivery_plan';
import { proxyAhead } from '../../src/decide/proxy_steps';
import type { Manifest } from '../../src/format/manifest';
import type { PackageData } from '../../src/format/tables';
import { setUp } from '../support/transferring';

describe('the scale', () => {
  it('is the wanted one when time is plenty, the coarsest when there is none', async () => {
    const { data } = await setUp();
    const at = (timeLimitS: number, scale = -1) => {
      const base = defaultDeliveryRequest();
      return planDelivery(data, { ...base, displayedPx: 1e6, timeLimitS, scale });
    };
    const coarsest = data.manifest.scales[data.manifest.scales.length - 1].scale;
    const late = at(1e-3)!, asked = at(1e-3, 0)!;
    expect(at(1e3)!.scale).toBe(0);
    expect(at(1e3)!.leftS).toBeGreaterThan(0);
    expect([late.scale, late.leftS < 0]).toEqual([coarsest, true]);
    expect([asked.scale, asked.leftS < 0]).toEqual([0, true]);
    expect(at(1e3, 98)).toBeUndefined();
  });
});

describe('memory', () => {
  it('is kept by coarser scales and mips, and nothing is worse for more of it', async () => {
    const { data } = await setUp();
    const at = (memoryBytes?: number) =>
      planDelivery(data, { ...defaultDeliveryRequest(), timeLimitS: 100, memoryBytes })!;
    const taken = ({ gpuBytes: { mesh, textures } }: DeliveryPlan): number => mesh + textures;
    const all = at();
    let before = all;
    for (const share of [1, 0.7, 0.4]) {
      const now = at(share * taken(all));
      expect(taken(now)).toBeLessThanOrEqual(share * taken(all));
      expect(now.flip).toBeGreaterThanOrEqual(before.flip - 1e-9);
      before = now;
    }
    expect(at(1).scale).toBe(data.manifest.scales.at(-1)!.scale);
  });
});

describe('a larger proxy on the way', () => {
  const glb = (offset: number, bytes: number) => ({ path: '', offset, bytes, sha256: new Uint8Array(32) });
  const proxy = (offset: number, bytes: number, flip: number) =>
    ({ glb: glb(offset, bytes), triangles: 1, vertices: 3, texturePx: 0, flip: [flip], flipP95: [1] });
  it('comes where documents take long, delays what follows, and is nobody\'s choice by hand', async () => {
    const { data } = await setUp();
    // Tables behind a megabyte: scales come late.
    const manifest = { ...data.manifest, proxySizesPx: [1000], proxies: [proxy(3000, 20000, 0.9),
      proxy(100000, 50000, 0.5)], tables: { ...data.manifest.tables, offset: 1e6 } };
    const ask = { ...defaultDeliveryRequest(), displayedPx: 1000, timeLimitS: 20,
      link: { bytesS: 1e5, rttS: 0.04, connections: 6 } };
    const plan = planDelivery({ ...data, manifest } as PackageData, ask)!;
    expect(plan.proxy).toBeUndefined();
    expect(plan.step?.proxy).toBe(1);
    expect(plan.step!.atS).toBeGreaterThan(plan.firstPictureS);
    expect(plan.step!.atS).toBeLessThan(plan.meshS);
    expect(planDelivery({ ...data, manifest } as PackageData, { ...ask, scale: 0 })!.step).toBeUndefined();
    const one = { ...manifest, proxies: manifest.proxies.slice(0, 1) };
    const without = planDelivery({ ...data, manifest: one } as PackageData, ask)!;
    expect(without.step).toBeUndefined();
    expect(plan.meshS).toBeCloseTo(without.meshS + 0.04 + 0.5, 6);
  });
});

describe('proxies ahead of scales', () => {
  const glb = (bytes: number) => ({ path: '', offset: 1e5, bytes, sha256: new Uint8Array(32) });
  const proxy = (bytes: number, flip: number) => ({ glb: glb(bytes),
    triangles: 1, vertices: 3, texturePx: 0, flip: [flip], flipP95: [1] });
  const manifest = { proxySizesPx: [512], proxies: [proxy(36e3, 0.18), proxy(50e3, 0.14), proxy(150e3, 0.08),
    proxy(250e3, 0.065), proxy(450e3, 0.04)] } as unknown as Manifest;
  const next = (shown: number, leftS: number, flip: number, fits = (_: number) => true): number =>
    proxyAhead(manifest, shown, 512, { bytesS: 250e3, rttS: 0.04, leftS }, { flip, fits });
  it('the largest comes last, behind one that shortens the wait where both come in time', () => {
    expect(next(0, 3.5, 0.05)).toBe(2); // .64 s and 1.84 s
    expect(next(2, 2.86, 0.05)).toBe(4);
    expect(next(0, 2.3, 0.05)).toBe(1); // only the smallest leaves time for the last one
    expect(next(0, 1.9, 0.05)).toBe(4);
    expect(next(4, 9, 0.05)).toBe(-1);
  });
  it('none comes where scales look better, and none that has no room', () => {
    expect(next(0, 3.5, 0.04)).toBe(-1);
    expect(next(0, 1.8, 0.05)).toBe(-1); // the only one that looks better would be late
    expect(next(0, 3.5, 0.07, (k) => k < 4)).toBe(2);
    expect(next(2, 3.5, 0.07, (k) => k < 4)).toBe(3);
  });
});
