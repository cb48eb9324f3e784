import { Camera, Vector2, Vector3, WebGLRenderer } from 'three';
import { foveaRadiusDegrees, halfAcuityDegrees } from '../format/shared_numbers';
import type { TextureInfo } from '../format/textures';
import type { Gaze } from './api';
import { type LookedSurface, sampleFragments } from './visible_fragments';

/**
 * What somebody resolves so many degrees beside the point that they look at, as a part of what they resolve
 * at that point: 1 in the fovea, the central degree; outside of it the finest detail that is seen grows in
 * proportion to the distance and has doubled 2.3 degrees beyond. The same bits as gaze_weight() in
 * lab/transfer/several_objects.h.
 */
export function acuityAt(degrees: number): number {
  return halfAcuityDegrees / (halfAcuityDegrees + Math.max(0, degrees - foveaRadiusDegrees));
}
/** What a loss counts there: the square, since detail is lost in two directions. */
export function gazeWeight(degrees: number): number {
  const acuity = acuityAt(degrees);
  return acuity * acuity;
}

/** Device pixels of a degree: 96 to the inch at 60 cm. */
const usualPxPerDegree = 40;

/**
 * What the losses of each fragment count for somebody who looks at a point of the picture: the mean over the
 * fragment's surface, from a sample of the triangles. Behind the eye a surface counts as farthest away.
 * [fragments]
 */
export function gazeWeights(plane: TextureInfo, surface: LookedSurface, camera: Camera,
    renderer: WebGLRenderer, { x, y, pxPerDegree = usualPxPerDegree }: Gaze): Float32Array {
  const count = plane.columns * plane.rows;
  const [weights, all] = [new Float32Array(count), new Float32Array(count)];
  const size = renderer.getDrawingBufferSize(new Vector2());
  const middle = new Vector3();
  sampleFragments(plane, surface, (f, at) => {
    const area = at.getArea();
    at.getMidpoint(middle).applyMatrix4(camera.matrixWorldInverse);
    const behind = middle.z >= 0;
    middle.applyMatrix4(camera.projectionMatrix);
    const px = behind ? Infinity : Math.hypot(((middle.x - x) * size.x) / 2, ((middle.y - y) * size.y) / 2);
    weights[f] += area * gazeWeight(px / pxPerDegree);
    all[f] += area;
  });
  // A fragment without a sample counts as much as the others do in the mean.
  const [sum, area] = [weights, all].map((a) => a.reduce((s, v) => s + v, 0));
  return weights.map((w, f) => (all[f] > 0 ? w / all[f] : area > 0 ? sum / area : 1));
}
