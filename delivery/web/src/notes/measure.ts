// Lengths on the object, with what they may be wrong by.

import type { Point } from '../format/annotations';
import type { Manifest } from '../format/manifest';
import { distance } from './pick';

/** Of the largest extent, where the package does not say it; what ScalesOptions ask for. */
const usualBits = 16;
const leastBits = 6; // no coder takes fewer

/** The least bits that positions have of the largest extent, as the package's provenance says. */
export function positionBits(provenance: unknown): number {
  const scales = (provenance as { options?: { scales?: Record<string, unknown> } } | null)?.options?.scales;
  for (const name of ['position_bits', 'least_position_bits']) {
    const bits = scales?.[name];
    if (typeof bits === 'number' && bits >= 1) return Math.min(Math.max(bits, leastBits), 24);
  }
  return usualBits;
}

/** A length in object units. */
export interface Length {
  length: number;
  /** The largest error that the scale shown and the grid of positions allow. */
  error: number;
}

/**
 * The length of a line of points that were picked on a scale. Each point may lie off the source's surface by
 * the scale's largest distance from S_0, and by half a step of the grid along each axis.
 */
export function lengthOf(points: readonly Point[], manifest: Manifest, scale: number,
    bits = usualBits): Length {
  const { objectHeight, scales } = manifest;
  const shown = scales.find((s) => s.scale === scale) ?? scales[scales.length - 1];
  const grid = (Math.sqrt(3) / 2) * (objectHeight / (2 ** bits - 1));
  const pieces = points.slice(1).map((p, i) => distance(points[i], p));
  return { length: pieces.reduce((sum, piece) => sum + piece, 0),
    error: 2 * pieces.length * (shown.errorMax + grid) };
}

const units: [number, string][] = [[1e3, 'km'], [1, 'm'], [0.01, 'cm'], [0.001, 'mm']];

/**
 * "12.3 cm ± 0.1 cm": as many digits as the error leaves. `metres`: of one object unit; without it, the
 * numbers are of object units, or of `name`.
 */
export function lengthInWords({ length, error }: Length, metres = 0, name = 'units'): string {
  const inMetres = length * metres;
  const [size, unitName] = metres > 0
    ? units.find(([least]) => inMetres >= least) ?? units[units.length - 1] : [1, name];
  const factor = metres > 0 ? metres / size : 1;
  const [value, off] = [length * factor, error * factor];
  // One digit of the error, rounded up, and the length to that digit.
  const inSteps = (power: number): number => Math.ceil((off / 10 ** power) * (1 - 1e-9));
  let power = Math.floor(Math.log10(off > 0 ? off : Math.max(value, 1e-9) / 1e5));
  if (inSteps(power) > 9) ++power;
  const digits = Math.min(9, Math.max(0, -power));
  const rounded = (inSteps(power) * 10 ** power).toFixed(digits);
  return `${value.toFixed(digits)} ${unitName} ± ${rounded} ${unitName}`;
}
