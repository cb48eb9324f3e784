import { BoxGeometry, BufferGeometry, Group, Material, Mesh, MeshStandardMaterial } from 'three';
import { describe, expect, it } from 'vitest';
import { PackageReader } from '../../src/reader';
import { MaterialSet, ParsedGltf } from '../../src/scene/scale_parts';
import { openSplitShapes } from '../../src/scene/split_shape';
import { handle } from '../../src/worker';
import { WorkerPool } from '../../src/worker/pool';
import { fakeServer, Fault } from '../support/fake_server';
import { golden } from '../support/files';

const reader = await PackageReader.openBytes(golden('v2.0-scan'), 'golden');
const { manifest } = reader;

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
    const fromMemory = await PackageReader.openBytes(golden('v2.0-scan'), 'golden');
    const { signal } = new AbortController();
    const splits = await openSplitShapes(fromMemory, new WorkerPool({ decode: handle }), new MaterialSet(),
      () => undefined, () => 0, signal);
    return { splits, signal };
  }
  it('have the triangles and bounds of the manifest', async () => {
    const { splits, signal } = await shapes();
    const passed = new Map<number, Mesh>();
    let arrived = 0;
    const finest =
      await splits.load(0, gltf, signal, () => ++arrived, (scale, mesh) => passed.set(scale, mesh));
    expect(arrived).toBeGreaterThan(0);
    expect([...passed.keys()]).toEqual(manifest.scales.map((s) => s.scale).reverse());
    for (const s of manifest.scales) expect(passed.get(s.scale)!.geometry.index!.count / 3).toBe(s.triangles);
    finest.geometry.computeBoundingBox();
    const box = finest.geometry.boundingBox!;
    const slack = manifest.objectHeight * 5e-3; // the grid of positions
    box.min.toArray().forEach((v, i) => expect(Math.abs(v - manifest.boundsMin[i])).toBeLessThan(slack));
    box.max.toArray().forEach((v, i) => expect(Math.abs(v - manifest.boundsMax[i])).toBeLessThan(slack));
    expect(finest.material as Material).toBe(material);
    expect(passed.get(manifest.scales[1].scale)!.geometry.getAttribute('position'))
      .toBe(finest.geometry.getAttribute('position'));
  });
  it('have tangents of their own where the file has some', async () => {
    const { splits, signal } = await shapes();
    const json = { materials: [{ normalTexture: {} }],
      meshes: [{ primitives: [{ attributes: { TANGENT: 1 } }] }] };
    const passed: Mesh[] = [];
    await splits.load(0, { ...gltf, parser: { ...gltf.parser, json } }, signal, () => undefined,
      (_, mesh) => passed.push(mesh));
    for (const { geometry } of passed) {
      const tangents = geometry.getAttribute('tangent');
      const index = geometry.index!;
      expect(Math.max(...index.array)).toBeLessThan(tangents.count);
      expect(geometry.getAttribute('position').count).toBeGreaterThanOrEqual(tangents.count);
      for (let i = 0; i < index.count; ++i)
        expect(Math.abs(tangents.getW(index.getX(i)))).toBe(1);
    }
    const without = await shapes();
    const plain = await without.splits.load(0, gltf, signal, () => undefined, () => undefined);
    expect(plain.geometry.hasAttribute('tangent')).toBe(false);
  });
  it('damaged blocks are fetched again, from another mirror where there is one', async () => {
    for (const mirrors of [[], ['http://other/a.texmesh']]) {
      const { stream } = manifest;
      let damaged = 0;
      const fault: Fault = ({ url, range }) =>
        url.startsWith('http://host') && range?.[0] === stream!.offset &&
          (mirrors.length > 0 || damaged === 0) && ++damaged > 0 && 'flip-last';
      const server = fakeServer({ '/a.texmesh': golden('v2.0-scan') }, { fault });
      const remote = await PackageReader.openUrl('http://host/a.texmesh',
        { fetch: server.fetch, mirrors, retryDelayS: 0.001 });
      const { signal } = new AbortController();
      const splits = await openSplitShapes(remote, new WorkerPool({ decode: handle }), new MaterialSet(),
        () => undefined, () => 0, signal);
      const mesh = await splits.load(0, gltf, signal, () => undefined, () => undefined);
      expect(mesh.geometry.index!.count / 3).toBe(manifest.scales[0].triangles);
      expect(damaged).toBeGreaterThan(0);
    }
  });
  it('a scale that is there costs nothing', async () => {
    const { splits, signal } = await shapes();
    const none = (): void => undefined;
    const { scale } = manifest.scales[1];
    const coarse = await splits.load(scale, gltf, signal, none, none);
    const positions = [...(coarse.geometry.getAttribute('position').array as Float32Array).slice(0, 30)];
    await splits.load(0, gltf, signal, none, none);
    expect([...(coarse.geometry.getAttribute('position').array as Float32Array).slice(0, 30)])
      .toEqual(positions);
    expect(await splits.load(scale, gltf, signal, none, none)).toBe(coarse);
    expect(splits.bytesOf(0)).toBe(0);
    let disposed = 0;
    (coarse.geometry as BufferGeometry).addEventListener('dispose', () => ++disposed);
    splits.dispose();
    expect(disposed).toBe(1);
  });
});
