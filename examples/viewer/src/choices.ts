import type { Policy } from 'texmesh';

/** What a person may choose. Infinity: no limit; null: the library chooses. */
export interface Choices {
  timeS: number;
  capBytesPerSecond: number;
  policy: Policy;
  scale: number | null;
  rung: number | null;
}

/** A longer time limit counts as none. */
const kMostTimeS = 3600;
export const kTimes = [0.5, 1, 1.5, 2, 3, 4, 6, 8, 12, 20, 30, 60, Infinity];
const kCaps: [string, number][] = [
  ['as it is', Infinity], ['0.5 Mbit/s', 62500], ['1 Mbit/s', 125000], ['2 Mbit/s', 250000],
  ['5 Mbit/s', 625000], ['10 Mbit/s', 1.25e6],
  ['50 Mbit/s', 6.25e6],
];
export const kPolicies: [Policy, string][] =
  [['guard', 'keeps the time'], ['thesis', 'as printed in the thesis']];

/** The bandwidths to choose from, `bytesPerSecond` among them. */
export function capsWith(bytesPerSecond: number): [string, number][] {
  if (kCaps.some(([, v]) => v === bytesPerSecond)) return kCaps;
  return [...kCaps, [`${Number((bytesPerSecond / 125000).toPrecision(3))} Mbit/s`, bytesPerSecond]];
}

/**
 * The choices that the page's address makes, so that a link shows others the same. A value that cannot be
 * chosen counts as none.
 */
export function choicesFromAddress(query: URLSearchParams): Choices {
  const number = (name: string): number | null => {
    const v = query.get(name);
    return v !== null && v !== '' && Number.isFinite(Number(v)) ? Number(v) : null;
  };
  const whole = (name: string): number | null => {
    const v = number(name);
    return v !== null && Number.isInteger(v) && v >= 0 ? v : null;
  };
  const time = number('time');
  const mbit = number('mbit');
  return {
    timeS: query.get('time') === 'none' || (time ?? 0) > kMostTimeS ? Infinity
      : time !== null && time > 0 ? time : 4,
    capBytesPerSecond: mbit !== null && mbit > 0 ? mbit * 125000 : Infinity,
    policy: kPolicies.find(([p]) => p === query.get('policy'))?.[0] ?? 'guard',
    scale: whole('scale'),
    rung: whole('rung'),
  };
}

/** A URL without its escapes; a URL with broken escapes is left as it is. */
export function readable(url: string): string {
  try {
    return decodeURIComponent(url);
  } catch {
    return url;
  }
}
