import { lumaQuantisers } from '../format/shared_numbers';
import { PlaneTables, bytesToShow } from '../format/tables';
import { clamp, sumOf } from './numbers';
import { exp, log } from './portable_math';

// The bytes of a fragment at a quality that no rung has: format/rules/size_curve.cpp, bit for bit.

/** Log of the mean of 1 / (step + 1), by whole quality: how fine it quantises. Strictly rising. */
const finenessOfWhole = /* @__PURE__ */ Array.from({ length: 101 }, (_, quality) => {
  const percent = quality < 50 ? Math.trunc(5000 / quality) : 200 - 2 * quality;
  const step = (q: number): number => clamp(Math.trunc((q * percent + 50) / 100), 1, 255);
  return log(sumOf(lumaQuantisers.map((q) => 1 / (step(q) + 1))) / 64);
});
function fineness(quality: number): number {
  const q = clamp(quality, 1, 100);
  const below = Math.trunc(q);
  const low = finenessOfWhole[below];
  return q > below ? low + (q - below) * (finenessOfWhole[below + 1] - low) : low;
}

/** The monotone cubic (Fritsch and Butland 1984) through points, between the k-th and the next. */
function hermite(x: readonly number[], y: readonly number[], k: number, at: number): number {
  const width = (i: number): number => x[i + 1] - x[i];
  const secant = (i: number): number => (y[i + 1] - y[i]) / width(i);
  const slope = (i: number): number => {
    if (i === 0) return secant(0);
    if (i + 1 === x.length) return secant(i - 1);
    const [before, after] = [secant(i - 1), secant(i)];
    if (before * after <= 0) return 0;
    const a = 2 * width(i) + width(i - 1);
    const b = width(i) + 2 * width(i - 1);
    return (a + b) / (a / before + b / after);
  };
  const h = width(k);
  const t = (at - x[k]) / h;
  const rest = 1 - t;
  return (
    y[k] * ((1 + 2 * t) * rest * rest) +
    h * slope(k) * (t * rest * rest) +
    y[k + 1] * (t * t * (3 - 2 * t)) +
    h * slope(k + 1) * (t * t * (t - 1))
  );
}

/** Where a quality lies on the plane's axis: its fineness at rungs and without knots. */
function axisAt({ rungQuality, knotQuality, knotPosition }: PlaneTables, quality: number): number {
  const above = rungQuality.findIndex((q) => q > quality);
  if (knotQuality.length === 0 || above <= 0) return fineness(quality);
  const [first, last] = [rungQuality[above - 1], rungQuality[above]];
  let [from, to] = [{ q: first, at: 0 }, { q: last, at: 1 }];
  knotQuality.forEach((q, k) => {
    const knot = { q, at: knotPosition[k] };
    if (q > first && q <= quality) from = knot;
    if (q > quality && q < to.q) to = knot;
  });
  const start = fineness(from.q);
  const part = (fineness(quality) - start) / (fineness(to.q) - start);
  const low = fineness(first);
  return low + (from.at + part * (to.at - from.at)) * (fineness(last) - low);
}

/** Bytes of a fragment at a quality between rungs; exact at rungs, 0 when it is not stored. */
export function interpolatedBytes(t: PlaneTables, fragment: number, quality: number): number {
  const stored = [...t.rungQuality].map((q, r) => ({ q, bytes: bytesToShow(t, r, fragment) }))
    .filter(({ bytes }) => bytes > 0);
  const exact = stored.find(({ q }) => q === quality);
  if (exact || stored.length === 0) return exact?.bytes ?? 0;
  const x = stored.map(({ q }) => fineness(q));
  const y = stored.map(({ bytes }) => log(bytes));
  const at = clamp(axisAt(t, quality), x[0], x[x.length - 1]);
  let k = 0;
  while (k + 2 < x.length && x[k + 1] <= at) ++k;
  return exp(at > x[0] ? hermite(x, y, k, at) : y[0]);
}
