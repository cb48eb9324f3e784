/** The sum, added up in order. */
export function sumOf(values: ArrayLike<number> & Iterable<number>): number {
  let sum = 0;
  for (const v of values) sum += v;
  return sum;
}

/** The nearest number within limits. */
export const clamp = (v: number, least: number, most: number): number => Math.min(Math.max(v, least), most);

/** Every index of a typed array with a value > 0. */
export const positive = (values: Uint32Array): number[] => [...values.keys()].filter((i) => values[i] > 0);
