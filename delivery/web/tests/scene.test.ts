import {
  BackSide, BoxGeometry, BufferGeometry, DoubleSide, FrontSide, Group, Material, Mesh, MeshStandardMaterial, OrthographicCamera, PerspectiveCamera, SphereGeometry,
  Vector2, Vector3, WebGLRenderer,
} from 'three';
import { describe, expect, it } from 'vitest';
import { displayOf } from '../src/scene/camera';
import { Emitter } from '../src/scene/events';
import { Manifest, PackageReader, displayedHeightPx, selectScale } from '../src/reader';
import { MaterialSet, ParsedGltf } from '../src/scene/scale_parts';
import { openSplitShapes } from '../src/scene/split_shape';
import type { TextureInfo } from '../src/format/textures';
import { seenShares } from '../src/scene/visibility';
import { handle } from '../src/worker';
import { WorkerPool } from '../src/worker/pool';
import { Fault, fakeServer } from './fake_server';
import { golden } from './support';

const reader = await PackageReader.openBytes(golden('v1.1-scan'), 'golden');
const { manifest } = reader;
const renderer = (width: number, height: number): WebGLRenderer =>
  ({ getDrawingBufferSize: (v: Vector2) => v.set(width, height) }) as unknown as WebGLRenderer;

function lookAt(m: Manifest, heights: number, camera = new PerspectiveCamera(45, 1, 0.001, 100)): PerspectiveCamera {
  const middle = m.boundsMin.map((least, i) => (least + m.boundsMax[i]) / 2);
  camera.position.set(middle[0], middle[1], middle[2] + heights * m.objectHeight);
  camera.lookAt(middle[0], middle[1], middle[2]);
  camera.updateMatrixWorld();
  return camera;
}

describe('the display', () => {
  const object = new Group();
  it('is what the camera makes of the object, in device pixels', () => {
    const whole = displayOf(manifest, object, lookAt(manifest, 3), renderer(800, 600));
    const expected = displayedHeightPx(manifest.objectHeight, 3 * manifest.objectHeight, { fovDegrees: 45, viewportPx: 600 });
    expect(whole.heightPx).toBeCloseTo(expected, 3);
    expect(whole.part?.clipped).toBe(false);
    const twice = displayOf(manifest, object, lookAt(manifest, 3), renderer(1600, 1200));
    expect(twice.heightPx).toBeCloseTo(2 * expected, 3);
  });
  it('grows with the object', () => {
    const large = new Group();
    large.scale.setScalar(2);
    const camera = lookAt(manifest, 30);
    const small = displayOf(manifest, object, camera, renderer(800, 600)).heightPx;
    expect(displayOf(manifest, large, camera, renderer(800, 600)).heightPx / small).toBeCloseTo(2, 1);
  });
  it('knows what is cut off, and what is not to be seen at all', () => {
    const near = displayOf(manifest, object, lookAt(manifest, 0.7), renderer(800, 600));
    expect(near.part).toMatchObject({ clipped: true });
    const away = lookAt(manifest, 3);
    away.rotateY(Math.PI / 3);
    away.updateMatrixWorld();
    const gone = displayOf(manifest, object, away, renderer(800, 600));
    expect(gone.part).toEqual({ widthPx: 0, heightPx: 0, clipped: true });
    expect(selectScale(manifest, gone.heightPx, gone.part)).toBe(manifest.scales.at(-1)!.scale);
  });
  // A ball that touches all sides of the bounds and none of their corners.
  const centre = manifest.boundsMin.map((least, i) => (least + manifest.boundsMax[i]) / 2) as [number, number, number];
  const ball = (share = 0.5): Group => {
    const mesh = new Mesh(new SphereGeometry(share, 48, 24), new MeshStandardMaterial());
    mesh.position.set(...centre);
    mesh.scale.fromArray(manifest.boundsMax.map((most, i) => most - manifest.boundsMin[i]));
    return new Group().add(mesh);
  };
  const middleOf = (heights: number): number =>
    displayedHeightPx(manifest.objectHeight, heights * manifest.objectHeight, { fovDegrees: 45, viewportPx: 600 });
  it('of a whole object is whole, whatever is cut off of the corners of its bounds', () => {
    const camera = lookAt(manifest, 3);
    for (let heights = 3; displayOf(manifest, object, camera, renderer(600, 600)).part?.clipped === false; heights *= 0.99) lookAt(manifest, heights, camera);
    const heights = camera.position.distanceTo(new Vector3(...centre)) / manifest.objectHeight;
    const seen = displayOf(manifest, ball(), camera, renderer(600, 600));
    expect(seen.part?.clipped).toBe(false);
    expect(seen.heightPx).toBeCloseTo(middleOf(heights), 3);
  });
  it('grows without a jump while more and more is cut off', () => {
    const camera = lookAt(manifest, 3);
    let before = displayOf(manifest, ball(), camera, renderer(600, 600));
    let clipped = 0;
    for (let heights = 3; heights > 0.75; heights *= 0.98) {
      const now = displayOf(manifest, ball(), lookAt(manifest, heights, camera), renderer(600, 600));
      expect(now.heightPx).toBeGreaterThanOrEqual(before.heightPx);
      expect(now.heightPx / before.heightPx).toBeLessThan(1.12);
      clipped += Number(now.part!.clipped);
      before = now;
    }
    expect(clipped).toBeGreaterThan(5);
    expect(before.heightPx).toBeGreaterThan(1.5 * middleOf(0.75)); // what is near decides
  });
  it('within the bounds counts how far the surface is', () => {
    const inside = displayOf(manifest, ball(0.05), lookAt(manifest, 0.3), renderer(600, 600));
    expect(inside.heightPx).toBeLessThan(middleOf(0.15));
  });
  it('of an orthographic camera has nothing to do with distance', () => {
    const camera = new OrthographicCamera(-1, 1, 1, -1, 0, 100);
    camera.position.z = 10;
    camera.updateMatrixWorld();
    expect(displayOf(manifest, object, camera, renderer(800, 600)).heightPx).toBeCloseTo(manifest.objectHeight * 300, 3);
  });
});

describe('the visible surface', () => {
  const sphere = new Mesh(new SphereGeometry(1, 64, 32), new MeshStandardMaterial());
  const root = new Group().add(sphere);
  const plane = { columns: 4, rows: 1, widthPx: 64, heightPx: 16, fragmentWidthPx: 16, fragmentHeightPx: 16 } as TextureInfo;
  const seenBy = (eye: PerspectiveCamera): Float32Array => seenShares(plane, root, eye, () => true);
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
  it('is also what is turned away, where the material has two sides; and only that, where it has the back alone', () => {
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
  it('of a mesh that does not show the plane may be seen or not', () => {
    expect([...seenShares(plane, root, camera, () => false)]).toEqual([0.5, 0.5, 0.5, 0.5]);
  });
  it('ends at the border of the view', () => {
    const away = camera.clone();
    away.lookAt(5, 0, 5);
    away.updateMatrixWorld();
    expect(Math.max(...seenBy(away))).toBe(0);
  });
});

describe('scales out of the vertex-split stream', () => {
  const material = new MeshStandardMaterial();
  const gltf: ParsedGltf = {
    scene: new Group().add(new Mesh(new BoxGeometry(), material)),
    parser: {
      json: { materials: [{}] },
      associations: new Map([[material, { materials: 0 }]]),
      getDependency: () => Promise.resolve(material),
      assignFinalMaterial: () => undefined,
    },
  };
  async function shapes() {
    const fromMemory = await PackageReader.openBytes(golden('v1.1-scan'), 'golden');
    const { signal } = new AbortController();
    const splits = await openSplitShapes(fromMemory, new WorkerPool({ decode: handle }), new MaterialSet(), () => undefined, signal);
    return { splits, signal };
  }
  it('have the triangles and bounds of the manifest', async () => {
    const { splits, signal } = await shapes();
    const passed = new Map<number, Mesh>();
    let arrived = 0;
    const finest = await splits.load(0, gltf, signal, () => ++arrived, (scale, mesh) => passed.set(scale, mesh));
    expect(arrived).toBe(1);
    expect([...passed.keys()]).toEqual([1, 0]);
    for (const s of manifest.scales) expect(passed.get(s.scale)!.geometry.index!.count / 3).toBe(s.triangles);
    finest.geometry.computeBoundingBox();
    const box = finest.geometry.boundingBox!;
    const slack = manifest.objectHeight * 5e-3; // the grid of positions
    box.min.toArray().forEach((v, i) => expect(Math.abs(v - manifest.boundsMin[i])).toBeLessThan(slack));
    box.max.toArray().forEach((v, i) => expect(Math.abs(v - manifest.boundsMax[i])).toBeLessThan(slack));
    expect(finest.material as Material).toBe(material);
    expect(passed.get(1)!.geometry.getAttribute('position')).toBe(finest.geometry.getAttribute('position'));
  });
  it('damaged blocks are fetched again, from another mirror where there is one', async () => {
    for (const mirrors of [[], ['http://other/a.texmesh']]) {
      const { stream } = manifest;
      let damaged = 0;
      const fault: Fault = ({ url, range }) =>
        url.startsWith('http://host') && range?.[0] === stream!.offset && (mirrors.length > 0 || damaged === 0) && ++damaged > 0 && 'flip-last';
      const server = fakeServer({ '/a.texmesh': golden('v1.1-scan') }, { fault });
      const remote = await PackageReader.openUrl('http://host/a.texmesh', { fetch: server.fetch, mirrors, retryDelayS: 0.001 });
      const { signal } = new AbortController();
      const splits = await openSplitShapes(remote, new WorkerPool({ decode: handle }), new MaterialSet(), () => undefined, signal);
      const mesh = await splits.load(0, gltf, signal, () => undefined, () => undefined);
      expect(mesh.geometry.index!.count / 3).toBe(manifest.scales[0].triangles);
      expect(damaged).toBeGreaterThan(0);
    }
  });
  it('a scale that is there costs nothing', async () => {
    const { splits, signal } = await shapes();
    const none = (): void => undefined;
    const coarse = await splits.load(1, gltf, signal, none, none);
    const positions = [...(coarse.geometry.getAttribute('position').array as Float32Array).slice(0, 30)];
    await splits.load(0, gltf, signal, none, none);
    expect([...(coarse.geometry.getAttribute('position').array as Float32Array).slice(0, 30)]).toEqual(positions);
    expect(await splits.load(1, gltf, signal, none, none)).toBe(coarse);
    expect(splits.bytesOf(0)).toBe(0);
    let disposed = 0;
    (coarse.geometry as BufferGeometry).addEventListener('dispose', () => ++disposed);
    splits.dispose();
    expect(disposed).toBe(1);
  });
});

it('a listener that throws does not keep others from hearing', () => {
  const events = new Emitter<{ done: { at: number } }>();
  const heard: number[] = [];
  const error = console.error;
  console.error = () => undefined;
  events.on('done', () => {
    throw new Error('mine');
  });
  const off = events.on('done', ({ at }) => heard.push(at));
  events.emit('done', {});
  off();
  events.emit('done', {});
  console.error = error;
  expect(heard.length).toBe(1);
});
