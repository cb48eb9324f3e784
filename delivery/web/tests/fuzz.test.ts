import fc from 'fast-check';
import { existsSync, readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { describe, expect, it } from 'vitest';
import { readAbout } from '../src/format/about';
import { plainGlb, requireSelfContained } from '../src/format/glb';
import { imageSize } from '../src/format/image_size';
import { parseIndexPage, readIndexHead } from '../src/format/index_table';
import { joinFragment } from '../src/format/codec';
import { readQuality } from '../src/format/quality_table';
import { parseTablesSection, readTablesHead } from '../src/format/read_tables';
import { SplitStreamReader } from '../src/format/splits/split_stream';
import { readTextures } from '../src/format/textures';
import { parseThesis } from '../src/format/thesis_tables';
import { FormatError, manifestOfContainer, PackageReader, readManifest } from '../src/reader';
import { golden, goldenSet } from './support/files';
import { readAll } from './support/read_all';

// Whatever bytes come, a reader gives an answer or a FormatError. Inputs are entries of the golden packages
// and, where TEXMESH_FUZZ_CORPUS names the folder that tests/fuzz/run keeps, what libFuzzer has found;
// fast-check changes them.

const runs = process.env.TEXMESH_FULL ? 20000 : 1500;
const corpus = process.env.TEXMESH_FUZZ_CORPUS;
const words = ['null', '-1', '[]', '{}', '1e999', '"a"', '4294967296', 'true'].map((word) =>
  new TextEncoder().encode(word));

/** A change of an input, its place as a share of the length. */
interface Change {
  kind: 'set' | 'cut' | 'repeat' | 'large' | 'word';
  at: number;
  length: number;
  value: number;
}
const changes = fc.array(
  fc.record<Change>({
    kind: fc.constantFrom('set', 'cut', 'repeat', 'large', 'word'),
    at: fc.double({ min: 0, max: 1, maxExcluded: true, noNaN: true }),
    length: fc.nat(16),
    value: fc.nat(255),
  }),
  { minLength: 1, maxLength: 4 },
);

function changed(input: Uint8Array, list: readonly Change[]): Uint8Array {
  let bytes = Uint8Array.from(input);
  for (const { kind, at: share, length, value } of list) {
    const at = Math.floor(share * bytes.length);
    if (kind === 'set' && bytes.length > 0) bytes[at] = value;
    else if (kind === 'large') bytes.fill(255, at, at + 1 + (length & 3));
    else {
      const between = kind === 'repeat' ? bytes.slice(at, at + length)
        : kind === 'word' ? words[value % words.length] : new Uint8Array();
      const behind = bytes.slice(kind === 'cut' ? at + length : at);
      const joined = new Uint8Array(at + between.length + behind.length);
      joined.set(bytes.subarray(0, at));
      joined.set(between, at);
      joined.set(behind, at + between.length);
      bytes = joined;
    }
  }
  return bytes;
}

const packages = await Promise.all(
  goldenSet.map(async (name) => {
    const reader = await PackageReader.openBytes(golden(name), name);
    return { bytes: golden(name), manifest: reader.manifest, textures: await reader.textures(),
      index: await reader.index() };
  }),
);
const entries = (path: RegExp): Uint8Array[] =>
  packages.flatMap(({ bytes, index }) =>
    index.filter((e) => path.test(e.path)).map((e) => bytes.slice(e.offset, e.offset + e.bytes)));
const indexes =
  packages.map(({ bytes, manifest: { index } }) => bytes.slice(index.offset, index.offset + index.bytes));

/** A reader, the inputs it starts from, and the fuzz targets (tests/fuzz) that read the same. */
interface Reader {
  name: string;
  inputs: Uint8Array[];
  targets?: string[];
  read: (bytes: Uint8Array) => unknown;
}
const readers: Reader[] = [
  { name: 'package', inputs: packages.map((p) => p.bytes), targets: ['package', 'container'], read: readAll },
  { name: 'manifest', inputs: packages.map((p) => manifestOfContainer(p.bytes, 'golden')),
    targets: ['manifest'], read: readManifest },
  { name: 'textures', inputs: entries(/^textures\.json$/), targets: ['textures'], read: readTextures },
  { name: 'quality', inputs: entries(/^quality\.json$/), targets: ['quality'], read: readQuality },
  { name: 'about', inputs: entries(/^about\.json$/), targets: ['about'], read: readAbout },
  {
    name: 'thesis', inputs: entries(/^thesis\.bin$/), targets: ['thesis'],
    read: (b) => parseThesis(b, packages[0].manifest, packages[0].textures),
  },
  {
    name: 'index', inputs: indexes, targets: ['index'],
    read: (b) => {
      const { minor, pages } = readIndexHead(b);
      for (const p of pages)
        parseIndexPage(b.subarray(p.offset, p.offset + p.bytes), p.plane, p.entries, minor);
    },
  },
  {
    name: 'tables', inputs: entries(/^tables\.bin$/), targets: ['tables'],
    read: (b) => {
      const { minor, planes } = readTablesHead(b);
      for (const p of planes) parseTablesSection(b.subarray(p.offset, p.offset + p.bytes), minor, 'plane');
    },
  },
  {
    name: 'stream', inputs: entries(/^mesh\/stream\.bin$/), targets: ['stream'],
    read: async (b) => {
      const reader = new SplitStreamReader(b);
      await reader.addBlocks(b.subarray(reader.head.blocks[0]?.offset ?? b.length));
    },
  },
  { name: 'glb', inputs: entries(/\.glb$/), targets: ['glb_check'],
    read: (b) => [plainGlb(b), requireSelfContained(b)] },
  { name: 'picture', inputs: entries(/^(preview\/.*|poster)\.(jpg|webp)$/),
    targets: ['fragment', 'fragment_webp'], read: imageSize },
  { name: 'fragment', inputs: entries(/\.pack$/),
    read: (b) => joinFragment('jpeg', b.subarray(0, b.length >> 1), [b.subarray(b.length >> 1)]) },
];

const kept = ({ targets = [] }: Reader): Uint8Array[] =>
  targets.map((target) => join(corpus!, 'kept', target)).filter((folder) => existsSync(folder))
    .flatMap((folder) => readdirSync(folder).map((file) => new Uint8Array(readFileSync(join(folder, file)))));

async function expectAnswerOrFormatError({ read }: Reader, bytes: Uint8Array): Promise<void> {
  try {
    await read(bytes);
  } catch (error) {
    if (!(error instanceof FormatError)) throw error;
  }
}

describe('readers give an answer or a FormatError', () => {
  for (const reader of readers) {
    it(`${reader.name}, changed`, async () => {
      expect(reader.inputs.length).toBeGreaterThan(0);
      const input = fc.constantFrom(...reader.inputs);
      await fc.assert(fc.asyncProperty(input, changes, (bytes, list) => expectAnswerOrFormatError(reader,
        changed(bytes, list))), { numRuns: reader.name === 'package' ? runs / 4 : runs, seed: 2024 });
    }, 600_000);
    it.skipIf(!corpus)(`${reader.name}, as libFuzzer has kept it`, async () => {
      for (const bytes of kept(reader)) await expectAnswerOrFormatError(reader, bytes);
    }, 600_000);
  }
  // Found by libFuzzer: these were taken for lists.
  it.each(['bufferViews', 'buffers', 'extensionsUsed', 'extensionsRequired'])('glb, %s is no list',
      (list) => {
    const json = new TextEncoder().encode(JSON.stringify({ [list]: {} }).padEnd(40));
    const head = new Uint8Array(Uint32Array.of(0x46546c67, 2, 60, 40, 0x4e4f534a).buffer);
    expect(() => plainGlb(Uint8Array.from([...head, ...json]))).toThrow(FormatError);
  });
});
