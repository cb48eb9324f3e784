import { requireSelfContained } from '../../src/format/glb';
import { SplitStreamReader } from '../../src/format/splits/split_stream';
import { PackageReader } from '../../src/reader';
import { readNotes } from '../../src/notes';
import { readThesis } from '../../src/thesis';

/** Reads all that a client may read of a package; gives the mesh at the end of the stream. */
export async function readAll(bytes: Uint8Array): Promise<SplitStreamReader | undefined> {
  const reader = await PackageReader.openBytes(bytes, 'package');
  await reader.find('about.json');
  await reader.index();
  await reader.quality();
  await reader.about();
  await readThesis(reader);
  await readNotes(reader);
  const coarsest = reader.manifest.scales.at(-1)!.scale;
  for (const { scale, glb } of reader.manifest.scales) if (glb.path.endsWith('.glb'))
    requireSelfContained(await reader.scaleGlb(scale), scale !== coarsest);
  for (const [k] of reader.manifest.proxies.entries())
    requireSelfContained(await reader.proxyGlb(k), false, 'G13');
  const textures = await reader.textures();
  for (const [plane, tables] of (await reader.tables()).entries()) {
    if (textures[plane].mip === 0) await reader.preview(plane);
    for (let rung = 0; rung < tables!.rungQuality.length; ++rung)
      for (const fragment of tables!.order.slice(0, 2)) await reader.completeFragment(plane, rung, fragment);
  }
  const { stream } = reader.manifest;
  if (!stream) return undefined;
  const splits = new SplitStreamReader((await reader.splitStreamHead())!);
  await splits.addBlocks(await reader.splitStream(stream.headBytes, stream.bytes - stream.headBytes));
  return splits;
}
