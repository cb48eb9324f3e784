import type { GroupedList } from './groups';
import { nowS, throwIfAborted } from './http';
import type { HtcStep, TimePlan } from './time_plan';
import type { Transfers, Wish } from './transfers';

/** Who hears of it. */
export interface TimedFetchHooks {
  /** A decision was taken, or its transfer has ended. */
  decided(step: HtcStep): void;
  lost(wish: Wish, error: unknown): void;
}

/** Plays a plan over the network: asks for what it says, tells it what has come. */
export class TimedFetch {
  private readonly startS_ = nowS();
  private readonly waiting_ = new Map<number, number>(); // by offer: fragments of it that have not ended
  private readonly steps_ = new Map<number, HtcStep>(); // by offer
  private readonly stop_ = new AbortController();
  private told_ = 0;
  private end_: () => void = () => undefined;

  constructor(
    private readonly plan_: TimePlan,
    private readonly list_: GroupedList,
    private readonly transfers_: Transfers,
    private readonly signal_: AbortSignal,
    private readonly hooks_: TimedFetchHooks,
  ) {}

  /** Until everything has come or was given up; what has not come after `mostS` seconds is. */
  async run(mostS: number): Promise<void> {
    const stop = (): void => this.stop_.abort();
    this.signal_.addEventListener('abort', stop);
    const timer = setTimeout(stop, mostS * 1000);
    try {
      await new Promise<void>((ended) => {
        this.end_ = ended;
        this.pump_();
      });
      throwIfAborted(this.signal_);
    } finally {
      clearTimeout(timer);
      this.signal_.removeEventListener('abort', stop);
    }
  }

  private pump_(): void {
    const wishes: Wish[] = [];
    const next = (): HtcStep | undefined => (this.signal_.aborted ? undefined : this.plan_.next(nowS() - this.startS_));
    for (let step = next(); step; step = next()) {
      const { offer, rung } = step;
      this.steps_.set(offer, step);
      this.waiting_.set(offer, this.list_.groups[offer].length);
      for (const f of this.list_.groups[offer]) wishes.push({ ...f, rung, offer });
    }
    while (this.told_ < this.plan_.steps.length) this.hooks_.decided(this.plan_.steps[this.told_++]);
    if (wishes.length > 0)
      void this.transfers_.fetch(
        wishes,
        { gapBytes: 0, mostBytes: Infinity, signal: this.stop_.signal },
        (wish) => this.ended_(wish, true),
        (wish, error) => {
          this.hooks_.lost(wish, error);
          this.ended_(wish, false);
        },
      );
    if (this.plan_.finished() || (this.signal_.aborted && this.waiting_.size === 0)) this.end_();
  }

  private ended_(wish: Wish, well: boolean): void {
    const left = this.waiting_.get(wish.offer)! - 1;
    this.waiting_.set(wish.offer, left);
    if (left > 0) return;
    this.waiting_.delete(wish.offer);
    const step = this.steps_.get(wish.offer)!;
    this.plan_.ended(step, nowS() - this.startS_, well);
    this.hooks_.decided(step);
    queueMicrotask(() => this.pump_());
  }
}
