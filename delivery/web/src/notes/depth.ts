// What hides what: how far the object stands from the camera, over the picture.

import type { Matrix4, Mesh, Object3D, PerspectiveCamera } from 'three';
import type { Point } from '../format/annotations';
import { apply } from './pick';

const side = 256; // columns and rows

/**
 * Goes through all triangles once (some 30 ms for a million), then tells of any number of points whether the
 * object hides them. On the processor: a depth buffer would have to be read back from the GPU.
 */
export class DepthPicture {
  private readonly nearness_ = new Float32Array(side * side); // 1 / distance along the view; 0 = nothing
  private readonly toClip_: Matrix4;

  constructor(object: Object3D, camera: PerspectiveCamera) {
    object.updateWorldMatrix(true, true);
    const view = camera.projectionMatrix.clone().multiply(camera.matrixWorldInverse);
    this.toClip_ = view.clone().multiply(object.matrixWorld);
    object.traverseVisible((child) => {
      if ((child as Mesh).isMesh) this.add_(child as Mesh, view.clone().multiply(child.matrixWorld));
    });
  }

  /** Whether something of the object stands before a point of the package by more than `off`. */
  hides(point: Point, off: number): boolean {
    const { elements: m } = this.toClip_, away = m[3] * point[0] + m[7] * point[1] + m[11] * point[2] + m[15];
    const [x, y] = apply(this.toClip_, point);
    const column = Math.floor(((x + 1) / 2) * side), row = Math.floor(((y + 1) / 2) * side);
    if (!(away > 0 && column >= 0 && column < side && row >= 0 && row < side)) return false;
    return this.nearness_[row * side + column] * (away - off) > 1;
  }

  private add_({ geometry }: Mesh, { elements: m }: Matrix4): void {
    const { index, attributes: { position: p }, drawRange: { start, count } } = geometry;
    const places = new Float32Array(3 * p.count); // column, row, nearness
    for (let i = 0; i < p.count; ++i) {
      const x = p.getX(i), y = p.getY(i), z = p.getZ(i);
      const nearness = 1 / (m[3] * x + m[7] * y + m[11] * z + m[15]);
      places[3 * i] = ((m[0] * x + m[4] * y + m[8] * z + m[12]) * nearness + 1) * (side / 2);
      places[3 * i + 1] = ((m[1] * x + m[5] * y + m[9] * z + m[13]) * nearness + 1) * (side / 2);
      places[3 * i + 2] = nearness;
    }
    const end = Math.min(start + count, index ? index.count : p.count);
    for (let k = start; k + 2 < end; k += 3)
      if (index) this.fill_(places, 3 * index.getX(k), 3 * index.getX(k + 1), 3 * index.getX(k + 2));
      else this.fill_(places, 3 * k, 3 * k + 3, 3 * k + 6);
  }
  /** A triangle, where it is nearer; one that reaches behind the camera hides nothing. */
  private fill_(at: Float32Array, a: number, b: number, c: number): void {
    const ax = at[a], ay = at[a + 1], az = at[a + 2], bx = at[b], by = at[b + 1], bz = at[b + 2];
    const cx = at[c], cy = at[c + 1], cz = at[c + 2];
    const area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay);
    if (!(az > 0 && bz > 0 && cz > 0) || !(area !== 0)) return;
    const x0 = Math.max(0, Math.ceil(Math.min(ax, bx, cx) - 0.5));
    const x1 = Math.min(side - 1, Math.floor(Math.max(ax, bx, cx) - 0.5));
    const y1 = Math.min(side - 1, Math.floor(Math.max(ay, by, cy) - 0.5));
    for (let row = Math.max(0, Math.ceil(Math.min(ay, by, cy) - 0.5)); row <= y1; ++row)
      for (let column = x0; column <= x1; ++column) {
        const x = column + 0.5 - ax, y = row + 0.5 - ay;
        const v = (x * (cy - ay) - (cx - ax) * y) / area, w = ((bx - ax) * y - x * (by - ay)) / area;
        if (!(v >= 0 && w >= 0 && v + w <= 1)) continue;
        const nearness = az + v * (bz - az) + w * (cz - az), i = row * side + column;
        if (nearness > this.nearness_[i]) this.nearness_[i] = nearness;
      }
  }
}
