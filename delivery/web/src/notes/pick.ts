// Which point of the object a ray meets. Meshes are gone through triangle by triangle, once a click.

import type { Matrix4, Mesh, Object3D, PerspectiveCamera } from 'three';
import type { Point } from '../format/annotations';

/** A point of the object's surface in the coordinates of the package's meshes; where the surface looks. */
export interface Picked {
  position: Point;
  normal: Point;
}

type Triangle = [Point, Point, Point];
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

/**
 * Goes through the triangles of a mesh, in the mesh's own coordinates: how far along the ray the nearest
 * stands, met from either side, and its corners. Numbers without lists: a list a corner takes ten times as
 * long.
 */
export function nearestOf(mesh: Mesh, [ox, oy, oz]: Point,
    [dx, dy, dz]: Point): { t: number; corners?: Triangle } {
  const { index, attributes: { position: p }, drawRange: { start, count } } = mesh.geometry;
  const end = Math.min(start + count, index ? index.count : p.count);
  let nearest = Infinity, at = -1;
  for (let k = start; k + 2 < end; k += 3) {
    const [a, b, c] = index ? [index.getX(k), index.getX(k + 1), index.getX(k + 2)] : [k, k + 1, k + 2];
    const ax = p.getX(a), ay = p.getY(a), az = p.getZ(a);
    const bx = p.getX(b) - ax, by = p.getY(b) - ay, bz = p.getZ(b) - az;
    const cx = p.getX(c) - ax, cy = p.getY(c) - ay, cz = p.getZ(c) - az;
    // Moeller and Trumbore, 1997
    const nx = dy * cz - dz * cy, ny = dz * cx - dx * cz, nz = dx * cy - dy * cx;
    const volume = bx * nx + by * ny + bz * nz;
    const tx = ox - ax, ty = oy - ay, tz = oz - az;
    const u = (tx * nx + ty * ny + tz * nz) / volume;
    if (!(u >= 0 && u <= 1)) continue; // NaN, too: no triangle
    const qx = ty * bz - tz * by, qy = tz * bx - tx * bz, qz = tx * by - ty * bx;
    const v = (dx * qx + dy * qy + dz * qz) / volume;
    if (!(v >= 0 && u + v <= 1)) continue;
    const t = (cx * qx + cy * qy + cz * qz) / volume;
    if (t > 0 && t < nearest) [nearest, at] = [t, k];
  }
  if (at < 0) return { t: Infinity };
  const corners = [0, 1, 2].map((k) => {
    const i = index ? index.getX(at + k) : at + k;
    return [p.getX(i), p.getY(i), p.getZ(i)] as Point;
  }) as Triangle;
  return { t: nearest, corners };
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
