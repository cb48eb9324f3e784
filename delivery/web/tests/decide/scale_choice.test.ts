import { expect, it } from 'vitest';
import { finerWhereSeen } from '../../src/decide/scale_choice';

it('a finer scale is taken while it was measured to be seen', () => {
  const ssim = Float32Array.from([0.9, 0.999, 0.89, 0.998, 0.88, 0.97, 0.8, 0.9]);
  const table = { views: 4, sizePx: 192, scales: [0, 2, 5, 9], rungs: [10, 90], ssim, difference: ssim };
  expect(finerWhereSeen(table, 9, 400)).toBe(2);
  expect(finerWhereSeen(table, 2, 400)).toBe(2);
  expect(finerWhereSeen(table, 9, 100)).toBe(9); // smaller than it was measured at
  expect(finerWhereSeen(table, 7, 400)).toBe(7); // not in the table
});
