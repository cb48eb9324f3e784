import type { BufferGeometry, EventDispatcher, Material, Mesh } from 'three';
import { expect, it } from 'vitest';
import { fakeServer } from './fake_server';
import { loading } from './loading';
import { golden } from './support';

const url = 'http://host/a/scan.texmesh';
const files = { '/a/scan.texmesh': golden('v1.1-scan') };

/** Which of these are told that they are disposed of from now on. */
function watched(all: readonly unknown[]): Set<unknown> {
  const told = new Set<unknown>();
  for (const one of all) (one as EventDispatcher<{ dispose: object }>).addEventListener('dispose', () => told.add(one));
  return told;
}

it('a load that is disposed of frees textures, materials and geometries, and hears of nothing any more', async () => {
  const server = fakeServer(files);
  const l = await loading(url, server, { autoRefine: false });
  await l.model.done;
  const meshes: Mesh[] = [];
  l.model.object.traverse((o) => void ((o as Mesh).isMesh && meshes.push(o as Mesh)));
  const materials: Material[] = [...l.model.materials];
  const geometries: BufferGeometry[] = meshes.map((m) => m.geometry);
  const textures = l.model.state.planes.flatMap((p) => [...p.textures]);
  expect([materials, geometries, textures].every((all) => all.length > 0)).toBe(true);
  const all = [...materials, ...geometries, ...textures];
  const told = watched(all);
  l.model.dispose();
  expect(all.filter((one) => !told.has(one))).toEqual([]);
  expect([l.model.object.children, l.model.state.planes]).toEqual([[], []]);
  const before = l.count('request');
  const asked = server.log.length;
  await l.pkg.scaleGlb(0);
  expect(l.count('request')).toBe(before);
  expect(l.pkg.client.listeners.size).toBe(0);
  expect(server.log.length).toBeGreaterThan(asked);
  l.dispose();
});
