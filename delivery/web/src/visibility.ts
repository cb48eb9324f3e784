import { BackSide, BufferGeometry, Camera, DoubleSide, Matrix4, Mesh, Object3D, Vector3 } from 'three';

/** Triangles looked at per model: enough to tell which fragments are seen. */
const mostSamples = 6000;

interface Sample {
  /** x y z of the middle, then the normal times the area: of the side that three.js calls the front. */
  values: Float32Array;
  /** Texture coordinates of the middle, set 0. */
  uv: Float32Array;
  count: number;
}

function sampleGeometry(geometry: BufferGeometry, world: Matrix4, share: number): Sample {
  const position = geometry.getAttribute('position');
  const uv = geometry.getAttribute('uv');
  const index = geometry.getIndex();
  const triangles = Math.floor((index ? index.count : (position?.count ?? 0)) / 3);
  const step = Math.max(1, Math.floor(1 / Math.max(share, 1e-9)));
  const count = uv && position ? Math.ceil(triangles / step) : 0;
  const sample: Sample = { values: new Float32Array(6 * count), uv: new Float32Array(2 * count), count };
  const corner = [new Vector3(), new Vector3(), new Vector3()];
  const normal = new Vector3();
  const mirrored = world.determinant() < 0 ? -0.5 : 0.5;
  for (let s = 0; s < count; ++s) {
    let u = 0;
    let v = 0;
    for (let k = 0; k < 3; ++k) {
      const at = 3 * s * step + k;
      const i = index ? index.getX(at) : at;
      corner[k].fromBufferAttribute(position, i).applyMatrix4(world);
      u += uv.getX(i) / 3;
      v += uv.getY(i) / 3;
    }
    const middle = new Vector3().add(corner[0]).add(corner[1]).add(corner[2]).divideScalar(3);
    normal.subVectors(corner[1], corner[0]).cross(corner[2].sub(corner[0])).multiplyScalar(mirrored);
    sample.values.set([middle.x, middle.y, middle.z, normal.x, normal.y, normal.z], 6 * s);
    sample.uv.set([u, v], 2 * s);
  }
  return sample;
}

/** Which texture coordinates a camera sees, from a sample of the mesh's triangles; in the object's own frame. */
export class VisibleSurface {
  private samples_: { sample: Sample; images: Set<number>; mesh: Mesh }[] = [];

  /** `imagesOf`: the images that a mesh's materials show. */
  constructor(root: Object3D, meshes: Mesh[], imagesOf: (mesh: Mesh) => Set<number>) {
    root.updateWorldMatrix(true, true);
    const toRoot = root.matrixWorld.clone().invert();
    let triangles = 0;
    for (const m of meshes) triangles += (m.geometry.index?.count ?? m.geometry.getAttribute('position')?.count ?? 0) / 3;
    const share = Math.min(1, mostSamples / Math.max(triangles, 1));
    for (const m of meshes) {
      const world = toRoot.clone().multiply(m.matrixWorld);
      this.samples_.push({ sample: sampleGeometry(m.geometry, world, share), images: imagesOf(m), mesh: m });
    }
  }

  /** Share of each fragment's surface that the camera sees: in its frustum and turned to it, by the material's side. [fragments] */
  ofImage(image: number, columns: number, rows: number, camera: Camera, root: Object3D, cell: [number, number]): Float32Array {
    const seen = new Float32Array(columns * rows);
    const all = new Float32Array(columns * rows);
    const view = new Matrix4().copy(camera.matrixWorld).invert().multiply(root.matrixWorld);
    const clip = new Matrix4().copy(camera.projectionMatrix).multiply(view);
    const eye = new Vector3().setFromMatrixPosition(view.clone().invert());
    const p = new Vector3();
    for (const { sample, images, mesh } of this.samples_) {
      if (!images.has(image)) continue;
      const sides = [mesh.material].flat().map((m) => m.side);
      const both = sides.includes(DoubleSide);
      const back = sides.includes(BackSide);
      const v = sample.values;
      for (let s = 0; s < sample.count; ++s) {
        const u = sample.uv[2 * s] - Math.floor(sample.uv[2 * s]);
        const w = sample.uv[2 * s + 1] - Math.floor(sample.uv[2 * s + 1]);
        const f = Math.min(rows - 1, Math.floor(w / cell[1])) * columns + Math.min(columns - 1, Math.floor(u / cell[0]));
        const k = 6 * s;
        const area = Math.hypot(v[k + 3], v[k + 4], v[k + 5]);
        all[f] += area;
        const facing = (eye.x - v[k]) * v[k + 3] + (eye.y - v[k + 1]) * v[k + 4] + (eye.z - v[k + 2]) * v[k + 5];
        if (!both && (back ? facing >= 0 : facing <= 0)) continue;
        p.set(v[k], v[k + 1], v[k + 2]).applyMatrix4(clip);
        if (Math.abs(p.x) <= 1.05 && Math.abs(p.y) <= 1.05 && p.z <= 1) seen[f] += area;
      }
    }
    // What no sample fell into may be seen.
    for (let f = 0; f < seen.length; ++f) seen[f] = all[f] > 0 ? seen[f] / all[f] : 0.5;
    return seen;
  }
}
