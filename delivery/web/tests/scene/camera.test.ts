import {
  Group, Mesh, MeshStandardMaterial, OrthographicCamera, PerspectiveCamera, SphereGeometry, Vector2, Vector3,
} from 'three';
import { describe, expect, it } from 'vitest';
import { displayedHeightPx, Manifest, PackageReader, selectScale } from '../../src/reader';
import { displayOf } from '../../src/scene/camera';
import { golden } from '../support/files';

const reader = await PackageReader.openBytes(golden('v2.0-scan'), 'golden');
const { manifest } = reader;
const size = (width: number, height: number): Vector2 => new Vector2(width, height);
function lookAt(m: Manifest, heights: number,
    camera = new PerspectiveCamera(45, 1, 0.001, 100)): PerspectiveCamera {
  const middle = m.boundsMin.map((least, i) => (least + m.boundsMax[i]) / 2);
  camera.position.set(middle[0], middle[1], middle[2] + heights * m.objectHeight);
  camera.lookAt(middle[0], middle[1], middle[2]);
  camera.updateMatrixWorld();
  return camera;
}

describe('the display', () => {
  const object = new Group();
  it('is what the camera makes of the object, in device pixels', () => {
    const whole = displayOf(manifest, object, lookAt(manifest, 3), size(800, 600));
    const expected = displayedHeightPx(manifest.objectHeight, 3 * manifest.objectHeight,
      { fovDegrees: 45, viewportPx: 600 });
    expect(whole.heightPx).toBeCloseTo(expected, 3);
    expect(whole.part?.clipped).toBe(false);
    const twice = displayOf(manifest, object, lookAt(manifest, 3), size(1600, 1200));
    expect(twice.heightPx).toBeCloseTo(2 * expected, 3);
  });
  it('grows with the object', () => {
    const large = new Group();
    large.scale.setScalar(2);
    const camera = lookAt(manifest, 30);
    const small = displayOf(manifest, object, camera, size(800, 600)).heightPx;
    expect(displayOf(manifest, large, camera, size(800, 600)).heightPx / small).toBeCloseTo(2, 1);
  });
  it('knows what is cut off, and what is not to be seen at all', () => {
    const near = displayOf(manifest, object, lookAt(manifest, 0.7), size(800, 600));
    expect(near.part).toMatchObject({ clipped: true });
    const away = lookAt(manifest, 3);
    away.rotateY(Math.PI / 3);
    away.updateMatrixWorld();
    const gone = displayOf(manifest, object, away, size(800, 600));
    expect(gone.part).toEqual({ widthPx: 0, heightPx: 0, clipped: true });
    expect(selectScale(manifest, gone.heightPx, gone.part)).toBe(manifest.scales.at(-1)!.scale);
  });
  // A ball that touches all sides of the bounds and none of their corners.
  const centre = manifest.boundsMin.map((least, i) => (least + manifest.boundsMax[i]) / 2) as [number, number,
    number];
  const ball = (share = 0.5): Group => {
    const mesh = new Mesh(new SphereGeometry(share, 48, 24), new MeshStandardMaterial());
    mesh.position.set(...centre);
    mesh.scale.fromArray(manifest.boundsMax.map((most, i) => most - manifest.boundsMin[i]));
    return new Group().add(mesh);
  };
  const middleOf = (heights: number): number =>
    displayedHeightPx(manifest.objectHeight, heights * manifest.objectHeight,
      { fovDegrees: 45, viewportPx: 600 });
  it('of a whole object is whole, whatever is cut off of the corners of its bounds', () => {
    const camera = lookAt(manifest, 3);
    for (let heights = 3; displayOf(manifest, object, camera, size(600, 600)).part?.clipped === false;
      heights *= 0.99) lookAt(manifest, heights, camera);
    const heights = camera.position.distanceTo(new Vector3(...centre)) / manifest.objectHeight;
    const seen = displayOf(manifest, ball(), camera, size(600, 600));
    expect(seen.part?.clipped).toBe(false);
    expect(seen.heightPx).toBeCloseTo(middleOf(heights), 3);
  });
  it('grows without a jump while more and more is cut off', () => {
    const camera = lookAt(manifest, 3);
    let before = displayOf(manifest, ball(), camera, size(600, 600));
    let clipped = 0;
    for (let heights = 3; heights > 0.75; heights *= 0.98) {
      const now = displayOf(manifest, ball(), lookAt(manifest, heights, camera), size(600, 600));
      expect(now.heightPx).toBeGreaterThanOrEqual(before.heightPx);
      expect(now.heightPx / before.heightPx).toBeLessThan(1.12);
      clipped += Number(now.part!.clipped);
      before = now;
    }
    expect(clipped).toBeGreaterThan(5);
    expect(before.heightPx).toBeGreaterThan(1.5 * middleOf(0.75)); // what is near decides
  });
  it('within the bounds counts how far the surface is', () => {
    const inside = displayOf(manifest, ball(0.05), lookAt(manifest, 0.3), size(600, 600));
    expect(inside.heightPx).toBeLessThan(middleOf(0.15));
  });
  it('of an orthographic camera has nothing to do with distance', () => {
    const camera = new OrthographicCamera(-1, 1, 1, -1, 0, 100);
    camera.position.z = 10;
    camera.updateMatrixWorld();
    expect(displayOf(manifest, object, camera, size(800, 600)).heightPx)
      .toBeCloseTo(manifest.objectHeight * 300, 3);
  });
});
