import { describe, expect, it } from 'vitest';
import { fragmentList, fullSize } from '../../src/reader';
import { setUp } from '../support/transferring';

describe('fragment list', () => {
  it('leaves to the preview what no rung shows better', async () => {
    const { data, list } = await setUp();
    const tables =
      data.tables.map((t, p) => (t && p === 0 ? { ...t, skipDssim: t.skipDssim.map(() => 0) } : t));
    const shorter = fragmentList({ ...data, tables }, fullSize(data.textures), { scale: 0 });
    expect(shorter.fragments).toEqual(list.fragments.filter((f) => f.plane !== 0));
    expect(shorter.fragments.length).toBeLessThan(list.fragments.length);
    expect(shorter.previewLoss).toEqual([0, 0, 0]);
  });
});
