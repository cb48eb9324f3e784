import { describe, expect, it } from 'vitest';
import { groupedList } from '../../src/decide/request_groups';
import { HarmonicTimePlan, type HtcStep } from '../../src/reader';
import { playPlan } from '../../src/scene/fetch_in_time';
import { bytesAskedTwice, Fault } from '../support/fake_server';
import { defaultTimePlan, setUp, url } from '../support/transferring';

describe('a timed fetch', () => {
  const options = { ...defaultTimePlan, timeLimitS: 2, rttS: 0.002 };
  async function fetchInTime(fault: Fault | undefined, mostS: number, signal = new AbortController().signal) {
    const s = await setUp(fault);
    const list = groupedList(s.list, 2000, 60000);
    const plan = new HarmonicTimePlan(list.offers, options);
    const ended: HtcStep[] = [];
    const decided = (step: HtcStep): void => void (step.doneS >= 0 && ended.push(step));
    const run = playPlan(plan, list, s.transfers, signal, mostS, { decided, lost: () => undefined });
    return { ...s, list, plan, ended, run };
  }
  it('ends when every offer was decided and has come', async () => {
    const t = await fetchInTime(undefined, 10);
    await t.run;
    await t.settled();
    expect(t.plan.finished()).toBe(true);
    const wanted = t.plan.steps.flatMap((s) => (s.rung < 0 ? [] : t.list.groups[s.offer]));
    expect(t.decoded.length).toBe(wanted.length);
    expect(bytesAskedTwice(t.server.log, url)).toBe(0);
    expect(new Set(t.ended.map((step) => step.offer)).size).toBe(t.list.offers.length);
  });
  it('has as much under way as comes while the page is busy', async () => {
    const { list } = await setUp(undefined);
    const { offers } = groupedList(list, 2000, 60000);
    const underWay = (tripS: number): number => {
      const plan = new HarmonicTimePlan(offers, { ...options, tripS: () => tripS });
      let n = 0;
      while (plan.next(0)) ++n;
      return n;
    };
    expect(underWay(0.2)).toBeGreaterThan(underWay(0.002) + 2);
  });
  it('gives up what does not come', async () => {
    const t = await fetchInTime(({ range }) => range !== undefined && range[0] > 100000 && 'stall', 0.3);
    const begin = performance.now();
    await t.run;
    expect(performance.now() - begin).toBeLessThan(3000);
    expect(t.plan.finished()).toBe(true);
    expect(t.plan.steps.map((s) => s.rung)).toContain(-1);
  });
  it('can be cancelled', async () => {
    const abort = new AbortController();
    const t = await fetchInTime(() => false, 10, abort.signal);
    abort.abort();
    await expect(t.run).rejects.toThrow('cancelled');
  });
});
