import { leastSeconds, windowSamples } from '../format/shared_numbers';

/** Throughput of connections from transfers that have ended: delivery/cpp/decide/harmonic_time.h. */
export interface TransferRate {
  /**
   * `seconds`: since the end of the transfer before, latency taken off; less than 1 ns counts as 1 ns.
   * `others`: how many transfers are still under way, and their bytes. Until more transfers have ended than
   * are under way, beta_0 is the estimate, as far as beta_0 lies between what the link has given with nothing
   * of the others and with all of the others.
   */
  add(bytes: number, seconds: number, others?: number, othersBytes?: number): void;
  /** Bytes over seconds of at most so many samples (default windowSamples). */
  recentBytesS(samples?: number): number;
  /** The mean of the last `seconds` > 0 of transfers; time before the first transfer counts with beta_0. */
  meanBytesS(seconds: number): number;
}

const none = { allBytes: 0, allSeconds: 0 };

/** `initialBytesS` is beta_0, until there is a sample; > 0. */
export function transferRate(initialBytesS: number): TransferRate {
  // all: up to each
  const ended: { bytes: number; seconds: number; allBytes: number; allSeconds: number }[] = [];
  let starting = true;
  let startBytesS = initialBytesS;
  return {
    add(bytes, duration, others = 0, othersBytes = 0) {
      const seconds = Math.max(duration, leastSeconds);
      const { allBytes, allSeconds } = ended.at(-1) ?? none;
      const all = { bytes, seconds, allBytes: allBytes + bytes, allSeconds: allSeconds + seconds };
      ended.push(all);
      starting &&= ended.length <= others;
      startBytesS = Math.min(Math.max(initialBytesS, all.allBytes / all.allSeconds),
        (all.allBytes + othersBytes) / all.allSeconds);
    },
    recentBytesS(samples = windowSamples) {
      if (starting) return startBytesS;
      let [bytes, seconds] = [0, 0];
      for (const sample of ended.slice(-samples).reverse()) {
        bytes += sample.bytes;
        seconds += sample.seconds;
      }
      return bytes / seconds;
    },
    meanBytesS(seconds) {
      const { allBytes, allSeconds } = ended.at(-1) ?? none;
      const from = allSeconds - seconds;
      if (from <= 0) return (allBytes - from * initialBytesS) / seconds;
      const at = ended.findIndex((sample) => sample.allSeconds > from); // -1: the last, by rounding
      const cut = ended.at(at)!;
      const before = ended[at - 1] ?? none;
      const part = (cut.allSeconds - from) / (cut.allSeconds - before.allSeconds);
      return (allBytes - cut.allBytes + part * (cut.allBytes - before.allBytes)) / seconds;
    },
  };
}
