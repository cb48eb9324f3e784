import { describe, expect, it } from 'vitest';
import type { Manifest, TextureInfo } from '../../src/reader';
import { parseThesis } from '../../src/thesis';

// Two planes of 2 and 1 fragments; scales 0 and 5 are stored, the chain has 0, 2 and 5.
const manifest = { version: { major: 2, minor: 0 }, scales: [{ scale: 0 }, { scale: 5 }] } as Manifest;
const textures = [{ columns: 2, rows: 1 }, { columns: 1, rows: 1 }] as TextureInfo[];
const wholePackage = 0xffffffff;

const u16 = (...values: number[]): number[] => values.flatMap((v) => [v & 255, v >> 8]);
const u32 = (...values: number[]): number[] => [...new Uint8Array(Uint32Array.from(values).buffer)];
const f32 = (...values: number[]): number[] => [...new Uint8Array(Float32Array.from(values).buffer)];
type Section = [id: number, plane: number, bytes: number[]];
function thesis(...sections: Section[]): Uint8Array {
  const head = sections.flatMap(([id, plane, bytes]) => u32(id, plane, bytes.length));
  const bodies = sections.flatMap(([, , bytes]) => bytes);
  return Uint8Array.from(
    [...new TextEncoder().encode('TXTH'), ...u16(2, 0), ...u32(sections.length, 0), ...head, ...bodies]);
}
const parse = (...sections: Section[]) => parseThesis(thesis(...sections), manifest, textures);
const predictors: Section = [1, 0, [...u32(2), ...u16(65535, 0, 0, 0, 0, 0, 0, 0, 32767, 13107)]];
const models: Section = [2, 0, [...u32(2), ...f32(825.45, 0, 0.34, 0, 0.98, 0)]];
const sizes = u16(...Array.from({ length: 126 }, (_, k) => 300 + k));
const gamma: Section = [3, 1, [6, 2, 0, 0, ...f32(80, 72, 64, 56, 48, 40), ...sizes]];
const perceptual: Section = [4, wholePackage, [
  3, 0, 0, 0, 0, 2, 5, ...u32(1260, 1162, 700, 0, 49, 231), ...f32(0, 0.3, 0.4), ...f32(0, 0.6, 0.8),
  ...f32(0, 0.03, 0.04), ...f32(0, 0.1, 0.2),
  ...f32(1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12),
]];

describe('thesis.bin', () => {
  it('is read', () => {
    const t = parse(predictors, models, gamma, perceptual);
    expect([...t.planes[0].z]).toEqual([1, 0]);
    expect(t.planes[0].vqp[1]).toBe(Math.fround(13107 / 65535));
    expect(t.planes[1].totalBytes[125]).toBe(425);
    expect([...t.planes[1].quality]).toEqual([80, 72, 64, 56, 48, 40]);
    expect([...t.perceptual!.scale]).toEqual([0, 2, 5]);
    expect([...t.perceptual!.chainLeast]).toEqual([10, 11, 12]);
    expect(parse().planes.map((p) => p.z.length)).toEqual([0, 0]);
  });
  it('is refused wherever it is cut', () => {
    const bytes = thesis(predictors, models, gamma, perceptual);
    for (let n = 0; n < bytes.length; ++n)
      expect(() => parseThesis(bytes.subarray(0, n), manifest, textures)).toThrow();
    expect(() => parseThesis(Uint8Array.from([...bytes, 0]), manifest, textures)).toThrow(/O04/);
  });
  const changed = ([id, plane, bytes]: Section, at: number, value: number): Section =>
    [id, plane, bytes.map((b, k) => (k === at ? value : b))];
  const short: Section = [3, 1, [5, 1, 0, 0, ...f32(1, 1, 1, 1, 1), ...Array.from({ length: 105 }, () => 1)]];
  const nines = u16(...Array.from({ length: 126 }, () => 9));
  const wide: Section = [3, 1, [6, 2, 0, 0, ...f32(1, 1, 1, 1, 1, 1), ...nines]];
  const bad: [string, string, Section[]][] = [
    ['another order', 'O04', [models, predictors]],
    ['a section twice', 'O04', [models, models]],
    ['a plane that is not there', 'R16', [[2, 2, models[2]]]],
    ['models of another number of fragments', 'R16', [[2, 1, models[2]]]],
    ['a longer section', 'O05', [[2, 0, [...models[2], 0]]]],
    ['a Gamma table without the last scale', 'R16', [short]],
    ['a width that is too large', 'O05', [changed(wide, 1, 2)]],
    ['reserved bytes', 'W05', [changed(perceptual, 2, 1)]],
    ['a perceptual table of a plane', 'O05', [[4, 0, perceptual[2]]]],
    ['scales out of order', 'O05', [changed(perceptual, 5, 0)]],
    ['a scale of the manifest that is not there', 'R16', [changed(perceptual, 6, 7)]],
    ['a value below 0', 'O05', [changed(perceptual, 7 + 24 + 7, 0xbe)]],
  ];
  for (const [what, rule, sections] of bad)
    it(`is refused: ${what}`, () => expect(() => parse(...sections)).toThrow(`[${rule}]`));
  it('may have sections of later versions', () => {
    expect(parse(perceptual, [5, 3, [1, 2]]).perceptual).toBeDefined();
  });
});
