import { describe, expect, it } from 'vitest';
import { readThesis } from '../../src/http/read_thesis';
import { PackageReader } from '../../src/reader';
import { coarsestAlike } from '../../src/decide/own_jnd';
import { golden } from '../support/files';

describe('a JND of the viewer', () => {
  it('goes to the coarsest scale that cannot be told from the wanted one', async () => {
    const reader = await PackageReader.openBytes(golden('v2.0-scan'), 'scan');
    const { perceptual: table } = (await readThesis(reader))!;
    const scales = reader.manifest.scales.map((s) => s.scale), n = table!.scale.length;
    for (const printed of [false, true])
      for (const jnd of [1e-9, 0.02, 0.05, 0.1, 0.3, 1]) {
        const policy = printed ? 'thesis' : undefined;
        const alike = await coarsestAlike({ reader, options: { jnd, policy } });
        for (const wanted of scales) {
          // The pairs of S_i stand one behind the other, row by row.
          const row = table!.scale.indexOf(wanted);
          let at = 0;
          for (let i = 0; i < row; ++i) at += n - 1 - i;
          const values = (printed ? table!.chainAverage : table!.p95).slice(at, at + n - 1 - row);
          const told = values.findIndex((v) => v >= jnd), reached = row + (told < 0 ? values.length : told);
          const expected = scales.filter((s) => table!.scale.indexOf(s) <= reached).at(-1)!;
          expect(alike(wanted), `${printed} ${jnd} ${wanted}`).toBe(Math.max(wanted, expected));
        }
      }
    const nothing = await coarsestAlike({ reader, options: { jnd: 1e-9 } });
    const all = await coarsestAlike({ reader, options: { jnd: 1 } });
    expect(scales.map(nothing)).toEqual(scales);
    expect(all(0)).toBe(scales.at(-1));
    expect(all(77)).toBe(77); // no scale of the chain
  });
  it('needs a package with perceptual values', async () => {
    const reader = await PackageReader.openBytes(golden('v2.0-scan'), 'scan');
    const { thesis, ...manifest } = reader.manifest;
    expect(thesis).toBeDefined();
    const without = { manifest } as unknown as PackageReader;
    await expect(coarsestAlike({ reader: without, options: { jnd: 0.1 } }))
      .rejects.toThrow(/perceptual values/);
    for (const jnd of [0, -1, 1.1, NaN])
      await expect(coarsestAlike({ reader, options: { jnd } })).rejects.toThrow(/jnd/);
  });
});
