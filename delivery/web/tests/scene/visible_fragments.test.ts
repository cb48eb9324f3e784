import { BackSide, DoubleSide, FrontSide, Group, Mesh, MeshStandardMaterial, PerspectiveCamera,
  SphereGeometry } from 'three';
import { describe, expect, it } from 'vitest';
import type { TextureInfo } from '../../src/format/textures';
import { seenShares } from '../../src/scene/visible_fragments';

describe('the visible surface', () => {
  const sphere = new Mesh(new SphereGeometry(1, 64, 32), new MeshStandardMaterial());
  const root = new Group().add(sphere);
  const plane = { columns: 4, rows: 1, widthPx: 64, heightPx: 16, fragmentWidthPx: 16,
    fragmentHeightPx: 16 } as TextureInfo;
  const seenBy = (eye: PerspectiveCamera): Float32Array =>
    seenShares(plane, { object: root, shows: () => true }, eye);
  const camera = new PerspectiveCamera(45, 1, 0.1, 100);
  camera.position.set(0, 0, 5);
  camera.lookAt(0, 0, 0);
  camera.updateMatrixWorld();
  it('is what is turned to the camera', () => {
    const seen = seenBy(camera);
    // u runs from -x over +z, +x to -z: the camera at +z sees the quarters around it.
    expect(seen[0]).toBeGreaterThan(0.2);
    expect(seen[1]).toBeGreaterThan(0.2);
    expect(seen[0] + seen[1]).toBeGreaterThan(2.5 * (seen[2] + seen[3]));
  });
  it('is also what is turned away, where a material has two sides; only that, where it has the back', () => {
    const { material } = sphere;
    const front = seenBy(camera);
    material.side = DoubleSide; // applications may change it at any time
    expect(Math.min(...seenBy(camera))).toBeGreaterThan(0.9);
    material.side = BackSide;
    const back = seenBy(camera);
    back.forEach((share, f) => expect(share + front[f]).toBeCloseTo(1, 2));
    material.side = FrontSide;
  });
  it('is the same of a mirrored mesh, in a mirrored object, too: three.js turns both', () => {
    for (const mirrored of [sphere, root]) {
      mirrored.scale.z = -1;
      mirrored.updateMatrixWorld(true);
      root.updateMatrixWorld(true);
      const seen = seenBy(camera);
      expect(seen[2] + seen[3]).toBeGreaterThan(2.5 * (seen[0] + seen[1])); // what was behind is in front
      mirrored.scale.z = 1;
      root.updateMatrixWorld(true);
    }
  });
  it('is the same of a mesh that would stand in an object', () => {
    const place = new Group();
    place.rotation.y = Math.PI; // what was behind is in front
    place.updateMatrixWorld();
    const seen = seenShares(plane,
      { object: new Group().add(sphere.clone()), shows: () => true, within: place }, camera);
    expect(seen[2] + seen[3]).toBeGreaterThan(2.5 * (seen[0] + seen[1]));
  });
  it('of a mesh that does not show the plane may be seen or not', () => {
    expect([...seenShares(plane, { object: root, shows: () => false }, camera)])
      .toEqual([0.5, 0.5, 0.5, 0.5]);
  });
  it('ends at the border of the view', () => {
    const away = camera.clone();
    away.lookAt(5, 0, 5);
    away.updateMatrixWorld();
    expect(Math.max(...seenBy(away))).toBe(0);
  });
});
