import { readFileSync, readdirSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

/** The project's root. */
export const root = process.env.TEXMESH_ROOT ??
  join(dirname(fileURLToPath(import.meta.url)), '..', '..', '..', '..');

export function readBytes(path: string): Uint8Array {
  return new Uint8Array(readFileSync(join(root, path)));
}
export function readText(path: string): string {
  return readFileSync(join(root, path), 'utf8');
}
/** A golden package (tests/golden). */
export const golden = (name: string): Uint8Array => readBytes(`tests/golden/${name}.texmesh`);
export const goldenNames = ['v2.0-scan'] as const;
/** All golden packages: one for each feature besides. */
export const goldenSet = readdirSync(join(root, 'tests/golden')).filter((file) => file.endsWith('.texmesh'))
  .map((file) => file.slice(0, -8));

/** Doubles with the same bits, NaN and signed zeros told apart. */
export function sameBits(a: number, b: number): boolean {
  return Object.is(a, b) || (a === 0 && b === 0);
}
