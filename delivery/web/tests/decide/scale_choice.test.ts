import { expect, it } from 'vitest';
import { choiceInTime } from '../../src/decide/scale_choice';
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
  expect(rushed).toMatchObject({ late: false });
  expect(rushed.flip).toBeGreaterThan(rushed.textureFlip);
});
