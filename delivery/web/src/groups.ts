import type { FragmentList, ListedFragment } from './fragment_list';
import type { FragmentOffer } from './time_plan';
import type { RequestRecord } from './http';

/** Offers of neighbours that are fetched and decided together. */
export interface GroupedList {
  offers: FragmentOffer[];
  /** By offer; all of one plane, in the order of its packs. */
  groups: ListedFragment[][];
}

/** A request is worth at least these seconds of the link. */
const leastRequestS = 0.006;
/** Round trips that six connections at once hide. */
const hiddenRtts = 0.6;
/** Decisions that a time limit should have, so that the last ones can make good what the first took. */
const leastDecisions = 48;

/** Bytes that one request should bring, so that waiting for answers does not leave the link idle. */
export function groupBytes(bytesS: number, rttS: number, limitS: number): number {
  return Math.min(bytesS * Math.max(leastRequestS, hiddenRtts * rttS), (bytesS * limitS) / leastDecisions);
}

/** Fragments of a list joined to groups of about so many bytes each, when `budget` bytes are spent on all. */
export function groupedList(list: FragmentList, bytesEach: number, budget: number): GroupedList {
  const grouped: GroupedList = { offers: [], groups: [] };
  const planned = list.offers.reduce((sum, o) => sum + o.plannedBytes, 0);
  const factor = budget / Math.max(planned, 1);
  let open = 0; // expected bytes of the last group
  list.offers.forEach((o, i) => {
    const fragment = list.fragments[i];
    const expected = Math.min(Math.max(o.plannedBytes * factor, o.bytes[0]), o.bytes[o.bytes.length - 1]);
    const last = grouped.offers.length - 1;
    if (last < 0 || grouped.groups[last][0].plane !== fragment.plane || open + expected > bytesEach) {
      grouped.offers.push({ ...o, bytes: [...o.bytes], loss: [...o.loss] });
      grouped.groups.push([fragment]);
      open = expected;
      return;
    }
    const g = grouped.offers[last];
    o.bytes.forEach((b, r) => (g.bytes[r] += b));
    o.loss.forEach((l, r) => (g.loss[r] += l));
    g.plannedBytes += o.plannedBytes;
    g.eta = Math.max(g.eta, o.eta);
    grouped.groups[last].push(fragment);
    open += expected;
  });
  return grouped;
}

/** Bytes per second while bytes were coming: of requests so far, without the time that their answers took to begin. */
export function throughputOf(requests: readonly RequestRecord[], rttS: number): number {
  const spans = requests
    .filter((r) => r.received > 0)
    .map((r) => ({ from: Math.min(r.started + rttS, r.firstByte), to: r.ended, bytes: r.received }))
    .sort((a, b) => a.from - b.from);
  let [seconds, bytes, end] = [0, 0, 0];
  for (const s of spans) {
    seconds += Math.max(0, s.to - Math.max(s.from, end));
    end = Math.max(end, s.to);
    bytes += s.bytes;
  }
  return Math.min(Math.max(bytes / Math.max(seconds, 1e-3), 100), 1e9);
}
