import { describe, expect, it } from 'vitest';
import { planesWithin, scaleWithin } from '../../src/decide/gpu_memory';
import { scaleBytes, textureBytes } from '../../src/decide/gpu_size';
import { TextureLoss, fullSize } from '../../src/decide/texture_loss';
import { setUp } from '../support/transferring';

describe('memory on the GPU', () => {
  it('counts every mip level', () => {
    expect(textureBytes(1, 1)).toBe(4);
    expect(textureBytes(4, 2)).toBe(4 * (8 + 2 + 1));
    expect(textureBytes(4, 2, 1)).toBe(32);
    expect(textureBytes(256, 256)).toBe(4 * (4 ** 9 - 1) / 3);
  });
  it('takes the finest scale that leaves room for textures, the coarsest where none does', () => {
    const scales = [[0, 4000, 8000], [3, 1000, 2000],
      [5, 10, 20]].map(([scale, vertices, triangles]) => ({ scale, vertices, triangles })) as never[];
    const bytes = scaleBytes({ vertices: 1000, triangles: 2000 });
    expect(scaleWithin(scales, 0, Infinity)).toBe(0);
    expect(scaleWithin(scales, 0, 2 * bytes)).toBe(3);
    expect(scaleWithin(scales, 0, 2 * bytes - 1)).toBe(5);
    expect(scaleWithin(scales, 4, Infinity)).toBe(5);
    expect(scaleWithin(scales, 0, 0)).toBe(5);
  });
  it('is filled with the planes that lose least, and never more than there is', async () => {
    const { data } = await setUp();
    const loss = new TextureLoss(data, 1000);
    const all = fullSize(data.textures);
    const bytesOf = (planes: { plane: number }[]): number =>
      planes.reduce((sum, { plane }) =>
        sum + textureBytes(data.textures[plane].widthPx, data.textures[plane].heightPx), 0);
    const whole = bytesOf(all);
    expect(planesWithin(loss, all, whole)).toEqual(all);
    let before = whole;
    for (const share of [0.9, 0.5, 0.3, 0.1]) {
      const planes = planesWithin(loss, all, share * whole);
      expect(planes.map((p) => p.base)).toEqual(all.map((p) => p.base));
      const coarsest = planes.every(({ base, plane }) =>
        !data.textures.some((t) => t.base === base && t.mip > data.textures[plane].mip));
      expect(bytesOf(planes) <= share * whole || coarsest).toBe(true);
      expect(bytesOf(planes)).toBeLessThanOrEqual(before);
      before = bytesOf(planes);
    }
    expect(before).toBeLessThan(whole);
    expect(bytesOf(planesWithin(loss, all, 0))).toBeLessThanOrEqual(before); // as coarse as there is
  });
});
