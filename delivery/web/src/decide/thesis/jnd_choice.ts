import type { PerceptualTable } from '../../format/thesis/thesis_tables';

// A client's own just-noticeable difference on the values of thesis.bin: format/rules/jnd_choice.cpp, bit for bit.

/** What says how much two scales differ: the distance of their surfaces, or the thesis's strategies (7.2). */
export type PerceptualStatistic = 'p95' | 'average' | 'conservative' | 'aggressive';
/** How collapses of several scale changes count together: root of the sum of squares, or against the vertex that is left. */
export type ChainRule = 'root-of-squares' | 'survivor';

/** Values of all pairs from those of the steps: [i * n + j], i < j; [k] of `step` is the change from row k - 1 to row k. */
export function chainedValues(step: ArrayLike<number>): Float32Array {
  const n = step.length;
  const value = new Float32Array(n * n);
  for (let i = 0; i < n; ++i) {
    let squares = 0;
    for (let j = i + 1; j < n; ++j) {
      squares += step[j] * step[j];
      value[i * n + j] = Math.sqrt(squares);
    }
  }
  return value;
}

/** Values of all pairs by one statistic: [i * n + j], i < j. p95 is measured for each pair and knows no chain. */
export function pairValues(t: PerceptualTable, statistic: PerceptualStatistic, chain: ChainRule = 'root-of-squares'): Float32Array {
  const steps = { average: t.average, conservative: t.largest, aggressive: t.least };
  if (statistic !== 'p95' && chain === 'root-of-squares') return chainedValues(steps[statistic]);
  const pairs = { p95: t.p95, average: t.chainAverage, conservative: t.chainLargest, aggressive: t.chainLeast }[statistic];
  const n = t.scale.length;
  const value = new Float32Array(n * n);
  let at = 0;
  for (let i = 0; i < n; ++i) for (let j = i + 1; j < n; ++j) value[i * n + j] = pairs[at++];
  return value;
}

/** The coarsest row behind `row` that nobody can tell from it; `row` itself where the next one is noticeable. */
export function coarsestAlike(value: Float32Array, rows: number, row: number, jnd: number): number {
  let last = row;
  while (last + 1 < rows && value[row * rows + last + 1] < jnd) ++last;
  return last;
}

/** The rows of major scales: each the last of its tier (Fig. 7.13). */
export function majorRows(value: Float32Array, rows: number, jnd: number): number[] {
  const major: number[] = [];
  for (let i = 0; i + 1 < rows; ) major.push((i = Math.max(i + 1, coarsestAlike(value, rows, i, jnd))));
  return major;
}

/** Where refinement from row `have` towards the finer row `want` may stop; `have` where refining shows nothing. */
export const refineTo = (value: Float32Array, rows: number, have: number, want: number, jnd: number): number =>
  want < have ? Math.min(have, coarsestAlike(value, rows, want, jnd)) : have;
