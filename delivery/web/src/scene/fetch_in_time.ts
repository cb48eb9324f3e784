import type { FragmentList } from '../decide/fragment_list';
import { HarmonicTimePlan, type HtcStep, type TimePlanOptions } from '../decide/harmonic_time';
import { type GroupedList, groupBytes, groupedList } from '../decide/request_groups';
import type * as Printed from '../decide/thesis_list';
import { throwIfAborted } from '../format/errors';
import { nowS } from '../http/requests';
import { type FragmentFetch, upgradeWishes } from './fragment_fetch';
import { type LoadContext, mostLate } from './load_context';
import type { Transfers, Wish } from './transfers';

/** Those who hear of the plan's course. */
export interface PlayedPlanHooks {
  /** A decision was taken, or its transfer has ended. */
  decided(step: HtcStep): void;
  lost(wish: Wish, error: unknown): void;
}

/**
 * Plays a plan over the network: fetches the fragments that the plan asks for, and reports to the plan which
 * have come. Ends when every fragment has come or was given up; after `mostS` seconds the rest is given up.
 */
export async function playPlan(plan: HarmonicTimePlan, { groups }: GroupedList, transfers: Transfers,
    signal: AbortSignal, mostS: number, hooks: PlayedPlanHooks): Promise<void> {
  const startS = nowS();
  // by offer: fragments of it that have not ended
  const underWay = new Map<number, { step: HtcStep; left: number }>();
  const abort = new AbortController();
  const stop = (): void => abort.abort();
  signal.addEventListener('abort', stop);
  const timer = setTimeout(stop, mostS * 1000);
  let reported = 0;
  const askForMore = (end: () => void): void => {
    const wishes: Wish[] = [];
    for (let step; !signal.aborted && (step = plan.next(nowS() - startS)); ) {
      const { offer, rung } = step;
      underWay.set(offer, { step, left: groups[offer].length });
      for (const f of groups[offer]) wishes.push({ ...f, rung, offer });
    }
    while (reported < plan.steps.length) hooks.decided(plan.steps[reported++]);
    const ended = ({ offer }: Wish, well: boolean): void => {
      const group = underWay.get(offer)!;
      if (--group.left > 0) return;
      underWay.delete(offer);
      plan.ended(group.step, nowS() - startS, well);
      hooks.decided(group.step);
      queueMicrotask(() => askForMore(end));
    };
    const lost = (wish: Wish, error: unknown): void => {
      hooks.lost(wish, error);
      ended(wish, false);
    };
    if (wishes.length > 0) void transfers.fetch(wishes,
      { gapBytes: 0, mostBytes: Infinity, signal: abort.signal }, (wish) => ended(wish, true), lost);
    if (plan.finished() || (signal.aborted && underWay.size === 0)) end();
  };
  try {
    await new Promise<void>(askForMore);
    throwIfAborted(signal);
  } finally {
    clearTimeout(timer);
    signal.removeEventListener('abort', stop);
  }
}

/** Decoding and uploading after the last byte: 4 ms, or 11 without a GPU, were measured. */
export const composeS = 0.015;
/** A rest of less than this share of the limit, a round trip taken off, is not worth another request. */
const leastRest = 0.004;
/** Share of the bytes promised by the throughput that a request may count on. */
const certain = 0.85;

/** A busy page hears late, and asks late: it asks for at most so many seconds more of the link at once. */
const mostBusyS = 0.25;

/** Fetches fragments by Harmonic Time Compensation, in groups. The last one comes at the limit. */
export class FetchInTime {
  private plan_?: HarmonicTimePlan;

  /** Policy thesis. */
  printed?: typeof Printed;

  constructor(
    private readonly load_: LoadContext,
    private readonly fetching_: FragmentFetch,
  ) {}

  /** The plan's estimate now. */
  throughputBytesS(): number | undefined {
    return this.plan_?.throughputBytesS();
  }
  /** A plan has run, and fragments may be asked for one by one: no whole rungs, no printed policy. */
  get hasPlan(): boolean {
    return !!this.plan_ && !this.printed && !this.fetching_.wholeRungs();
  }
  leftS(): number {
    return this.load_.limitS - this.load_.elapsedS();
  }

  /** Options of the plan for fragments in so many seconds. */
  planOptions(timeLimitS: number): TimePlanOptions {
    const { reader: { client: { latencyS: rttS } }, beta0 } = this.load_;
    const options = { timeLimitS, rttS, initialBytesS: Math.max(1, beta0) };
    return this.printed?.printedPlan(options) ?? { policy: 'guard', order: 'finest', ...options };
  }

  async run(fragments: FragmentList, timeLimitS: number): Promise<void> {
    const { load_: load, fetching_: fetching } = this;
    const whole = fetching.wholeRungs();
    const bytesEach = whole ? Infinity
      : this.printed ? 0 : groupBytes(load.beta0, load.reader.client.latencyS, timeLimitS);
    const list = groupedList(fragments, bytesEach, load.beta0 * timeLimitS);
    const plan = (this.plan_ = new HarmonicTimePlan(list.offers,
      { ...this.planOptions(timeLimitS), tripS: () => this.tripS_() }));
    const hooks = {
      decided: (step: HtcStep): void => this.decided_(step, list),
      lost: (wish: Wish, error: unknown): void => fetching.lost(wish, error),
    };
    await playPlan(plan, list, fetching.transfers, load.signal, timeLimitS + mostLate * load.limitS, hooks);
    await this.spendRest(fragments);
  }
  /** From a request to its answer, as the page has noticed lately. */
  private tripS_(): number {
    const { rttS, latencyS } = this.load_.reader.client;
    return Math.min(latencyS, rttS + mostBusyS);
  }
  private decided_(s: HtcStep, { groups, offers }: GroupedList): void {
    const group = groups[s.offer];
    if (s.doneS < 0) for (const f of group) this.fetching_.fates.asked(f, s.rung);
    this.load_.emit('decision', {
      position: s.position,
      ...group[0],
      fragments: group.map((f) => f.fragment),
      eta: offers[s.offer].eta,
      rung: s.rung,
      bytes: s.bytes,
      plannedSeconds: s.thetaS,
      ...(s.doneS >= 0 && s.rung >= 0 && { actualSeconds: s.spacingS, done: s.doneS }),
      creditSeconds: s.creditS,
      bytesPerSecond: s.throughputBytesS,
      issued: s.issuedS,
      skipped: s.rung < 0,
    });
  }
  /** Upgrades take the rest of the time, in ever smaller requests: rungs do not fit a plan to the byte. */
  async spendRest(list: FragmentList): Promise<void> {
    const { plan_: plan, load_: load } = this;
    const { limitS, reader: { client } } = load;
    if (!plan || !this.hasPlan) return;
    for (;;) {
      const restS = this.leftS() - composeS;
      const afterS = restS - client.rttS; // nothing else is on its way
      if (afterS < leastRest * limitS) return;
      // More requests at once would wait for connections.
      const most = 2 * client.options.connections;
      const wishes = upgradeWishes(list, certain * plan.throughputBytesS() * afterS, this.fetching_).slice(0,
        most);
      if (wishes.length === 0) return;
      if ((await load.untilLimit((signal) => this.fetching_.fetch(wishes, signal))) === 0) return;
    }
  }
}
