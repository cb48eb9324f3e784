import { type PerspectiveCamera, Spherical, Vector3 } from 'three';
import { firstLookAzimuthDegrees, firstLookElevationDegrees } from '../format/shared_numbers';

/** A camera's place: degrees round the vertical axis and from it; distance, 1 where the object just fits. */
export interface Orbit {
  thetaDegrees: number;
  phiDegrees: number;
  distance: number;
}
/** From a little above, the front to the left, as posters have it. */
export const defaultOrbit: Orbit =
  { thetaDegrees: firstLookAzimuthDegrees, phiDegrees: 90 - firstLookElevationDegrees, distance: 1 };

const radians = Math.PI / 180;
/** Puts the camera so that it sees a box whole, with its aspect and field of view. Gives the box's middle. */
export function frame(camera: PerspectiveCamera, min: readonly number[], max: readonly number[],
    orbit: Orbit = defaultOrbit): Vector3 {
  const [low, high] = [new Vector3(...min), new Vector3(...max)];
  const centre = low.clone().add(high).multiplyScalar(0.5);
  const radius = Math.max(low.distanceTo(high) / 2, 1e-9);
  const narrow = Math.atan(Math.tan((camera.fov * radians) / 2) * Math.min(1, camera.aspect));
  const distance = (orbit.distance * radius) / Math.sin(narrow);
  camera.position.setFromSpherical(new Spherical(distance, orbit.phiDegrees * radians,
    orbit.thetaDegrees * radians)).add(centre);
  camera.near = distance / 500;
  camera.far = distance * 20;
  camera.lookAt(centre);
  camera.updateProjectionMatrix();
  return centre;
}
