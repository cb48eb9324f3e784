import { join } from 'node:path';
import { describe, expect, it } from 'vitest';
import { type About, type Manifest, PackageReader, type PlaneTables } from '../src/reader';
import { golden, readText, root } from './support/files';

interface Choices { timeS: number; capBytesPerSecond: number; policy: string; scale: number
  | null; rung: number | null }
interface Turn { at: number; plannedS: number; actualS: number; skipped: boolean }
const viewer = (file: string): Promise<unknown> => import(join(root, 'examples/viewer/src', file));
const { capsWith, choicesFromAddress, kPolicies, readable } = (await viewer('choices.ts')) as {
  capsWith(bytesPerSecond: number): [string, number][];
  choicesFromAddress(query: URLSearchParams): Choices;
  kPolicies: [string, string][];
  readable(url: string): string;
};
const { stepData } = (await viewer('panel/scale_plot.ts')) as { stepData(m: Manifest): number[][] };
const { ladderData } = (await viewer('panel/ladder_plot.ts')) as { ladderData(t: PlaneTables): number[][] };
const { turnData } = (await viewer('panel/time_plots.ts')) as { turnData(turns: Turn[],
  of: (t: Turn) => (number | null)[]): (number | null)[][] | null };
const { rightsOf } = (await viewer('rights.ts')) as { rightsOf(about: About | null): { by: string;
  licence: string; url: string } };
const at = (query: string): Choices => choicesFromAddress(new URLSearchParams(query));

describe("the viewer's line about rights", () => {
  it('says whose the object is, and links the licence', () => {
    expect(rightsOf({ creator: 'A', attribution: 'B', licence: 'MIT', licenceUrl: 'https://a.b/' }))
      .toEqual({ by: 'B', licence: 'MIT', url: 'https://a.b/' });
    expect(rightsOf({ creator: 'A', licence: 'ask' })).toEqual({ by: 'A', licence: 'ask', url: '' });
    expect(rightsOf({ licenceUrl: 'https://a.b/' })).toEqual({ by: '', licence: '', url: '' });
    expect(rightsOf(null)).toEqual({ by: '', licence: '', url: '' });
  });
});

describe("the viewer's choices", () => {
  it('are policies that the library has', () => {
    expect(kPolicies.map(([p]) => p).sort()).toEqual(['guard', 'thesis']);
    for (const [policy] of kPolicies) expect(at(`policy=${policy}`).policy).toBe(policy);
    for (const other of ['', 'policy=foo', 'policy=', 'policy=htca']) expect(at(other).policy).toBe('guard');
  });
  it('of a link are in the list, whatever an address asks for', () => {
    expect(capsWith(at('mbit=3').capBytesPerSecond)).toContainEqual(['3 Mbit/s', 375000]);
    expect(capsWith(at('mbit=2').capBytesPerSecond).filter(([, v]) => v === 250000).length).toBe(1);
    for (const other of ['', 'mbit=0', 'mbit=-1', 'mbit=x'])
      expect(capsWith(at(other).capBytesPerSecond)[0][1]).toBe(Infinity);
  });
  it('of time and scale are numbers or nothing', () => {
    expect(at('time=none').timeS).toBe(Infinity);
    expect(at('time=-3&scale=x')).toMatchObject({ timeS: 4, scale: null });
    expect(at('scale=0&rung=2')).toMatchObject({ scale: 0, rung: 2 });
    expect(at('scale=1.5&rung=-1')).toMatchObject({ scale: null, rung: null });
  });
  it('a URL with broken escapes is shown as it stands', () => {
    expect(readable('%')).toBe('%');
    expect(readable('a%20b')).toBe('a b');
  });
});

/** Two fragments of equal surface and two rungs; `more` in place of some of it. */
const tables = (more: Partial<PlaneTables> = {}): PlaneTables => ({
  columns: 2, rows: 1, incremental: false, order: Uint16Array.of(1, 0), rungQuality: Uint8Array.of(20, 80),
  tableBytes: Uint32Array.of(5, 7),
  sizeBytes: Uint32Array.of(10, 20, 30, 40), dssim: Float32Array.of(0.25, 0.125, 0.125, 0.0625),
  skipDssim: Float32Array.of(0.5, 0.75),
  coveredTexels: Uint32Array.of(100, 100), surfaceFraction: Float32Array.of(0.5, 0.5), ...more,
} as PlaneTables);

describe("the viewer's plots", () => {
  it('of scales ask by each rule for triangles of a scale, for no fewer on a larger display', async () => {
    const { manifest } = await PackageReader.openBytes(golden('v2.0-scan'));
    const [x, ...rules] = stepData(manifest);
    expect(rules.length).toBe(3);
    expect(x).toEqual([...x].sort((a, b) => a - b));
    expect([x[0] >= 16, x.at(-1)! >= 4096]).toEqual([true, true]);
    const triangles = manifest.scales.map((s) => s.triangles);
    for (const rule of rules) {
      expect(rule.length).toBe(x.length);
      expect(rule).toEqual([...rule].sort((a, b) => a - b)); // larger displays need more
      for (const v of rule) expect(triangles).toContain(v);
    }
  });
  it('of the ladder add up bytes, with those of the rungs below where a rung continues them', () => {
    const sums = [10 + 20 + 5, 30 + 40 + 7];
    const ssim = [1 - (0.25 + 0.125) / 2, 1 - (0.125 + 0.0625) / 2];
    expect(ladderData(tables())).toEqual([[20, 80], sums, ssim]);
    expect(ladderData(tables({ incremental: true }))).toEqual([[20, 80], [sums[0], sums[0] + sums[1]], ssim]);
    // nothing is stored
    expect(ladderData(tables({ order: new Uint16Array() }))).toEqual([[20, 80], [5, 7], [1, 1]]);
  });
  it('of time are in the order in which fragments came, without those that were skipped', () => {
    const turn = (t: number, skipped = false): Turn =>
      ({ at: t, plannedS: 10 * t, actualS: 100 * t, skipped });
    const of = (t: Turn): (number | null)[] => [t.plannedS, t.at > 2 ? null : t.actualS];
    expect(turnData([turn(3), turn(2, true), turn(1)], of)).toEqual([[1, 3], [10, 30], [100, null]]);
    expect(turnData([turn(1), turn(2, true)], of)).toBe(null);
  });
});

describe("the viewer's colours", () => {
  const css = readText('examples/viewer/src/style.css');
  const theme = (selector: string): Record<string, string> => {
    const block = css.slice(css.indexOf(selector)).split('}')[0];
    return Object.fromEntries([...block.matchAll(/--([\w-]+): (#[0-9a-f]{6})/g)].map((m) => [m[1], m[2]]));
  };
  /** WCAG 2: relative luminance, contrast. */
  const luminance = (colour: string): number => {
    const [r, g, b] = [1, 3, 5].map((i) => parseInt(colour.slice(i, i + 2), 16) / 255)
      .map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const contrast = (a: string, b: string): number => {
    const [dark, light] = [luminance(a), luminance(b)].sort((x, y) => x - y);
    return (light + 0.05) / (dark + 0.05);
  };
  it('are measured as WCAG says', () => {
    expect(contrast('#000000', '#ffffff')).toBeCloseTo(21, 6);
    expect(contrast('#777777', '#ffffff')).toBeCloseTo(4.48, 2);
  });
  for (const [name, selector] of [['light', ':root {'], ['dark', ":root[data-theme='dark'] {"]]) {
    const c = theme(selector);
    const grounds = ['panel', 'paper', 'paper-far'];
    it(`of curves and fragments stand out by 3 : 1 (${name})`, () => {
      for (const colour of ['k1', 'k2', 'k3', 'k4', 'warm', 'skipped', 'accent'])
        for (const ground of ['panel', 'paper'])
          expect([colour, ground, contrast(c[colour], c[ground]) >= 3]).toEqual([colour, ground, true]);
    });
    it(`of words by 4.5 : 1 (${name})`, () => {
      for (const colour of ['ink', 'muted']) for (const ground of grounds)
        expect([colour, ground, contrast(c[colour], c[ground]) >= 4.5]).toEqual([colour, ground, true]);
      expect(contrast(c.warm, c['paper-far'])).toBeGreaterThanOrEqual(4.5); // what went wrong
      expect(contrast(c['accent-ink'], c.accent)).toBeGreaterThanOrEqual(4.5);
    });
  }
});
