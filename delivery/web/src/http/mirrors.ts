import { FormatError, TexmeshError } from '../format/errors';
import { HttpClient } from './client';
import { nowS } from './clock';
import { TransferRate, transferRate } from './throughput';

const silenceFactor = 4;
const leastPatienceRtts = 8;
const leastPatienceS = 0.5;

/** A URL that a package can be had from, and what it has shown so far. */
export interface Mirror {
  url: string;
  alive: boolean;
  /** Where its answers come from. */
  at: string;
  etag: string;
  /** Bytes of the container; -1 = not known. */
  total: number;
  throughput: TransferRate;
  owedBytes: number;
  lastS: number;
}
/** How a mirror is to be asked. */
export interface Asking {
  stallTimeoutS: number;
  /** Past what caches hold. */
  reload: boolean;
  /** Somebody else may have it. */
  elsewhere: boolean;
}

/** Servers that have the same files. */
export class Mirrors {
  readonly all: Mirror[];

  constructor(
    urls: readonly string[],
    readonly client: HttpClient,
  ) {
    this.all = urls.map((url) => ({ url, at: url, alive: true, etag: '', total: -1, throughput: transferRate(1e5), owedBytes: 0, lastS: 0 }));
  }
  private get alive_(): Mirror[] {
    return this.all.filter((m) => m.alive);
  }

  /** One that fails is not asked again, as long as there are others. Says whether there are. */
  failed(m: Mirror): boolean {
    if (m.alive) m.alive = this.alive_.length < 2;
    return !m.alive;
  }

  /**
   * Asks the one that delivers first, by what each has delivered so far and has to deliver yet; then the next. The last one's failure is
   * everybody's; where its bytes are damaged, it is asked once more: a cache on the way may hold something bad.
   */
  async ask<T>(bytes: number, ask: (m: Mirror, how: Asking) => Promise<T>): Promise<T> {
    for (let reload = false; ; ) {
      const { rttS, options } = this.client;
      const expectedS = (k: Mirror): number => (k.owedBytes + bytes) / k.throughput.recentBytesS();
      const [m, ...others] = this.alive_.sort((a, b) => expectedS(a) - expectedS(b));
      const elsewhere = others.length > 0;
      const patienceS = Math.max(leastPatienceS, leastPatienceRtts * rttS, silenceFactor * expectedS(m));
      const stallTimeoutS = elsewhere ? Math.min(patienceS, options.stallTimeoutS) : options.stallTimeoutS;
      const started = nowS();
      m.owedBytes += bytes;
      try {
        const result = await ask(m, { stallTimeoutS, reload, elsewhere });
        const ended = nowS();
        m.throughput.add(bytes, ended - Math.max(m.lastS, started + rttS));
        m.lastS = ended;
        return result;
      } catch (error) {
        // What is cancelled says nothing of the mirror.
        if (error instanceof TexmeshError && this.failed(m)) continue;
        if (reload || !(error instanceof FormatError)) throw error;
        reload = true;
      } finally {
        m.owedBytes -= bytes;
      }
    }
  }
}
