import { join } from 'node:path';
import { describe, expect, it } from 'vitest';
import { root } from './support';

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
  });
  it('a URL with broken escapes is shown as it stands', () => {
    expect(readable('%')).toBe('%');
    expect(readable('a%20b')).toBe('a b');
  });
});
