import { ln2Hi, ln2Lo, pi, pio2Hi, pio2Lo } from '../format/shared_numbers';

// exp, log, sin, cos, pow with the same bits as format/base/portable_math.h: plain double arithmetic, where
// Math's functions differ from engine to engine. About 1e-15 relative.

const rootOfHalf = 0.7071067811865475244;

export { pi };

/** 2^k for |k| < 1000, without a power function. */
function powerOfTwo(k: number): number {
  let power = 1;
  for (; k > 0; --k) power *= 2;
  for (; k < 0; ++k) power /= 2;
  return power;
}

/** Nearest whole number, ties to even, far below 2^52: above that there are no fractions. */
const nearestInteger = (x: number): number => x + 6755399441055744 - 6755399441055744;

function sinReduced(r: number): number {
  const z = r * r;
  let s = 0;
  for (let k = 17; k >= 3; k -= 2) s = (1 + s) * (-z / (k * (k - 1)));
  return r * (1 + s);
}

function cosReduced(r: number): number {
  const z = r * r;
  let s = 0;
  for (let k = 18; k >= 2; k -= 2) s = (1 + s) * (-z / (k * (k - 1)));
  return 1 + s;
}

function sinQuadrant(x: number, add: number): number {
  const q = nearestInteger(x / (pi / 2));
  const r = x - q * pio2Hi - q * pio2Lo;
  switch ((q + add) & 3) {
    case 0:
      return sinReduced(r);
    case 1:
      return cosReduced(r);
    case 2:
      return -sinReduced(r);
    default:
      return -cosReduced(r);
  }
}

/** e to the power of x. */
export function exp(x: number): number {
  if (x > 709.78) return Infinity;
  if (x < -745.2) return 0;
  const q = nearestInteger(x / (ln2Hi + ln2Lo));
  const r = x - q * ln2Hi - q * ln2Lo;
  let s = 1;
  for (let k = 14; k >= 1; --k) s = 1 + s * (r / k);
  // By halves, so that no power is out of range and there is one rounding.
  return s * powerOfTwo(q >> 1) * powerOfTwo(q - (q >> 1));
}

/** Natural logarithm of x > 0. */
export function log(x: number): number {
  if (!(x > 0 && x < Infinity)) return Math.log(x); // which is exact there
  let e = 0;
  for (; x < rootOfHalf; x *= 2) --e;
  for (; x >= 2 * rootOfHalf; x /= 2) ++e;
  const f = (x - 1) / (x + 1);
  const z = f * f;
  let s = 0;
  for (let k = 23; k >= 1; k -= 2) s = 1 / k + z * s;
  return e * ln2Hi + (2 * f * s + e * ln2Lo);
}

/** Sine of |x| <= 1e6. */
export function sin(x: number): number {
  return sinQuadrant(x + 0, 0); // 0 of -0, as in C++
}

/** Cosine of |x| <= 1e6. */
export function cos(x: number): number {
  return sinQuadrant(x, 1);
}

/** base > 0 to a power. */
export function pow(base: number, exponent: number): number {
  return exp(exponent * log(base));
}
