import type { RequestRecord } from '../http/requests';

// What a page decides about its models: who is next, how long, and what the link carries. No canvas is here.

/** How a model lies on the page. */
export interface PagePlace {
  /** Some of it is on the screen. */
  visible: boolean;
  /** The user points at it, or has it in focus. */
  regarded: boolean;
  /** Its picture, device px squared. */
  areaPx: number;
  /** From the middle of the screen, CSS px. */
  distancePx: number;
}

/** Order of interest: what is regarded, what is seen, larger pictures, what is nearer to the middle. */
export function byInterest(a: PagePlace, b: PagePlace): number {
  return Number(b.regarded) - Number(a.regarded) || Number(b.visible) - Number(a.visible) ||
    b.areaPx - a.areaPx || a.distancePx - b.distancePx;
}

/** A model's share, by area, of what all of `areas` have a part in; equal parts where none has an area. */
export function shareOf(area: number, areas: readonly number[]): number {
  const sum = areas.reduce((all, a) => all + a, 0);
  return sum > 0 ? area / sum : 1 / Math.max(1, areas.length);
}

/** A turn is no shorter than this, seconds. */
const leastTurnS = 0.1;
/** Requests of a turn that wait for one another, at least. */
const roundTrips = 2;
/** The least seconds of a turn that fetches so many bytes in any case; `bytesS` 0: nobody knows the link. */
export function leastS(bytes: number, bytesS: number, latencyS: number): number {
  return bytes > 0 ? Math.max(leastTurnS, roundTrips * latencyS + (bytesS > 0 ? bytes / bytesS : 0))
    : leastTurnS;
}
/** Seconds of a turn, at least `leastS`, out of `leftS` for all that wait; 0: there are not so many. */
export function turnS(leftS: number, area: number, areas: readonly number[], leastS: number): number {
  if (leftS === Infinity) return Infinity;
  return leftS < leastS ? 0 : Math.max(leastS, leftS * shareOf(area, areas));
}

/** Earlier transfers say nothing of the link now, seconds. */
const recentS = 10;
/** Bytes per second while bytes came, over the last seconds before `nowS`; 0: nothing is known. */
export function linkBytesS(records: readonly RequestRecord[], nowS: number): number {
  const came = records.filter((r) => r.received > 0 && r.firstByte >= 0 && r.ended > nowS - recentS)
    .sort((a, b) => a.firstByte - b.firstByte);
  let [bytes, seconds, until] = [0, 0, -Infinity];
  for (const { firstByte, ended, received } of came) {
    bytes += received;
    seconds += Math.max(0, ended - Math.max(firstByte, until));
    until = Math.max(until, ended);
  }
  return seconds > 0 ? bytes / seconds : 0;
}

const mega = 1e6;
/** GPU memory that a page takes by default, bytes: by the device's memory, else by screen and touch. */
export function defaultMemoryBytes({ deviceMemoryGb, screenPx, touch }: { deviceMemoryGb?: number;
    screenPx: number; touch: boolean }): number {
  if (deviceMemoryGb !== undefined && deviceMemoryGb > 0)
    return Math.min(64 * mega * 2 ** Math.floor(Math.log2(Math.max(deviceMemoryGb, 0.5))), 512 * mega);
  return (touch || screenPx < 1e6 ? 128 : 256) * mega;
}
