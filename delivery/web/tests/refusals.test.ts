import { describe, expect, it } from 'vitest';
import { FormatError, PackageReader } from '../src/reader';
import { golden } from './support/files';
import { Json, Mutant } from './support/mutate';
import { rejection } from './support/scan';

// Documents that do not fit each other, by the number of the rule in format/SPEC.md. Digests are right
// throughout: whoever makes such a package on purpose writes them, too.

const container = golden('v2.0-scan');

async function readDocuments(bytes: Uint8Array): Promise<void> {
  const reader = await PackageReader.openBytes(bytes, 'mutant');
  for (const [p, plane] of (await reader.textures()).entries()) if (plane.mip === 0) await reader.preview(p);
  await reader.tables();
  await reader.quality();
}

/** Where the sizes of a section's streams stand, and its rungs' table streams. */
function places(section: DataView): { tableBytes: number; sizes: number } {
  const [rungs, knots, listed] = [section.getUint8(9), section.getUint8(14), section.getUint32(32, true)];
  const tableBytes = 36 + 2 * listed + rungs;
  return { tableBytes, sizes: tableBytes + 4 * rungs + 3 * knots };
}
const flipped = (digest: string): string => (digest.startsWith('0') ? '1' : '0') + digest.slice(1);

/** A rule, part of the error's text, a change of entries, a change of the manifest behind it. */
const refusals: [string, string, (m: Mutant) => void, ((manifest: Json) => void)?][] = [
  ['R01', 'index.bin', () => undefined, (m) => (m.version.minor = 1)],
  ['R01', 'tables.bin', (m) => (m.entry('tables.bin')[6] = 1)],
  ['R02', 'index.bin', () => undefined, (m) => (m.index.headSha256 = flipped(m.index.headSha256))],
  ['R02', 'tables.bin', () => undefined, (m) => (m.tables.headSha256 = flipped(m.tables.headSha256))],
  ['R03', 'tables.bin', () => undefined, (m) => (m.tables.bytes += 1)],
  ['R03', 'provenance.json', () => undefined, (m) => (m.provenance.sha256 = flipped(m.provenance.sha256))],
  ['R03', 'about.json', () => undefined, (m) => (m.about.sha256 = flipped(m.about.sha256))],
  ['R03', 'thesis.bin', () => undefined, (m) => (m.thesis.sha256 = flipped(m.thesis.sha256))],
  ['R03', 'poster.jpg', () => undefined, (m) => (m.poster.offset += 64)],
  ['R03', 'mesh/stream.bin', () => undefined, (m) => (m.stream.bytes += 1)],
  ['R03', 'mesh/s00.glb', () => undefined, (m) => (m.scales.sha256[0] = flipped(m.scales.sha256[0]))],
  ['R04', 'planes', () => undefined, (m) => (m.planeCount += 1)],
  ['R04', 'planes', (m) => m.json('textures.json', (d) => d.textures.pop())],
  ['R05', 'codec-webp', (m) => m.json('textures.json', (d) => (d.textures.at(-1).codec = 'webp'))],
  ['R07', 'preview/000.jpg', (m) => m.rename('preview/000.jpg', 'preview/900.jpg')],
  ['R07', 'texture/0/r00.pack', (m) => m.rename('texture/0/r00.pack', 'texture/0/r90.pack')],
  ['R08', 'the grid', (m) =>
    m.json('textures.json', (d) => {
      const [t] = d.textures;
      t.gridReason = ''; // makes room
      [t.fragmentWidthPx, t.columns] = [16 * Math.ceil(t.widthPx / 16), 1];
    })],
  ['R09', 'the rungs', (m) => m.json('textures.json', (d) => (d.textures[0].rungQuality[0] -= 1))],
  ['R10', 'tables of the codec', (m) => m.section(0).setUint8(13, 1)],
  ['R12', 'texture/0/tables.pack', (m) => {
    const s = m.section(0);
    const { tableBytes } = places(s);
    s.setUint32(tableBytes, s.getUint32(tableBytes, true) + 1, true);
  }],
  ['R13', 'texture/0/r00.pack', (m) => {
    const s = m.section(0);
    const { sizes } = places(s);
    s.setUint8(sizes, s.getUint8(sizes) ^ 1);
  }],
  ['R14', "the manifest's scales", (m) => m.json('quality.json', (d) => {
    d.scales[d.scales.length - 1] += 1;
    for (const g of d.groups) for (const s of g.sizes) s.finer.dssim.fill(0); // makes room
  })],
  ['R15', 'those of the planes', (m) => m.json('quality.json', (d) => d.groups.pop())],
];

describe('documents that do not fit each other are refused', () => {
  it.each(refusals)('%s: %s', async (rule, says, change, changeManifest) => {
    const mutant = new Mutant(container);
    change(mutant);
    const error = await rejection(readDocuments(mutant.seal(changeManifest)));
    expect(error).toBeInstanceOf(FormatError);
    expect(`${error}`).toContain(says);
    expect(`${error}`).toContain(`[${rule}]`);
  });
  it("R11: tables without a row for one of the manifest's scales", async () => {
    let count = 0;
    const bytes = new Mutant(container).seal((m) => {
      delete m.poster; // makes room
      delete m.stream;
      for (const column of Object.keys(m.scales)) m.scales[column].splice(1, 0, m.scales[column][1]);
      --m.scales.scale[1];
      count = m.scales.scale.length;
    });
    const reader = await PackageReader.openBytes(bytes, 'mutant');
    expect(`${await rejection(reader.tables())}`).toContain(`${count} rows [R11]`);
  });
  it('but not what is merely sealed again', async () => {
    await readDocuments(container);
    await readDocuments(new Mutant(container).seal());
  });
  it('a package of major version 1 is to be compiled again', async () => {
    const bytes = new Mutant(container).seal((m) => (m.version.major = 1));
    expect(`${await rejection(readDocuments(bytes))}`)
      .toContain('1, which is no longer read: compile the model again');
  });
});
