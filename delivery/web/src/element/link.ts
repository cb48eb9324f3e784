import { numberOf } from './wording';

// What an element knows of the way to its server before anything is asked for.

interface Connection {
  saveData?: boolean;
  /** Mbit/s */
  downlink?: number;
}
const connection = (): Connection => (globalThis.navigator as { connection?: Connection } | undefined)?.connection ?? {};
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
  const rates = files.filter((f) => f.transferSize > tellingBytes).map((f) => f.transferSize / Math.max(1e-3, (f.responseEnd - f.responseStart) / 1000));
  return (connection().downlink ?? 0) * bytesPerMegabit || Math.max(0, ...rates);
}
/** Bytes of a file as its server says without sending it; 0: unknown. */
export async function bytesAt(url: string): Promise<number> {
  const answer = await fetch(url, { method: 'HEAD' }).catch(() => undefined);
  return answer?.ok ? numberOf(answer.headers.get('content-length'), 0, 0, mostBytes) : 0;
}
