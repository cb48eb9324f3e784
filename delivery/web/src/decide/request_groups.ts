import { hiddenRtts, leastDecisions, leastRequestS } from '../format/shared_numbers';
import type { RequestRecord } from '../http/requests';
import type { FragmentList, ListedFragment } from './fragment_list';
import { clamp, sumOf } from './numbers';
import type { FragmentOffer } from './harmonic_time';

/** Offers of neighbours that are fetched and decided together. */
export interface GroupedList {
  offers: FragmentOffer[];
  /** Fragments by offer; those of an offer are of one plane, in the order of its packs. */
  groups: ListedFragment[][];
}

/** Bytes that one request should bring, so that waiting for answers does not leave the link idle. */
export function groupBytes(bytesS: number, rttS: number, limitS: number): number {
  return Math.min(bytesS * Math.max(leastRequestS, hiddenRtts * rttS), (bytesS * limitS) / leastDecisions);
}

/** Fragments of a list joined to groups of about so many bytes each, when `budget` bytes are spent on all. */
export function groupedList(list: FragmentList, bytesEach: number, budget: number): GroupedList {
  const factor = budget / Math.max(sumOf(list.offers.map((o) => o.plannedBytes)), 1);
  const members: number[][] = []; // offers
  let open = Infinity; // expected bytes of the last group
  list.offers.forEach(({ plannedBytes, bytes }, i) => {
    const expected = Math.min(Math.max(plannedBytes * factor, bytes[0]), bytes[bytes.length - 1]);
    open += expected;
    if (open <= bytesEach && list.fragments[i].plane === list.fragments[i - 1]?.plane)
      return void members.at(-1)!.push(i);
    members.push([i]);
    open = expected;
  });
  const offers = members.map((group): FragmentOffer => {
    const all = group.map((i) => list.offers[i]);
    return {
      ...all[0],
      bytes: all[0].bytes.map((_, r) => sumOf(all.map((o) => o.bytes[r]))),
      loss: all[0].loss.map((_, r) => sumOf(all.map((o) => o.loss[r]))),
      plannedBytes: sumOf(all.map((o) => o.plannedBytes)),
      eta: Math.max(...all.map((o) => o.eta)),
    };
  });
  return { offers, groups: members.map((group) => group.map((i) => list.fragments[i])) };
}

/** Bytes per second while bytes came: of requests so far, without the time before their answers. */
export function throughputOf(requests: readonly RequestRecord[], rttS: number): number {
  const begun = requests.filter((r) => r.received > 0)
    .map((r) => ({ ...r, from: Math.min(r.started + rttS, r.firstByte) }));
  let [seconds, bytes, end] = [0, 0, 0];
  for (const { from, ended, received } of begun.sort((a, b) => a.from - b.from)) {
    seconds += Math.max(0, ended - Math.max(from, end));
    end = Math.max(end, ended);
    bytes += received;
  }
  return clamp(bytes / Math.max(seconds, 1e-3), 100, 1e9);
}
