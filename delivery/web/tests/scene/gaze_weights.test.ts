import { Group, Mesh, MeshStandardMaterial, PerspectiveCamera, PlaneGeometry, WebGLRenderer } from 'three';
import { describe, expect, it } from 'vitest';
import { acuityAt, gazeWeight, gazeWeights } from '../../src/scene/gaze_weights';
import type { TextureInfo } from '../../src/format/textures';

describe('acuity', () => {
  it('is full in the fovea, half 2.3 degrees beyond, and falls from there on', () => {
    expect(acuityAt(0)).toBe(1);
    expect(acuityAt(0.5)).toBe(1);
    expect(acuityAt(2.8)).toBeCloseTo(0.5, 12);
    expect(gazeWeight(2.8)).toBeCloseTo(0.25, 12);
    for (let d = 0.6; d < 60; d += 0.5) expect(acuityAt(d)).toBeLessThan(acuityAt(d - 0.1));
    expect(acuityAt(Infinity)).toBe(0);
  });
});

describe('the gaze', () => {
  // A square that fills the picture, with a texture of 8 x 8 fragments.
  const square = new Mesh(new PlaneGeometry(2, 2, 64, 64), new MeshStandardMaterial());
  const shown = { object: new Group().add(square), shows: () => true };
  const plane = { columns: 8, rows: 8, widthPx: 512, heightPx: 512, fragmentWidthPx: 64,
    fragmentHeightPx: 64 } as TextureInfo;
  const camera = new PerspectiveCamera(90, 1, 0.1, 100);
  camera.position.set(0, 0, 1);
  camera.updateMatrixWorld();
  const renderer = { getDrawingBufferSize: (to: { set(x: number, y: number): unknown }) =>
    to.set(800, 800) } as unknown as WebGLRenderer;
  const weightsAt = (x: number, y: number, pxPerDegree?: number): Float32Array =>
    gazeWeights(plane, shown, camera, renderer, { x, y, pxPerDegree });
  /** u, v of the square's texture: three.js has v upwards, the fragments count rows of v from 0. */
  const fragmentOf = (x: number, y: number): number =>
    Math.floor(((y + 1) / 2) * 8) * 8 + Math.floor(((x + 1) / 2) * 8);

  it('weighs most what is looked at, and less the farther away it is', () => {
    for (const [x, y] of [[-0.8, 0.6], [0.1, 0.1], [0.9, -0.9]]) {
      const weights = weightsAt(x, y);
      expect(weights.indexOf(Math.max(...weights))).toBe(fragmentOf(x, y));
    }
    const row = weightsAt(-0.99, 0.1).slice(fragmentOf(-0.99, 0.1), fragmentOf(-0.99, 0.1) + 8);
    for (let i = 1; i < 8; ++i) expect(row[i]).toBeLessThan(row[i - 1]);
  });
  it('has the weight of the angle that a fragment stands at', () => {
    // Each fragment is 100 px: the one three to the right of the gaze is about 300 px, 6 degrees, away.
    const weights = weightsAt(-0.875, 0.125, 50);
    expect(weights[fragmentOf(-0.125, 0.125)]).toBeCloseTo(gazeWeight(6), 2);
  });
  it('sees all alike where a degree has more pixels than the picture', () => {
    const weights = weightsAt(0, 0, 1e6);
    expect(Math.min(...weights)).toBe(1);
  });
  it('gives fragments without a sample the mean, and an object without one weight 1', () => {
    const none = gazeWeights(plane, { ...shown, shows: () => false }, camera, renderer, { x: 0, y: 0 });
    expect(Math.min(...none)).toBe(1);
    const finer = { ...plane, columns: 800, fragmentWidthPx: 1, widthPx: 800 } as TextureInfo;
    const weights = gazeWeights(finer, shown, camera, renderer, { x: 0, y: 0 });
    expect(Math.min(...weights)).toBeGreaterThan(0);
  });
  it('looks at a surface where it would stand', () => {
    const within = new Group();
    within.position.set(0.5, 0.25, 0);
    within.updateMatrixWorld();
    const moved = gazeWeights(plane, { ...shown, within }, camera, renderer, { x: 0.6, y: 0.35 });
    expect(moved.indexOf(Math.max(...moved))).toBe(fragmentOf(0.1, 0.1));
  });
});
