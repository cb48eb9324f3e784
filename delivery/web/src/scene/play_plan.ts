import type { HarmonicTimePlan, HtcStep } from '../decide/harmonic_time';
import type { GroupedList } from '../decide/request_groups';
import { throwIfAborted } from '../format/errors';
import { nowS } from '../http/clock';
import type { Transfers, Wish } from './transfers';

/** Those who hear of the plan's course. */
export interface PlayedPlanHooks {
  /** A decision was taken, or its transfer has ended. */
  decided(step: HtcStep): void;
  lost(wish: Wish, error: unknown): void;
}

/**
 * Plays a plan over the network: fetches the fragments that the plan asks for, and reports to the plan which have come. Ends when every
 * fragment has come or was given up; after `mostS` seconds the rest is given up.
 */
export async function playPlan(
  plan: HarmonicTimePlan,
  { groups }: GroupedList,
  transfers: Transfers,
  signal: AbortSignal,
  mostS: number,
  hooks: PlayedPlanHooks,
): Promise<void> {
  const startS = nowS();
  const underWay = new Map<number, { step: HtcStep; left: number }>(); // by offer: fragments of it that have not ended
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
    if (wishes.length > 0) void transfers.fetch(wishes, { gapBytes: 0, mostBytes: Infinity, signal: abort.signal }, (wish) => ended(wish, true), lost);
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
