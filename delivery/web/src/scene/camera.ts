import { Box3, Camera, Object3D, OrthographicCamera, type Vector2Like, Vector3 } from 'three';
import type { Display } from './api';
import type { Manifest } from '../format/manifest';
import { sampleTriangles } from './scale_parts';

/** Triangles whose first corners are looked at. */
const mostPoints = 600;

/** How a camera shows the object in a picture of `size` px: displayed height, visible part (Fig. 7.5). */
export function displayOf(manifest: Manifest, object: Object3D, camera: Camera, size: Vector2Like): Display {
  object.updateWorldMatrix(true, true);
  camera.updateWorldMatrix(true, false);
  const box = new Box3(new Vector3(...manifest.boundsMin), new Vector3(...manifest.boundsMax));
  const height = manifest.objectHeight * object.matrixWorld.getMaxScaleOnAxis();
  const eye = new Vector3().setFromMatrixPosition(camera.matrixWorld);
  const orthographic = (camera as OrthographicCamera).isOrthographicCamera;
  const screen = new Box3(new Vector3(-1, -1, -Infinity), new Vector3(1, 1, Infinity));
  const rect = new Box3();
  let [near, outside, all] = [Infinity, 0, 0];
  const countPoint = (p: Vector3): void => {
    near = Math.min(near, eye.distanceTo(p));
    // A point behind the eye makes the object larger than any screen.
    const behind = p.applyMatrix4(camera.matrixWorldInverse).z >= 0 && !orthographic;
    p.applyMatrix4(camera.projectionMatrix);
    if (behind) for (const far of [-1e9, 1e9]) rect.expandByPoint(p.setScalar(far));
    rect.expandByPoint(p);
    ++all;
    if (!screen.containsPoint(p)) ++outside;
  };
  // The mesh decides about what is cut off; until a mesh is there, the corners of its bounding box decide.
  const p = new Vector3();
  sampleTriangles(object, mostPoints, ({ geometry, matrixWorld }, [corner]) =>
    countPoint(p.fromBufferAttribute(geometry.attributes.position, corner).applyMatrix4(matrixWorld)));
  for (let k = 0, none = all === 0; none && k < 8; ++k) {
    p.set(k & 1, (k >> 1) & 1, k >> 2).multiply(box.getSize(new Vector3())).add(box.min);
    countPoint(p.applyMatrix4(object.matrixWorld));
  }
  const clipped = !screen.containsBox(rect);
  const seen = rect.intersect(screen).getSize(new Vector3());
  const part = { widthPx: (seen.x * size.x) / 2, heightPx: (seen.y * size.y) / 2, clipped };
  const middle = eye.distanceTo(box.getCenter(new Vector3()).applyMatrix4(object.matrixWorld));
  // The more is cut off, the more the points near the eye decide, not the object's middle.
  const share = Math.min(1, (2 * outside) / all);
  const distance = middle + share * Math.min(0, Math.max(near, height / 50) - middle);
  // The projection tells how much of half the picture a length takes: at the distance 1, or at all.
  const perLength = (camera.projectionMatrix.elements[5] * size.y) / 2 /
    (orthographic ? 1 : Math.max(distance, 1e-9 * height));
  return { heightPx: height * Math.abs(perLength), part };
}
