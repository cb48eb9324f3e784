import { execFileSync, spawnSync } from 'node:child_process';
import { mkdtempSync, readFileSync, readdirSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { afterAll, describe, expect, it } from 'vitest';
import { FormatError, verifyPackage } from '../src/verify';
import { golden, goldenSet, root } from './support/files';

const ruleOf = (source: Parameters<typeof verifyPackage>[0], options = {}): Promise<string> =>
  verifyPackage(source, options).then(() => 'none', (error: unknown) => (error instanceof FormatError ? error.rule : String(error)));
const folder = mkdtempSync(join(tmpdir(), 'texmesh-verify-'));
afterAll(() => rmSync(folder, { recursive: true }));
const possible = spawnSync('python3', ['--version']).status === 0;
const python = (script: string, ...args: string[]): string => execFileSync('python3', ['-B', join(root, 'tests/golden', script), ...args], { encoding: 'utf8' });

describe('packages that keep all rules', () => {
  it('are many', () => expect(goldenSet.length).toBeGreaterThanOrEqual(10));
  it.each(goldenSet)('%s', async (name) => verifyPackage(golden(name)));
  it('as a Blob', async () => verifyPackage(new Blob([golden('v2.0-scan') as BlobPart])));
  it('as a tree', async () => {
    const from = join(root, 'tests/golden/v2.0-tree');
    const paths = (readdirSync(from, { recursive: true }) as string[]).map((path) => path.replaceAll('\\', '/')).filter((path) => /\.\w+$/.test(path));
    const files = new Map(paths.map((path) => [path, new Uint8Array(readFileSync(join(from, path)))]));
    await verifyPackage(files);
    expect(await ruleOf(new Map([...files].filter(([path]) => path !== 'preview/000.jpg')))).toBe('I08');
    expect(await ruleOf(new Map([...files, ['about.json', new Uint8Array(3)]]))).toBe('I08');
  });
  it.skipIf(!possible)('of a later minor version, with a ZIP64 end record', async () => {
    const out = join(folder, 'later.texmesh');
    python('make_later', join(root, 'tests/golden/v2.0-webp.texmesh'), out);
    await verifyPackage(new Uint8Array(readFileSync(out)));
  }, 120000);
});

describe.skipIf(!possible)('packages that break a rule', () => {
  const broken = join(folder, 'broken');
  const others = { 'v2.0-webp': ['F07-no-webp', 'R05-codec-without-feature'], 'v2.0-progressive': ['F06-ends-with-ff'], 'v2.0-source': ['O02-damaged-source'] };
  const cases = possible ? python('make_invalid', '--list').split(/\s+/).filter(Boolean) : [];
  if (possible)
    for (const [from, names] of Object.entries({ 'v2.0-scan': [], ...others })) python('make_invalid', join(root, `tests/golden/${from}.texmesh`), broken, ...names);
  it('are many', () => expect(cases.length).toBeGreaterThan(200));
  it.each(cases)('%s', async (name) => {
    expect(await ruleOf(new Uint8Array(readFileSync(join(broken, `${name}.texmesh`))))).toBe(name.slice(0, 3));
  });
});

describe('bytes', () => {
  const bytes = golden('v2.0-scan');
  it('that are cut off are missed', async () => {
    for (let end = 0; end < bytes.length; end += 997) expect(await ruleOf(bytes.subarray(0, end))).toMatch(/^K/);
  });
  it('that are changed are found', async () => {
    for (let at = 0; at < bytes.length; at += 9973) {
      const changed = bytes.slice();
      changed[at] ^= 1 << at % 8;
      expect(await ruleOf(changed), `byte ${at}`).toMatch(/^[A-Z]\d\d$/);
    }
  });
});

it('decodes pictures where somebody can', async () => {
  const seen = new Set<string>();
  const decode = (_: Uint8Array, type: string) => {
    seen.add(type);
    return Promise.reject(new Error('damaged'));
  };
  expect(await ruleOf(golden('v2.0-webp'), { decode })).toMatch(/^(O01|F16|F08)$/);
  expect([...seen]).toEqual(['image/jpeg']);
  expect(await ruleOf(golden('v2.0-scan'), { decode: () => Promise.resolve({ width: 1, height: 1 }) })).toMatch(/^(O01|F16|F08)$/);
});
