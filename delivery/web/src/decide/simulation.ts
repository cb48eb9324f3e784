import { doneBytes, forEver } from '../format/shared_numbers';
import { FragmentOffer, HarmonicTimePlan, HtcStep, TimePlanOptions, bytesAtRung } from './harmonic_time';
import { sumOf } from './numbers';

// delivery/cpp/simulate/simulation.h for one server on a link of constant rate, to the same bits.

/** A link as a plan supposes it. */
export interface LinkOptions {
  /** Throughput, shared evenly by all transfers in flight. */
  bytesS: number;
  rttS: number;
  /** Requests answered at once; one beyond them waits. */
  connections: number;
}

/** Requests over a link, from the first to the last moment at which something changes. */
export interface LinkModel<T> {
  readonly nowS: number;
  /** Asks for bytes now. */
  request(what: T, bytes: number): void;
  /** Runs until a request is complete, and gives that request; undefined: none ever will be. */
  advance(): T | undefined;
}

const serverBytesS = 1e12;
const noCap = 1e300;

/** An even share of `capacity` for each; the rest of a capped one goes to the others. */
function shareEvenly(capacity: number, caps: readonly number[]): number[] {
  const order = [...caps.keys()].sort((a, b) => caps[a] - caps[b]);
  const rates: number[] = [];
  order.forEach((i, k) => {
    rates[i] = Math.min(caps[i], capacity / (order.length - k));
    capacity -= rates[i];
  });
  return rates;
}

/** A link from `nowS` on. */
export function linkModel<T>({ bytesS, rttS, connections }: LinkOptions, nowS = 0): LinkModel<T> {
  const flows: { what: T; bytesLeft: number; startsS?: number }[] = []; // by order of request
  return {
    get nowS() {
      return nowS;
    },
    request(what, bytes) {
      flows.push({ what, bytesLeft: Math.max(bytes, doneBytes) });
    },
    advance() {
      for (;;) {
        const ended = flows.findIndex((f) => f.bytesLeft <= doneBytes);
        if (ended >= 0) return flows.splice(ended, 1)[0].what;
        if (nowS >= forEver) return undefined;
        let next = forEver;
        const active = flows.slice(0, connections).filter((f) => {
          f.startsS ??= nowS + rttS; // when its first byte may come
          if (f.startsS > nowS) next = Math.min(next, f.startsS);
          return f.startsS <= nowS;
        });
        const rates = shareEvenly(bytesS, shareEvenly(serverBytesS, active.map(() => noCap)));
        active.forEach((f, i) => (next = Math.min(next, nowS + f.bytesLeft / rates[i])));
        active.forEach((f, i) => {
          f.bytesLeft -= rates[i] * (next - nowS);
          // Rounding may leave a sliver that no step of time can move.
          if (next + f.bytesLeft / rates[i] <= next) f.bytesLeft = 0;
        });
        nowS = next;
      }
    },
  };
}

/** When so many bytes asked for at `fromS` are complete on an otherwise idle link. */
export function fetchedS(link: LinkOptions, fromS: number, bytes: number): number {
  const model = linkModel(link, fromS);
  model.request(0, bytes);
  model.advance();
  return model.nowS;
}

// delivery/cpp/simulate/simulation.h for one server on a link of constant rate, to the same bits.

/** The course of a plan over a link. */
export interface Simulated {
  /** Rungs by offer; -1 = skipped. */
  rungs: number[];
  bytes: number;
  /** End, seconds after the first request. */
  endS: number;
}
/** Plays a plan over a link. A limit <= 0 leaves no time: nothing is transferred. */
export function simulate(offers: readonly FragmentOffer[], options: TimePlanOptions,
    link: LinkOptions): Simulated {
  const rungs = offers.map(() => -1);
  let endS = 0;
  if (options.timeLimitS > 0) {
    const plan = new HarmonicTimePlan(offers, options);
    const model = linkModel<HtcStep>(link);
    for (;;) {
      for (let s = plan.next(model.nowS); s; s = plan.next(model.nowS)) model.request(s, s.bytes);
      const step = model.advance();
      if (!step) break;
      endS = model.nowS;
      plan.ended(step, endS, true);
    }
    for (const s of plan.steps) rungs[s.offer] = s.rung;
  }
  const bytes = sumOf(offers.map((f, i) => bytesAtRung(f, rungs[i])));
  return { rungs, bytes, endS };
}
