import { BackSide, Camera, DoubleSide, Frustum, Matrix4, Mesh, Object3D, Triangle, Vector3 } from 'three';
import type { TextureInfo } from '../format/textures';
import { sampleTriangles } from './scale_parts';

/** Triangles looked at per model: enough to tell which fragments are seen, and where. */
const mostSamples = 6000;

/** The fragment at texture coordinates. */
function fragmentAt({ columns, rows, widthPx, heightPx, fragmentWidthPx, fragmentHeightPx }: TextureInfo,
    uv: { x: number; y: number }): number {
  const cell = (part: number, px: number, whole: number, count: number): number =>
    Math.min(count - 1, Math.floor(((part - Math.floor(part)) * whole) / px));
  return cell(uv.y, fragmentHeightPx, heightPx, rows) * columns +
    cell(uv.x, fragmentWidthPx, widthPx, columns);
}

/** Where a plane is looked at. */
export interface LookedSurface {
  object: Object3D;
  /** Whether a mesh has the plane's image, by texture coordinates of set 0. */
  shows: (mesh: Mesh) => boolean;
  /** An object that would have this one as its child; left out: `object` stands in the scene. */
  within?: Object3D;
}

/** A sample of a plane's triangles, in the world, by fragment. `use` may keep no triangle. */
export function sampleFragments(plane: TextureInfo, { object, shows, within }: LookedSurface,
    use: (fragment: number, at: Triangle, mesh: Mesh, world: Matrix4) => void): void {
  object.updateWorldMatrix(true, true);
  const [at, uv, middle, world] = [new Triangle(), new Triangle(), new Vector3(), new Matrix4()];
  sampleTriangles(object, mostSamples, (mesh, places) => {
    const { geometry: { attributes } } = mesh;
    if (!attributes.uv || !shows(mesh)) return;
    world.copy(mesh.matrixWorld);
    if (within) world.premultiply(within.matrixWorld);
    uv.setFromAttributeAndIndices(attributes.uv, ...places).getMidpoint(middle);
    const f = fragmentAt(plane, middle);
    at.setFromAttributeAndIndices(attributes.position, ...places);
    [at.a, at.b, at.c].forEach((p) => p.applyMatrix4(world));
    use(f, at, mesh, world);
  });
}

/** [fragments] Share of a surface that the camera sees, from a sample of triangles that face it. */
export function seenShares(plane: TextureInfo, surface: LookedSurface, camera: Camera): Float32Array {
  const { columns, rows } = plane;
  const seen = new Float32Array(columns * rows);
  const all = new Float32Array(columns * rows);
  const eye = new Vector3().setFromMatrixPosition(camera.matrixWorld);
  const frustum = new Frustum().setFromProjectionMatrix(
    new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse));
  const middle = new Vector3();
  sampleFragments(plane, surface, (f, at, mesh, world) => {
    const area = at.getArea();
    all[f] += area;
    const sides = [mesh.material].flat().map((m) => m.side);
    // mirrored: three.js takes the other side for the front
    const front = sides.includes(BackSide) === world.determinant() < 0;
    const turned = sides.includes(DoubleSide) || at.isFrontFacing(at.getMidpoint(middle).sub(eye)) === front;
    if (turned && [at.a, at.b, at.c].some((p) => frustum.containsPoint(p))) seen[f] += area;
  });
  // A fragment without a sample may be seen.
  return seen.map((area, f) => (all[f] > 0 ? area / all[f] : 0.5));
}
