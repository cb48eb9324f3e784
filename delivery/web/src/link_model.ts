// delivery/cpp/network_model and simulation for one server on a link of constant rate: the same arithmetic, the same bits.

import { FragmentOffer, HarmonicTimePlan, HtcOptions } from './harmonic_time';

/** A link as a plan supposes it. */
export interface LinkOptions {
  /** Shared evenly by all that is in flight. */
  bytesS: number;
  rttS: number;
  /** Requests answered at once; one beyond them waits. */
  connections: number;
}

interface Flow {
  number: number;
  bytesLeft: number;
  /** When its first byte may come; infinite while it waits for a connection. */
  startsS: number;
  rate: number;
}

const serverBytesS = 1e12;
const noCap = 1e300;
/** What rounding may leave of a transfer. */
const doneBytes = 1e-6;
const never = 1e9;

/** An even share of `capacity` for each, what a capped one leaves going to the others. */
function shareEvenly(capacity: number, caps: readonly number[]): number[] {
  const order = caps.map((_, i) => i).sort((a, b) => caps[a] - caps[b]);
  const rates: number[] = [];
  order.forEach((i, k) => {
    rates[i] = Math.min(caps[i], capacity / (order.length - k));
    capacity -= rates[i];
  });
  return rates;
}

/** Requests over a link, from the first to the last moment at which something changes. */
export class LinkModel {
  nowS = 0;
  private busy_ = 0;
  private readonly flows_: Flow[] = []; // by order of request

  constructor(private readonly options_: LinkOptions) {}

  /** Asks for bytes now; the number is the caller's own. */
  request(number: number, bytes: number): void {
    this.flows_.push({ number, bytesLeft: Math.max(bytes, doneBytes), startsS: Infinity, rate: 0 });
    this.startWaiting_();
  }
  private startWaiting_(): void {
    for (const f of this.flows_)
      if (f.startsS === Infinity && this.busy_ < this.options_.connections) {
        f.startsS = this.nowS + this.options_.rttS;
        ++this.busy_;
      }
  }
  private shareRates_(): void {
    const active = this.flows_.filter((f) => ((f.rate = 0), f.startsS <= this.nowS));
    const caps = shareEvenly(serverBytesS, active.map(() => noCap));
    shareEvenly(this.options_.bytesS, caps).forEach((rate, i) => (active[i].rate = rate));
  }
  /** Runs until a request is complete and gives its number, or until `untilS`. */
  advance(untilS = never): number | undefined {
    for (;;) {
      const i = this.flows_.findIndex((f) => f.bytesLeft <= doneBytes);
      if (i >= 0) {
        const [ended] = this.flows_.splice(i, 1);
        --this.busy_;
        this.startWaiting_();
        return ended.number;
      }
      if (this.nowS >= untilS) return undefined;
      this.shareRates_();
      let next = untilS;
      for (const f of this.flows_) {
        if (f.startsS > this.nowS) next = Math.min(next, f.startsS);
        if (f.rate > 0) next = Math.min(next, this.nowS + f.bytesLeft / f.rate);
      }
      const seconds = next - this.nowS;
      this.nowS = next;
      for (const f of this.flows_) {
        f.bytesLeft -= f.rate * seconds;
        // Rounding may leave a sliver that no step of time can move.
        if (f.rate > 0 && f.bytesLeft > 0 && next + f.bytesLeft / f.rate <= next) f.bytesLeft = 0;
      }
    }
  }
}

/** When so many bytes asked for at `fromS` are complete on an otherwise idle link. */
export function fetchedS(link: LinkOptions, fromS: number, bytes: number): number {
  const model = new LinkModel(link);
  while (model.nowS < fromS) model.advance(fromS);
  model.request(0, bytes);
  model.advance();
  return model.nowS;
}

/** What a plan would do over a link. */
export interface Simulated {
  /** By offer; -1 = skipped. */
  rungs: number[];
  bytes: number;
  /** Sum of the offers' losses as shown. */
  loss: number;
  /** After the first request. */
  endS: number;
}
/** Plays a plan over a link. */
export function simulate(offers: readonly FragmentOffer[], options: HtcOptions, link: LinkOptions): Simulated {
  const plan = new HarmonicTimePlan(offers, options);
  const model = new LinkModel(link);
  let endS = 0;
  while (!plan.finished) {
    for (let s = plan.next(model.nowS); s; s = plan.next(model.nowS)) model.request(s.offer, s.bytes);
    if (plan.finished) break;
    const ended = model.advance();
    if (ended === undefined) break;
    endS = model.nowS;
    plan.completed(ended, endS);
  }
  const rungs = plan.rungs();
  let [loss, bytes] = [0, 0];
  for (const s of plan.steps) bytes += s.rung < 0 ? 0 : s.bytes;
  rungs.forEach((rung, i) => (loss += offers[i].loss[rung + 1]));
  return { rungs, bytes, loss, endS };
}
