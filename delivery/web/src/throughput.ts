/**
 * How the throughput of the next transfer is guessed from those that have ended: the last one's; bytes over seconds of
 * the last `samples` (harmonic); an exponentially weighted mean.
 */
export type Estimator = 'last' | 'harmonic' | 'ewma';

/** Of a Throughput. */
export interface ThroughputOptions {
  estimator: Estimator;
  /** 1 .. 64 */
  samples: number;
  /** 0 .. 1 */
  ewma: number;
  /** Transfers below weigh less in the mean, > 0. */
  smallBytes: number;
  /** beta_0, until there is a sample; > 0. */
  initialBytesS: number;
}
/** Those of delivery/cpp. */
export const defaultThroughput: ThroughputOptions = {
  estimator: 'harmonic',
  samples: 10,
  ewma: 0.2,
  smallBytes: 4000,
  initialBytesS: 1e5,
};

const ringSize = 64;
const leastSeconds = 1e-9;
const none = { bytes: 0, seconds: 0 };

/** Throughput of a connection or a group of them: delivery/cpp/throughput.h. */
export class Throughput {
  private readonly ring_: { bytes: number; seconds: number }[] = [];
  private readonly sums_: { bytes: number; seconds: number }[] = []; // of all samples up to each
  private count_ = 0;
  private mean_: number;

  constructor(private readonly options_: ThroughputOptions = defaultThroughput) {
    this.mean_ = options_.initialBytesS;
  }

  /** `seconds`: since the end of the transfer before, latency taken off; less than 1 ns counts as 1 ns. */
  add(bytes: number, seconds: number): void {
    const sample = { bytes, seconds: Math.max(seconds, leastSeconds) };
    this.ring_[this.count_++ % ringSize] = sample;
    const before = this.sums_[this.sums_.length - 1] ?? none;
    this.sums_.push({ bytes: before.bytes + sample.bytes, seconds: before.seconds + sample.seconds });
    const weight = this.options_.ewma * Math.min(1, bytes / this.options_.smallBytes);
    this.mean_ += weight * (sample.bytes / sample.seconds - this.mean_);
  }

  /** Bytes per second by the estimator chosen. */
  bytesS(): number {
    if (this.count_ === 0) return this.options_.initialBytesS;
    if (this.options_.estimator === 'last') return this.recentBytesS(1);
    if (this.options_.estimator === 'harmonic') return this.recentBytesS(Math.max(this.options_.samples, 1));
    return this.mean_;
  }

  /** Bytes over seconds of at most so many samples. */
  recentBytesS(samples: number): number {
    const n = Math.min(samples, this.count_, ringSize);
    if (n === 0) return this.options_.initialBytesS;
    let bytes = 0;
    let seconds = 0;
    for (let i = 1; i <= n; ++i) {
      const s = this.ring_[(this.count_ - i) % ringSize];
      bytes += s.bytes;
      seconds += s.seconds;
    }
    return bytes / seconds;
  }

  /** The mean of the last `seconds` > 0 of transfers; what lies before the first counts as beta_0. */
  meanBytesS(seconds: number): number {
    const last = this.sums_.length - 1;
    const all = this.sums_[last] ?? none;
    const from = all.seconds - seconds;
    if (from <= 0) return (all.bytes - from * this.options_.initialBytesS) / seconds;
    let low = 0; // the first sum that ends after `from`, or the last
    let high = last;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.sums_[middle].seconds > from) high = middle;
      else low = middle + 1;
    }
    const cut = this.sums_[low];
    const before = this.sums_[low - 1] ?? none;
    const part = (cut.seconds - from) / (cut.seconds - before.seconds);
    return (all.bytes - cut.bytes + part * (cut.bytes - before.bytes)) / seconds;
  }
}
