import { PerspectiveCamera, Vector3 } from 'three';
import { expect, it } from 'vitest';
import { firstLookFovDegrees } from '../../src/format/shared_numbers';
import { frame } from '../../src/page/framing';

it('the whole box is in the picture, as large as may be, from wherever', () => {
  for (const aspect of [0.4, 1, 2.5])
    for (const [thetaDegrees, phiDegrees] of [[0, 90], [28, 72], [200, 20]]) {
      const camera = new PerspectiveCamera(32, aspect, 0.01, 100);
      const middle = frame(camera, [-1, 0, 2], [3, 1, 4], { thetaDegrees, phiDegrees, distance: 1 });
      expect(middle.toArray()).toEqual([1, 0.5, 3]);
      camera.updateMatrixWorld();
      const most = Math.max(...[0, 1, 2, 3, 4, 5, 6, 7].flatMap((k) => {
        const corner = new Vector3(k & 1 ? 3 : -1, k & 2 ? 1 : 0, k & 4 ? 4 : 2).project(camera);
        return [Math.abs(corner.x), Math.abs(corner.y)];
      }));
      expect(most).toBeLessThanOrEqual(1);
      expect(most).toBeGreaterThan(0.2);
    }
});
it('a point has a camera, too', () => {
  const camera = new PerspectiveCamera(32, 1, 0.01, 100);
  frame(camera, [1, 1, 1], [1, 1, 1]);
  expect(camera.position.toArray().every(Number.isFinite)).toBe(true);
});

// tests/stages/poster/poster_test.cpp has the same numbers for posters.
it('viewers begin where posters look from', () => {
  const camera = new PerspectiveCamera(firstLookFovDegrees, 1, 0.01, 100);
  frame(camera, [-1, 0, 2], [3, 1, 4]);
  for (const [k, is] of [4.711566046, 3.068762430, 9.980440491].entries())
    expect(camera.position.getComponent(k)).toBeCloseTo(is, 8);
});
