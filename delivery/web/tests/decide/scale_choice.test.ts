import { expect, it } from 'vitest';
import { choiceInTime, refinedScale } from '../../src/decide/scale_choice';
import { defaultTimePlan, setUp } from '../support/transferring';

it('a coarser scale is taken where little time is left, and only where it looks better', async () => {
  const { data } = await setUp();
  const choose = (limitS: (scale: number) => number) => {
    const steps = choiceInTime(data, {
      displayedPx: 1000, wanted: 0, connections: 6,
      afterMesh: (scale) => ({ plan: { ...defaultTimePlan, timeLimitS: limitS(scale) }, linkBytesS: 1e5 }),
    });
    for (;;) {
      const { done, value } = steps.next();
      if (done) return value!;
    }
  };
  expect(choose(() => 100).scale).toBe(0);
  const rushed = choose((scale) => (scale === 0 ? 0 : 100));
  expect(rushed.scale).toBeGreaterThan(0);
  expect(rushed.leftS).toBe(100);
  expect(rushed.flip).toBeGreaterThan(rushed.textureFlip);
});

it('a finer scale than enough is taken where it leaves time, and never where one is asked for', async () => {
  const { data } = await setUp();
  const enough = data.manifest.scales[2].scale;
  const choose = (limitS: (scale: number) => number, more: object) => {
    const steps = choiceInTime(data, {
      displayedPx: 1000, wanted: enough, connections: 6, ...more,
      afterMesh: (scale) => ({ plan: { ...defaultTimePlan, timeLimitS: limitS(scale) }, linkBytesS: 1e5 }),
    });
    for (;;) {
      const { done, value } = steps.next();
      if (done) return value!.scale;
    }
  };
  expect(choose(() => 100, {})).toBe(enough);
  expect(choose(() => 100, { finest: 0 })).toBe(0);
  expect(choose(() => 100, { finest: 0, only: true })).toBe(enough);
  expect(choose((scale) => (scale < enough ? 49 : 100), { finest: 0 })).toBe(enough);
  expect(choose(() => -1, { finest: 0 })).toBeGreaterThanOrEqual(enough); // late, all of them
});

it('refining ends with the coarsest scale that hardly differs from the finest', async () => {
  const { data } = await setUp();
  const { scales } = data.manifest;
  const rows = (of: (scale: number) => number) => {
    const flip = Float32Array.from(data.quality.scales, of);
    const geometry = data.quality.geometry.map((g) => ({ ...g, flip }));
    return { ...data, quality: { ...data.quality, geometry } };
  };
  const coarsest = scales.filter((s) => s.scale <= 10).at(-1)!.scale;
  expect(refinedScale(rows((s) => 0.001 * s), 500, 0)).toBe(coarsest);
  expect(refinedScale(rows((s) => (s ? 0.02 : 0)), 500, 0)).toBe(0);
  expect(refinedScale(rows((s) => (s ? 0.02 : 0)), 500, scales[1].scale)).toBe(scales[1].scale);
});
