// exp, log, sin, cos, atan2, pow with the same bits as format/portable_math: plain double arithmetic, where Math's
// functions differ from engine to engine. About 1e-15 relative.

const ln2Hi = 6.93147180369123816490e-1;
const ln2Lo = 1.90821492927058770002e-10;
const pio2Hi = 1.57079632673412561417;
const pio2Lo = 6.0771005065061922493e-11;

export const pi = 3.14159265358979323846;

const bits = new DataView(new ArrayBuffer(8));

/** 2^k for -1022 <= k <= 1023, without a power function. */
function powerOfTwo(k: number): number {
  bits.setUint32(0, (k + 1023) << 20);
  bits.setUint32(4, 0);
  return bits.getFloat64(0);
}

/** value * 2^k with one rounding, for normal values near 1. */
function scaledByPower(value: number, k: number): number {
  if (k > 1023) return value * powerOfTwo(1023) * powerOfTwo(k - 1023);
  if (k >= -1021) return value * powerOfTwo(k);
  return value * powerOfTwo(k + 200) * powerOfTwo(-200);
}

/** Nearest whole number, ties to even: what nearbyint does. */
function nearestInteger(x: number): number {
  const below = Math.floor(x);
  const rest = x - below;
  if (rest < 0.5) return below;
  if (rest > 0.5) return below + 1;
  return below % 2 === 0 ? below : below + 1;
}

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

function atanPositive(tangent: number): number {
  let t = tangent;
  for (let halvings = 0; halvings < 2; ++halvings) t = t / (1 + Math.sqrt(1 + t * t));
  const z = t * t;
  let s = 0;
  for (let k = 27; k >= 1; k -= 2) s = 1 / k - z * s;
  return 4 * t * s;
}

/** e to the power of x. */
export function exp(x: number): number {
  if (Number.isNaN(x)) return x;
  if (x > 709.78) return Infinity;
  if (x < -745.2) return 0;
  const q = nearestInteger(x / (ln2Hi + ln2Lo));
  const r = x - q * ln2Hi - q * ln2Lo;
  let s = 1;
  for (let k = 14; k >= 1; --k) s = 1 + s * (r / k);
  return scaledByPower(s, q);
}

/** Natural logarithm of x > 0. */
export function log(x: number): number {
  if (!(x > 0)) return x === 0 ? -Infinity : NaN;
  if (x === Infinity) return x;
  let e = 0;
  let value = x;
  if (value < 2.2250738585072014e-308) {
    value *= powerOfTwo(60);
    e = -60;
  }
  bits.setFloat64(0, value);
  const high = bits.getUint32(0);
  e += (high >>> 20) - 1022;
  bits.setUint32(0, (high & 0x000fffff) | (1022 << 20));
  let m = bits.getFloat64(0); // in [0.5, 1)
  if (m < 0.7071067811865475244) {
    m *= 2;
    --e;
  }
  const f = (m - 1) / (m + 1);
  const z = f * f;
  let s = 0;
  for (let k = 23; k >= 1; k -= 2) s = 1 / k + z * s;
  return e * ln2Hi + (2 * f * s + e * ln2Lo);
}

/** Of |x| <= 1e6. */
export function sin(x: number): number {
  return sinQuadrant(x, 0);
}

/** Of |x| <= 1e6. */
export function cos(x: number): number {
  return sinQuadrant(x, 1);
}

/** Angle of the point (x, y). */
export function atan2(y: number, x: number): number {
  const ax = Math.abs(x);
  const ay = Math.abs(y);
  if (ax === 0 && ay === 0) return 0;
  let a = ay <= ax ? atanPositive(ay / ax) : pi / 2 - atanPositive(ax / ay);
  if (x < 0) a = pi - a;
  return y < 0 ? -a : a;
}

/** base > 0 to a power. */
export function pow(base: number, exponent: number): number {
  return exp(exponent * log(base));
}
