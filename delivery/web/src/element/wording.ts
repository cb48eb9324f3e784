// What the element says to people, and what its attributes mean.

import { type Orbit, defaultOrbit } from '../page/framing';

/** Bytes as people read them. */
export function bytesInWords(n: number): string {
  if (!Number.isFinite(n) || n < 0) return '';
  const [unit, name] = n < 999.5e3 ? [1e3, 'kB'] : [1e6, 'MB'];
  const value = n / unit;
  return `${value < 9.95 ? value.toFixed(1).replace('.0', '') : value.toFixed(0)} ${name}`;
}
/** Seconds as people read them. */
export const secondsInWords = (s: number): string =>
  (s < 1 ? 'under a second' : s < 9.5 ? `about ${Math.round(s)} s` : `about ${Math.round(s / 5) * 5} s`);

/** What a click costs: bytes of the first picture and of all (0: unknown), bytes per second (0: unknown). */
export function offerInWords(firstBytes: number, allBytes: number, linkBytesS: number): string {
  const wait = linkBytesS > 0 ? `, ${secondsInWords(firstBytes / linkBytesS)}` : '';
  const more = allBytes > firstBytes ? `; up to ${bytesInWords(allBytes)} in all` : '';
  return `${bytesInWords(firstBytes)}${wait}${more}`;
}

/** An angle, "30deg" or ".5rad", in degrees; `otherwise` where it cannot be read. */
export function degreesOf(said: string | null | undefined, otherwise: number): number {
  const found = /^(-?(?:\d+\.?\d*|\.\d+))(deg|rad)$/.exec(said?.trim() ?? '');
  return found ? Number(found[1]) * (found[2] === 'rad' ? 180 / Math.PI : 1) : otherwise;
}
/** "28deg 72deg 105%" or parts of it: angles round and from the vertical axis, distance. Else the default. */
export function orbitOf(text: string | null): Orbit {
  const [theta, phi, distance] = (text ?? '').trim().split(/\s+/).filter(Boolean);
  const share = /^(\d+(?:\.\d+)?)%$/.exec(distance ?? '');
  return {
    thetaDegrees: degreesOf(theta, defaultOrbit.thetaDegrees),
    phiDegrees: Math.min(179, Math.max(1, degreesOf(phi, defaultOrbit.phiDegrees))),
    distance: share ? Math.min(20, Math.max(0.05, Number(share[1]) / 100)) : defaultOrbit.distance,
  };
}

/** A number that an attribute says, within bounds; `otherwise` where it says none. */
export function numberOf(text: string | null, otherwise: number, least: number, most: number): number {
  const value = text === null || text.trim() === '' ? NaN : Number(text);
  return Number.isFinite(value) ? Math.min(most, Math.max(least, value)) : otherwise;
}

// What an element knows of the way to its server before anything is asked for.

interface Connection {
  saveData?: boolean;
  /** Mbit/s */
  downlink?: number;
}
const connection = (): Connection =>
  (globalThis.navigator as { connection?: Connection } | undefined)?.connection ?? {};
const bytesPerMegabit = 125e3;
/** Smaller files say how long the way is, not how wide. */
const tellingBytes = 3e4;
/** A file that is larger is none. */
export const mostBytes = 1e12;

/** Whether the user wants no more bytes than need be. */
export const savesData = (): boolean => connection().saveData === true;
/** Bytes per second of the link: as the browser says, else as the page's own files came; 0: nobody knows. */
export function linkBytesS(): number {
  const files = performance.getEntriesByType('resource') as PerformanceResourceTiming[];
  const rates = files.filter((f) => f.transferSize > tellingBytes)
    .map((f) => f.transferSize / Math.max(1e-3, (f.responseEnd - f.responseStart) / 1000));
  return (connection().downlink ?? 0) * bytesPerMegabit || Math.max(0, ...rates);
}
/** Bytes of a file as its server says without sending it; 0: unknown. */
export async function bytesAt(url: string): Promise<number> {
  const answer = await fetch(url, { method: 'HEAD' }).catch(() => undefined);
  return answer?.ok ? numberOf(answer.headers.get('content-length'), 0, 0, mostBytes) : 0;
}
