import { join } from 'node:path';
import { describe, expect, it } from 'vitest';
import { readText, root } from './support/files';

interface Choices { timeS: number; capBytesPerSecond: number; policy: string; scale: number | null; rung: number | null }
const { capsWith, choicesFromAddress, kPolicies, readable } = (await import(join(root, 'examples/viewer/src/choices.ts'))) as {
  capsWith(bytesPerSecond: number): [string, number][];
  choicesFromAddress(query: URLSearchParams): Choices;
  kPolicies: [string, string][];
  readable(url: string): string;
};
const at = (query: string): Choices => choicesFromAddress(new URLSearchParams(query));

describe("the viewer's choices", () => {
  it('are policies that the library has', () => {
    expect(kPolicies.map(([p]) => p).sort()).toEqual(['guard', 'htc', 'price', 'proportional', 'static']);
    for (const [policy] of kPolicies) expect(at(`policy=${policy}`).policy).toBe(policy);
    expect(at('policy=htca').policy).toBe('htc');
    for (const other of ['', 'policy=foo', 'policy=']) expect(at(other).policy).toBe('guard');
  });
  it('of a link are in the list, whatever an address asks for', () => {
    expect(capsWith(at('mbit=3').capBytesPerSecond)).toContainEqual(['3 Mbit/s', 375000]);
    expect(capsWith(at('mbit=2').capBytesPerSecond).filter(([, v]) => v === 250000).length).toBe(1);
    for (const other of ['', 'mbit=0', 'mbit=-1', 'mbit=x']) expect(capsWith(at(other).capBytesPerSecond)[0][1]).toBe(Infinity);
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

describe("the viewer's colours", () => {
  const css = readText('examples/viewer/src/style.css');
  const theme = (selector: string): Record<string, string> => {
    const block = css.slice(css.indexOf(selector)).split('}')[0];
    return Object.fromEntries([...block.matchAll(/--([\w-]+): (#[0-9a-f]{6})/g)].map((m) => [m[1], m[2]]));
  };
  /** WCAG 2: relative luminance, contrast. */
  const luminance = (colour: string): number => {
    const [r, g, b] = [1, 3, 5].map((i) => parseInt(colour.slice(i, i + 2), 16) / 255).map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
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
      for (const colour of ['k1', 'k2', 'k3', 'k4', 'warm', 'skipped', 'accent']) for (const ground of ['panel', 'paper']) expect([colour, ground, contrast(c[colour], c[ground]) >= 3]).toEqual([colour, ground, true]);
    });
    it(`of words by 4.5 : 1 (${name})`, () => {
      for (const colour of ['ink', 'muted']) for (const ground of grounds) expect([colour, ground, contrast(c[colour], c[ground]) >= 4.5]).toEqual([colour, ground, true]);
      expect(contrast(c.warm, c['paper-far'])).toBeGreaterThanOrEqual(4.5); // what went wrong
      expect(contrast(c['accent-ink'], c.accent)).toBeGreaterThanOrEqual(4.5);
    });
  }
});
