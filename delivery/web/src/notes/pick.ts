// Which point of the object a ray meets. Meshes are gone through triangle by triangle: a million take some ten
// milliseconds, once a click.

import type { Matrix4, Mesh, Object3D, PerspectiveCamera } from 'three';
import type { Point } from '../format/annotations';

/** A point of the object's surface in the coordinates of the package's meshes, and where the surface looks. */
export interface Picked {
  position: Point;
  normal: Point;
}

const minus = (a: Point, b: Point): Point => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const cross = (a: Point, b: Point): Point =>
  [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a: Point, b: Point): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
/** Distance of two points. */
export const distance = (a: Point, b: Point): number => Math.hypot(...minus(a, b));
/** The direction, of length 1; nothing for a point. */
export function unit(a: Point): Point | undefined {
  const length = Math.hypot(...a);
  return length > 0 ? [a[0] / length, a[1] / length, a[2] / length] : undefined;
}
/** A point by a matrix of three.js, column by column. */
export function apply({ elements: m }: Matrix4, [x, y, z]: Point): Point {
  const w = m[3] * x + m[7] * y + m[11] * z + m[15];
  return [(m[0] * x + m[4] * y + m[8] * z + m[12]) / w, (m[1] * x + m[5] * y + m[9] * z + m[13]) / w,
    (m[2] * x + m[6] * y + m[10] * z + m[14]) / w];
}

/** How far along `direction` the ray meets the triangle, from either side; Infinity where it does not. */
export function meets(from: Point, direction: Point, [a, b, c]: [Point, Point, Point]): number {
  const ab = minus(b, a), ac = minus(c, a), across = cross(direction, ac);
  const volume = dot(ab, across);
  if (volume === 0) return Infinity;
  const to = minus(from, a), u = dot(to, across) / volume;
  if (!(u >= 0 && u <= 1)) return Infinity;
  const around = cross(to, ab), v = dot(direction, around) / volume;
  if (!(v >= 0 && u + v <= 1)) return Infinity;
  const t = dot(ac, around) / volume;
  return t > 0 ? t : Infinity;
}

/** The nearest triangle of a mesh on a ray in the mesh's own coordinates. */
function nearestOf(mesh: Mesh, from: Point, direction: Point): { t: number; corners?: [Point, Point, Point] } {
  const { index, attributes: { position } } = mesh.geometry;
  const at = (k: number): Point => {
    const i = index ? index.getX(k) : k;
    return [position.getX(i), position.getY(i), position.getZ(i)];
  };
  let t = Infinity, corners: [Point, Point, Point] | undefined;
  const { start, count } = mesh.geometry.drawRange;
  const end = Math.min(start + count, index ? index.count : position.count);
  for (let k = start; k + 2 < end; k += 3) {
    const triangle: [Point, Point, Point] = [at(k), at(k + 1), at(k + 2)];
    const here = meets(from, direction, triangle);
    if (here < t) [t, corners] = [here, triangle];
  }
  return { t, corners };
}

/**
 * The point of `object` that the camera sees at a place of its picture, -1 .. 1 from left to right and from
 * bottom to top; undefined where there is none.
 */
export function pick(object: Object3D, camera: PerspectiveCamera, x: number, y: number): Picked | undefined {
  object.updateWorldMatrix(true, true);
  camera.updateWorldMatrix(true, false);
  const view = (z: number): Point =>
    apply(camera.matrixWorld, apply(camera.projectionMatrixInverse, [x, y, z]));
  const [near, far] = [view(-1), view(1)];
  const toObject = object.matrixWorld.clone().invert();
  let best: Picked | undefined, nearest = Infinity;
  object.traverseVisible((child) => {
    if (!(child as Mesh).isMesh) return;
    const inverse = child.matrixWorld.clone().invert(), from = apply(inverse, near), to = apply(inverse, far);
    const { t, corners } = nearestOf(child as Mesh, from, minus(to, from));
    if (!corners || t >= nearest || t > 1) return;
    nearest = t;
    const inPackage = child.matrixWorld.clone().premultiply(toObject);
    const [a, b, c] = corners.map((corner) => apply(inPackage, corner));
    const eye = apply(toObject, near), end = apply(toObject, far), way = minus(end, eye);
    const normal = unit(cross(minus(b, a), minus(c, a))) ?? [0, 0, 1];
    best = {
      position: [eye[0] + t * way[0], eye[1] + t * way[1], eye[2] + t * way[2]],
      // to whoever looks: both sides of a surface may be shown
      normal: dot(normal, way) > 0 ? (normal.map((n) => -n) as Point) : normal,
    };
  });
  return best;
}

/** Where a point of the package stands in the picture; undefined behind the camera. */
export function placeOf(object: Object3D, camera: PerspectiveCamera, point: Point): Point | undefined {
  const inView = apply(camera.matrixWorldInverse, apply(object.matrixWorld, point));
  return inView[2] < 0 ? apply(camera.projectionMatrix, inView) : undefined;
}
