import { execFileSync, spawnSync } from 'node:child_process';
import { mkdtempSync, readdirSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { afterAll, describe, expect, it } from 'vitest';
import { requireSelfContained } from '../src/format/self_contained_glb';
import { SplitStreamReader } from '../src/format/splits/split_stream';
import { FormatError, PackageReader } from '../src/reader';
import { golden, goldenNames, root } from './support/files';

// Packages that break one rule of format/SPEC.md each. A client sees what it reads: documents, fragments, the stream.
const ofClients = /^([IRXTQS]\d\d|B01|B02|G0[156]|J01|J03|J04|K11|K12|F03|F05|M0[1235]|M10|M11|M18|M19|M21|W03|W05|W06)-/;
const ofCheckers = [
  /^I08-(entry|size)/, // what the container has
  /^I07/, // order over all pages
  /^R0[37]-no-/, // entries that were not asked for
  /^(R16|R01-thesis)/, // this client does not read thesis.bin
  /^(T1[12]|Q02|S21)/, // measurements, and what GLB and stream have
  /^G05-another-picture/, // which picture a GLB has
];
async function readAll(bytes: Uint8Array): Promise<void> {
  const reader = await PackageReader.openBytes(bytes, 'invalid');
  await reader.find('about.json');
  await reader.index();
  await reader.quality();
  await reader.about();
  const coarsest = reader.manifest.scales.at(-1)!.scale;
  for (const { scale, glb } of reader.manifest.scales) if (glb.path.endsWith('.glb')) requireSelfContained(await reader.scaleGlb(scale), scale !== coarsest);
  const textures = await reader.textures();
  for (const [plane, tables] of (await reader.tables()).entries()) {
    if (textures[plane].mip === 0) await reader.preview(plane);
    for (let rung = 0; rung < tables!.rungQuality.length; ++rung)
      for (const fragment of tables!.order.slice(0, 2)) await reader.completeFragment(plane, rung, fragment);
  }
  const { stream } = reader.manifest;
  if (!stream) return;
  const splits = new SplitStreamReader((await reader.splitStreamHead())!);
  await splits.addBlocks(await reader.splitStream(stream.headBytes, stream.bytes - stream.headBytes));
}

const name: string = goldenNames[goldenNames.length - 1];
const possible = name.startsWith('v2.') && spawnSync('python3', ['--version']).status === 0;
describe.skipIf(!possible)('packages that break a rule', () => {
  const folder = mkdtempSync(join(tmpdir(), 'texmesh-invalid-'));
  afterAll(() => rmSync(folder, { recursive: true }));
  if (possible)
    execFileSync('python3', [join(root, 'tests/golden/make_invalid'), join(root, `tests/golden/${name}.texmesh`), folder]);
  it('differ from a sound one, which is read to its end', async () => {
    await readAll(golden(name));
  });
  it('are many', () => {
    expect(readdirSync(folder).length).toBeGreaterThan(100);
  });
  for (const file of readdirSync(folder))
    if (ofClients.test(file) && !ofCheckers.some((rule) => rule.test(file)))
      it(`are refused: ${file}`, async () => {
        const broken: unknown = await readAll(readFileSync(join(folder, file))).catch((error: unknown) => error);
        expect(broken).toBeInstanceOf(FormatError);
        expect((broken as FormatError).message.slice(-5)).toBe(`[${file.slice(0, 3)}]`);
      });
});
