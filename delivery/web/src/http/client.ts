import { concat } from '../format/sha256';
import { abortError, throwIfAborted } from '../format/errors';
import { Answer, GetOptions, RequestRecord, contentRange, nowS, sleepS } from './requests';
import { HttpOptions, defaultHttpOptions } from './store';

/** Number of answers that latency is the median of. */
const latencySamples = 7;

/** A URL that has answered, as the browser names the URL. */
export const absolute = (url: string): string => new URL(url, globalThis.location?.href).href;

/** Requests to one or more servers: a window of connections, stalls, a cap; one try each. */
export class HttpClient {
  readonly options: HttpOptions;
  /** Least time from asking to the answer's head, without the first request, which opens the connection. */
  rttS = 0;
  received = 0;
  /** A server has compressed files that are compressed already. */
  compressed = false;
  /** Requests that servers have not answered well, since the last one that they have. */
  failedInRow = 0;
  /** Requests that have ended. */
  readonly records: RequestRecord[] = [];
  readonly listeners = new Set<(record: RequestRecord) => void>();
  private readonly waits_: number[] = []; // seconds to the answers of the last requests
  private active_ = 0;
  private readonly waiting_: (() => void)[] = [];
  private limit_: number;
  private capFreeS_ = 0;

  constructor(options: Partial<HttpOptions> = {}) {
    this.options = { ...defaultHttpOptions, ...options };
    this.limit_ = this.options.connections;
  }

  /** Median time from request to answer: servers and busy pages add to the round trip. */
  get latencyS(): number {
    const sorted = [...this.waits_].sort((a, b) => a - b);
    return sorted[sorted.length >> 1] ?? this.rttS;
  }

  /** One GET; network problems come back in the answer, only cancelling throws. */
  async get(url: string, get: GetOptions): Promise<Answer> {
    const { options } = this;
    const { range, maxBytes, kind, signal, stallTimeoutS = options.stallTimeoutS, onBytes, reload } = get;
    throwIfAborted(signal);
    if (this.active_ < this.limit_) ++this.active_;
    else await new Promise<void>((go) => this.waiting_.push(go));
    const abort = new AbortController();
    const cancel = (): void => abort.abort();
    const answer: Answer = { url, status: 0, problem: '', body: new Uint8Array(0), etag: '', type: '',
      encoding: '', length: -1, complete: false, tooLong: false };
    const record: RequestRecord = {
      url, offset: range?.offset ?? 0, bytes: range?.bytes ?? -1, received: 0, kind,
      started: nowS(), firstByte: -1, ended: 0, status: 0, ok: false,
    };
    const chunks: Uint8Array[] = [];
    let timer: ReturnType<typeof setTimeout> | undefined;
    const restartStallTimer = (): void => {
      clearTimeout(timer);
      timer = setTimeout(() => {
        answer.problem = `no byte for ${stallTimeoutS.toFixed(1)} s`;
        cancel();
      }, stallTimeoutS * 1000);
    };
    signal?.addEventListener('abort', cancel);
    try {
      throwIfAborted(signal);
      restartStallTimer();
      const headers: Record<string, string> = {};
      if (range) headers.Range = `bytes=${range.offset}-${range.offset + range.bytes - 1}`;
      const cache = reload ? 'reload' : range ? options.rangeCache : 'default';
      const response =
        await (options.fetch ?? globalThis.fetch)(url, { headers, signal: abort.signal, cache });
      restartStallTimer();
      record.firstByte = nowS();
      const { status, body } = response;
      record.ok = status === (range ? 206 : 200);
      const header = (name: string): string => response.headers.get(name) ?? '';
      const etag = header('etag');
      const length = status === 200 && /^\d{1,15}$/.test(header('content-length'))
        ? Number(header('content-length')) : -1;
      Object.assign(answer, { status, url: response.url || url, etag: etag[0] === '"' ? etag : '', length,
        type: header('content-type'), encoding: header('content-encoding').replace(/^\W*identity\W*$/, ''),
        retryAfterS: Number(header('retry-after')),
        range: contentRange(header('content-range')) });
      this.compressed ||= status < 300 && !/json|html/.test(answer.type) && answer.encoding !== '';
      const reader = record.ok ? body?.getReader() : undefined;
      while (reader && !answer.tooLong) {
        const { done, value } = await reader.read();
        restartStallTimer();
        if (done) break;
        if (options.capBytesS > 0) {
          clearTimeout(timer);
          await this.holdBack_(value.length, signal); // nobody may hear of the bytes before
          restartStallTimer();
        }
        chunks.push(value);
        record.received += value.length;
        this.received += value.length;
        answer.tooLong = record.received > maxBytes;
        if (answer.tooLong) answer.problem = 'more bytes than were asked for';
        else onBytes?.(record.received);
      }
      const [first, last] = answer.range ?? [1, record.received];
      answer.complete = record.ok ? !answer.tooLong && last - first + 1 === record.received : status !== 206;
    } catch (error) {
      if (signal?.aborted) throw abortError();
      answer.problem ||= String((error as Error).message);
    } finally {
      clearTimeout(timer);
      signal?.removeEventListener('abort', cancel);
      if (!answer.complete || !record.ok) cancel(); // nobody reads the rest
      (this.waiting_.shift() ?? (() => --this.active_))();
      answer.body = concat(chunks); // bytes before a cut are worth keeping
      record.ok &&= answer.complete;
      record.status = answer.status;
      record.ended = nowS();
      this.record_(record);
    }
    return answer;
  }

  /** Waits as long as the cap on throughput wants. */
  private async holdBack_(bytes: number, signal?: AbortSignal): Promise<void> {
    this.capFreeS_ = Math.max(nowS(), this.capFreeS_) + bytes / this.options.capBytesS;
    await sleepS(this.capFreeS_ - nowS(), signal);
    throwIfAborted(signal);
  }

  private record_(record: RequestRecord): void {
    const { url, ok, firstByte, started, status } = record;
    this.failedInRow = ok ? 0 : this.failedInRow + 1;
    if (ok && this.records.length > 0) {
      const wait = firstByte - started;
      this.rttS = Math.min(this.rttS || wait, wait);
      if (this.waits_.push(wait) > latencySamples) this.waits_.shift();
    }
    if (this.records.push(record) <= 4 && status > 0) {
      const timing = performance.getEntriesByName?.(absolute(url), 'resource')
        .at(-1) as PerformanceResourceTiming | undefined;
      if (timing && /^h[23]/.test(timing.nextHopProtocol)) this.limit_ = this.options.streams;
    }
    for (const listener of this.listeners) listener(record);
  }
}
