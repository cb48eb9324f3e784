import { execFileSync, spawnSync } from 'node:child_process';
import { mkdtempSync, readdirSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { afterAll, describe, expect, it } from 'vitest';
import { FormatError } from '../src/reader';
import { golden, root } from './support/files';
import { readAll } from './support/read_all';

// Packages that break one rule of format/SPEC.md each. A client sees what it reads: documents, fragments, the
// stream.
const ofClients =
  /^([IRXTQS]\d\d|B0[12]|F0[3567]|F24|G0[156]|G13|J0[1347]|K1[12]|M0[1235]|O0[45]|M1[0189]|M2[134]|W0[356])-/;
const ofCheckers = [
  /^I08-(entry|size)/, // what the container has
  /^I07/, // order over all pages
  /^R0[37]-no-/, // entries that were not asked for
  /^(T1[12]|Q02|S21|S23|X08)/, // measurements, and what GLBs have
  /^G05-another-picture/, // which picture a GLB has
];
const name = 'v2.0-scan';
const possible = spawnSync('python3', ['--version']).status === 0;
describe.skipIf(!possible)('packages that break a rule', () => {
  const folder = mkdtempSync(join(tmpdir(), 'texmesh-invalid-'));
  afterAll(() => rmSync(folder, { recursive: true }));
  if (possible)
    for (const [from, ...cases] of [[name], ['v2.0-webp', 'F07-no-webp', 'R05-codec-without-feature'],
        ['v2.0-progressive', 'F06-ends-with-ff']])
      execFileSync('python3', [join(root, 'tests/golden/make_invalid'),
        join(root, `tests/golden/${from}.texmesh`), folder, ...cases]);
  it('differ from a sound one, which is read to its end', async () => {
    await readAll(golden(name));
  });
  it('are many', () => {
    expect(readdirSync(folder).length).toBeGreaterThan(100);
  });
  for (const file of readdirSync(folder))
    if (ofClients.test(file) && !ofCheckers.some((rule) => rule.test(file)))
      it(`are refused: ${file}`, async () => {
        const broken: unknown =
          await readAll(readFileSync(join(folder, file))).catch((error: unknown) => error);
        expect(broken).toBeInstanceOf(FormatError);
        expect((broken as FormatError).message.slice(-5)).toBe(`[${file.slice(0, 3)}]`);
      });
});
