import { Box3, Camera, Matrix4, Object3D, OrthographicCamera, PerspectiveCamera, Vector2, Vector3, WebGLRenderer } from 'three';
import type { Display } from './api';
import type { Manifest } from './manifest';
import { clipTo, displayedHeightPx } from './viewing';

/** How a camera shows the object: displayed height in device px, and what of it is seen (Fig. 7.5). */
export function displayOf(manifest: Manifest, object: Object3D, camera: Camera, renderer: WebGLRenderer): Display {
  object.updateWorldMatrix(true, false);
  camera.updateWorldMatrix(true, false);
  const size = renderer.getDrawingBufferSize(new Vector2());
  const box = new Box3(new Vector3(...manifest.boundsMin), new Vector3(...manifest.boundsMax));
  const height = manifest.objectHeight * object.matrixWorld.getMaxScaleOnAxis();
  const part = clipTo(rectOf(box, object.matrixWorld, camera, size), { x0: 0, y0: 0, x1: size.x, y1: size.y });
  const eye = new Vector3().setFromMatrixPosition(camera.matrixWorld);
  const world = box.applyMatrix4(object.matrixWorld);
  if ((camera as OrthographicCamera).isOrthographicCamera) {
    const c = camera as OrthographicCamera;
    return { heightPx: (height * c.zoom * size.y) / Math.abs(c.top - c.bottom), part };
  }
  // Where the object fills the view, what is near the eye decides, not the object's middle.
  const middle = eye.distanceTo(world.getCenter(new Vector3()));
  const near = Math.max(world.distanceToPoint(eye), height / 50);
  const distance = Math.max(part.clipped ? Math.min(near, middle) : middle, 1e-9 * height);
  const fovDegrees = (camera as PerspectiveCamera).getEffectiveFOV?.() ?? 45;
  return { heightPx: displayedHeightPx(height, distance, { fovDegrees, viewportPx: size.y }), part };
}

/** The object's bounds on the screen; a corner behind the eye makes them larger than any screen. */
function rectOf(box: Box3, world: Matrix4, camera: Camera, size: Vector2) {
  const rect = { x0: Infinity, y0: Infinity, x1: -Infinity, y1: -Infinity };
  const toView = new Matrix4().multiplyMatrices(camera.matrixWorldInverse.copy(camera.matrixWorld).invert(), world);
  const corner = new Vector3();
  for (let k = 0; k < 8; ++k) {
    corner.set(
      k & 1 ? box.max.x : box.min.x,
      k & 2 ? box.max.y : box.min.y,
      k & 4 ? box.max.z : box.min.z,
    );
    corner.applyMatrix4(toView);
    if (corner.z >= 0 && !(camera as OrthographicCamera).isOrthographicCamera)
      return { x0: -1e9, y0: -1e9, x1: 1e9, y1: 1e9 };
    corner.applyMatrix4(camera.projectionMatrix);
    const x = ((corner.x + 1) / 2) * size.x;
    const y = ((1 - corner.y) / 2) * size.y;
    rect.x0 = Math.min(rect.x0, x);
    rect.x1 = Math.max(rect.x1, x);
    rect.y0 = Math.min(rect.y0, y);
    rect.y1 = Math.max(rect.y1, y);
  }
  return rect;
}
