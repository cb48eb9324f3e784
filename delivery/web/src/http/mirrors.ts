import { FormatError, TexmeshError, throwIfAborted } from '../format/errors';
import { HttpClient } from './client';
import { type Answer, nowS, sleepS } from './requests';
import { TransferRate, transferRate } from './throughput';

/** Whether asking again may give a better answer. */
function mayRetry({ status, complete, tooLong }: Answer): boolean {
  if (status === 200 || status === 206) return !complete && !tooLong;
  return status === 0 || status === 408 || status === 429 || status >= 500;
}

/** After so many failures in a row nothing is asked for twice: the server is overloaded, or gone. */
const mostInRow = 12;
/** No server is waited for longer, seconds. */
const longestDelayS = 10;

/** A function that waits before the next try, ever longer; false: no further try helps. */
export function retriesOf(client: HttpClient, signal?: AbortSignal): (a: Answer) => Promise<boolean> {
  let { retries: left, retryDelayS: delayS } = client.options;
  return async (a) => {
    if (!mayRetry(a) || left-- <= 0 || client.failedInRow > mostInRow) return false;
    await sleepS(Math.max(delayS, Math.min(a.retryAfterS || 0, longestDelayS)), signal);
    throwIfAborted(signal);
    delayS *= 2;
    return true;
  };
}

const silenceFactor = 4;
const leastPatienceRtts = 8;
const leastPatienceS = 0.5;

/** A URL that a package can be had from, and its transfers so far. */
export interface Mirror {
  url: string;
  alive: boolean;
  /** URL that answers come from, behind redirections. */
  at: string;
  etag: string;
  /** Asked for once an answer has another ETag: the package begins as it did, so ETags say nothing here. */
  sameStart?: Promise<void>;
  /** Bytes of the container; -1 = not known. */
  total: number;
  throughput: TransferRate;
  owedBytes: number;
  lastS: number;
}
/** How a mirror is asked. */
export interface Asking {
  stallTimeoutS: number;
  /** Caches are passed by. */
  reload: boolean;
  /** Other mirrors are left that may have the bytes. */
  othersLeft: boolean;
}

/** Servers with the same files. */
export class Mirrors {
  readonly all: Mirror[];

  constructor(urls: readonly string[], readonly client: HttpClient) {
    this.all = urls.map((url) => ({ url, at: url, alive: true, etag: '', total: -1,
      throughput: transferRate(1e5), owedBytes: 0, lastS: 0 }));
  }
  private get alive_(): Mirror[] {
    return this.all.filter((m) => m.alive);
  }

  /** Leaves a mirror that fails alone, as long as there are others. Gives whether there are. */
  failed(m: Mirror): boolean {
    if (m.alive) m.alive = this.alive_.length < 2;
    return !m.alive;
  }

  /**
   * Asks the mirror that should deliver first, by the throughput and the bytes under way of each; then the
   * next. The failure of the last mirror is thrown. A last mirror whose bytes are damaged is asked once more:
   * a cache on the way may hold bad bytes.
   */
  async ask<T>(bytes: number, ask: (m: Mirror, how: Asking) => Promise<T>): Promise<T> {
    for (let reload = false; ; ) {
      const { rttS, options } = this.client;
      const expectedS = (k: Mirror): number => (k.owedBytes + bytes) / k.throughput.recentBytesS();
      const [m, ...others] = this.alive_.sort((a, b) => expectedS(a) - expectedS(b));
      const othersLeft = others.length > 0;
      const patienceS = Math.max(leastPatienceS, leastPatienceRtts * rttS, silenceFactor * expectedS(m));
      const stallTimeoutS = othersLeft ? Math.min(patienceS, options.stallTimeoutS) : options.stallTimeoutS;
      const started = nowS();
      m.owedBytes += bytes;
      try {
        const result = await ask(m, { stallTimeoutS, reload, othersLeft });
        const ended = nowS();
        m.throughput.add(bytes, ended - Math.max(m.lastS, started + rttS));
        m.lastS = ended;
        return result;
      } catch (error) {
        // A cancelled request says nothing about the mirror.
        if (error instanceof TexmeshError && this.failed(m)) continue;
        if (reload || !(error instanceof FormatError)) throw error;
        reload = true;
      } finally {
        m.owedBytes -= bytes;
      }
    }
  }
}
