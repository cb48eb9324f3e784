import { PackageReader } from '../../src/reader';
import { type FakeServer, type Fault, type FaultKind, fakeServer, treeFiles } from './fake_server';
import { container } from './scan';

/** A server without ranges, with the tree beside the container. */
export async function tree(fault?: Fault): Promise<FakeServer> {
  const reader = await PackageReader.openBytes(container, 'golden');
  const entries = [...(await reader.index()), reader.manifest.index];
  const files = treeFiles('/a/scan/', container, await reader.store.manifest(), entries);
  return fakeServer({ ...files, '/a/scan.texmesh': container }, { ranges: false, fault });
}
/** Reads documents, a mesh and some fragments. */
export async function readSome(reader: PackageReader): Promise<number> {
  const tables = await reader.tables();
  await reader.quality();
  let bytes = (await reader.scaleGlb(0)).length;
  for (const f of tables[0]!.order.slice(0, 5)) bytes += (await reader.completeFragment(0, 0, f)).length;
  return bytes;
}
/** A fault of one request. */
export const once =
  (kind: FaultKind, at: number): Fault =>
  ({ number }) =>
    number === at && kind;

/** What readSome gives where all is well. */
export const expected = await readSome(await PackageReader.openBytes(container, 'golden'));
