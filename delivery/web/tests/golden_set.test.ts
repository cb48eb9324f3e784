import { execFileSync, spawnSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { afterAll, describe, expect, it } from 'vitest';
import type { SplitMesh } from '../src/format/splits/split_mesh';
import { goldenSet, golden, root } from './support/files';
import { readAll } from './support/read_all';

const python =
  ['python3', '/usr/bin/python3'].find((p) => spawnSync(p, ['-c', 'import numpy, PIL']).status === 0);
const folder = mkdtempSync(join(tmpdir(), 'texmesh-golden-'));
afterAll(() => rmSync(folder, { recursive: true }));

/** Whole numbers of points, wedges and faces, as the reader in Python writes them (`mesh --raw`). */
function rawNumbers(mesh: SplitMesh): string {
  const lines: string[] = [];
  const line = (kind: string, ...numbers: Iterable<number>[]): number =>
    lines.push([kind, ...numbers.flatMap((n) => [...n])].join(' '));
  for (let p = 0; p < mesh.points; ++p) line('p', mesh.places.data.subarray(3 * p, 3 * p + 3));
  for (let w = 0; w < mesh.wedges; ++w)
    line('w', [mesh.wedgePoint.data[w]],
      ...mesh.components.map((n, k) => mesh.values[k].data.subarray(n * w, n * w + n)));
  for (let f = 0; f < mesh.faceCount; ++f)
    line('f', mesh.faces.data.subarray(3 * f, 3 * f + 3), [mesh.faceGroup.data[f]]);
  return lines.join('\n') + '\n';
}

describe('golden packages are read to their end', () => {
  it('are many', () => {
    expect(goldenSet.length).toBeGreaterThanOrEqual(10);
  });
  it.each(goldenSet)('%s', async (name) => {
    const splits = await readAll(golden(name));
    if (!splits || !python) return;
    const out = join(folder, `${name}.raw`);
    const reader = join(root, 'examples/reader/texmesh_reader.py');
    execFileSync(python,
      ['-B', reader, 'mesh', join(root, `tests/golden/${name}.texmesh`), '--raw', '-o', out]);
    expect(rawNumbers(splits.mesh)).toBe(readFileSync(out, 'utf8'));
  });
  it.skipIf(spawnSync('python3', ['--version']).status !== 0)(
      'of a later minor version, with a ZIP64 end record', async () => {
    const out = join(folder, 'later.texmesh');
    execFileSync('python3',
      [join(root, 'tests/golden/make_later'), join(root, 'tests/golden/v2.0-webp.texmesh'), out]);
    await readAll(readFileSync(out));
  });
});
