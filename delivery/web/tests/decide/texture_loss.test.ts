import { describe, expect, it } from 'vitest';
import { shownFlip } from '../../src/reader';
import { textureForBudget } from '../support/texture_budget';
import { setUp } from '../support/transferring';

describe('what is shown', () => {
  it('is predicted as the plan of the same rungs', async () => {
    const { data } = await setUp();
    for (const bytes of [0, 20000, 1e6]) {
      const { planes, list, rungs, flip } = textureForBudget(data, 200, 0, bytes);
      const shown = planes.map((p) => ({ ...p,
        rungs: new Int16Array(data.tables[p.plane]!.columns * data.tables[p.plane]!.rows).fill(-1) }));
      list.fragments.forEach(
        ({ plane, fragment }, i) => (shown.find((p) => p.plane === plane)!.rungs[fragment] = rungs[i]));
      expect(shownFlip(data, 200, 0, shown)).toBeCloseTo(flip, 9);
    }
  });
  it('is better with more of it, and equal to the source without textures on S_0', async () => {
    const { data } = await setUp();
    const [, t] = [0, data.tables[0]!];
    const at = (rung: number, scale = 0): number =>
      shownFlip(data, 500, scale,
        [{ base: 0, plane: 0, rungs: new Int16Array(t.columns * t.rows).fill(rung) }]);
    expect(at(0)).toBeLessThan(at(-1));
    expect(at(t.rungQuality.length - 1)).toBeLessThan(at(0));
    expect(at(0, data.manifest.scales.at(-1)!.scale)).toBeGreaterThan(at(0));
    expect(shownFlip(data, 500, 0, [])).toBe(0);
  });
});
