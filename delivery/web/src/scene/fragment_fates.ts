import { isForGood } from '../http/requests';

/** A fragment at a rung is on its way, cannot be had for now, or cannot be had ever. */
type Fate = 'comes' | 'lost' | 'gone';
/** A fragment of a plane. */
export interface FragmentPlace {
  plane: number;
  fragment: number;
}
const keyOf = (f: FragmentPlace, rung: number): string => `${f.plane}/${f.fragment}/${rung}`;

/** What becomes of fragments that were asked for, by fragment and rung. */
export class FragmentFates {
  /** Number of fragments that could not be had so far. */
  losses = 0;
  private readonly fates_ = new Map<string, Fate>();

  asked(f: FragmentPlace, rung: number): void {
    this.fates_.set(keyOf(f, rung), 'comes');
  }
  /** The fragment has come, or nobody waits for the fragment any more. */
  ended(f: FragmentPlace, rung: number): void {
    this.fates_.delete(keyOf(f, rung));
  }
  failed(f: FragmentPlace, rung: number, error: unknown): void {
    ++this.losses;
    this.fates_.set(keyOf(f, rung), isForGood(error) ? 'gone' : 'lost');
  }
  isComing(f: FragmentPlace, rung: number): boolean {
    return this.fates_.get(keyOf(f, rung)) === 'comes';
  }
  /** Whether the fragment must not be asked for. */
  isRefused(f: FragmentPlace, rung: number): boolean {
    return (this.fates_.get(keyOf(f, rung)) ?? 'comes') !== 'comes';
  }
  /** Fragments that could not be had for a while may be asked for again. */
  allowLostAgain(): void {
    this.fates_.forEach((fate, key) => fate === 'lost' && this.fates_.delete(key));
  }
}
