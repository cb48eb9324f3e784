import { FormatError, InputError } from '../format/errors';

/** What bytes are for; of request events and of the bytes counted by kind. */
export type RequestKind =
  | 'manifest'
  | 'index'
  | 'tables'
  | 'textures'
  | 'quality'
  | 'first-picture'
  | 'mesh'
  | 'preview'
  | 'texture'
  | 'stream'
  | 'other';

/** One finished request; times in seconds of performance.now(). */
export interface RequestRecord {
  url: string;
  /** First byte and number of bytes asked for; 0 and -1 for whole files. */
  offset: number;
  bytes: number;
  /** Bytes of the body that came. */
  received: number;
  kind: RequestKind;
  started: number;
  /** When the answer's head came; -1 when none did. */
  firstByte: number;
  ended: number;
  status: number;
  ok: boolean;
}

/** Limits of what a server may do to us. */
export interface HttpOptions {
  /** Instead of the browser's; gets a URL and a RequestInit. */
  fetch?: typeof fetch;
  /** Of one request, after cut connections, stalls and statuses 408, 429, 5xx. */
  retries: number;
  /** Before the first retry, doubled for each further one. */
  retryDelayS: number;
  /** Without a byte, or without a worker's answer about a document. */
  stallTimeoutS: number;
  /**
   * The browser's cache, for ranges. Default no-store: Chromium answers ranges of one URL that may be cached one after
   * the other, however many were asked for at once, and with a round trip for each a slow link stands idle.
   */
  rangeCache: RequestCache;
  /** Requests at once while the server speaks HTTP/1.1. */
  connections: number;
  /** Requests at once over HTTP/2 and HTTP/3. */
  streams: number;
  /** Of a container from a server that knows no ranges. */
  maxWholeBytes: number;
  /** Bytes per second at most, for trying slow links; 0 = no limit. */
  capBytesS: number;
}
/** Where the caller says nothing. */
export const defaultHttpOptions: HttpOptions = {
  retries: 3,
  retryDelayS: 0.2,
  stallTimeoutS: 10,
  rangeCache: 'no-store',
  connections: 6,
  streams: 32,
  maxWholeBytes: 1 << 30,
  capBytesS: 0,
};

/** What came back; the body holds at most what was asked for. */
export interface Answer {
  /** 0: no answer at all, see problem. */
  status: number;
  problem: string;
  body: Uint8Array;
  /** Where it came from: behind redirections. */
  url: string;
  /** Strong ones only. */
  etag: string;
  /** Of Content-Range, when it may be read: first and last byte, bytes of the file. */
  range?: number[];
  /** The body ended as it should. */
  complete: boolean;
  tooLong: boolean;
}

/** Of one GET. */
export interface GetOptions {
  range?: { offset: number; bytes: number };
  ifRange?: string;
  maxBytes: number;
  kind: RequestKind;
  signal?: AbortSignal;
  stallTimeoutS?: number;
  /** Called with the bytes that have come so far. */
  onBytes?: (received: number) => void;
  reload?: boolean;
}

/** Answers that latency is the median of. */
const latencySamples = 7;

/** Seconds of performance.now(). */
export const nowS = (): number => performance.now() / 1000;
/** Resolves after so many seconds, or when a signal says so. */
export const sleepS = (seconds: number, signal?: AbortSignal): Promise<void> =>
  new Promise((done) => {
    const end = (): void => {
      clearTimeout(timer);
      signal?.removeEventListener('abort', end);
      done();
    };
    const timer = setTimeout(end, seconds * 1000);
    signal?.addEventListener('abort', end);
  });

/** https://host/path without user, password and query, for messages. */
export function shownUrl(url: string): string {
  return url.replace(/^(\w+:\/\/)[^/@]*@/, '$1').replace(/[?#].*$/, '');
}

/** Whether an error says that somebody cancelled. */
export function isAbort(error: unknown): boolean {
  return (error as Partial<Error>)?.name === 'AbortError';
}

/** As the browser names it; a URL that somebody has answered at. */
export const absolute = (url: string): string => new URL(url, globalThis.location?.href).href;

/** What cancelled calls throw. */
export function abortError(): Error {
  return new DOMException('The load was cancelled', 'AbortError');
}
/** Throws an AbortError where a signal says so. */
export function throwIfAborted(signal?: AbortSignal): void {
  if (signal?.aborted) throw abortError();
}

/** First and last byte, bytes of the file; undefined where it does not say so. */
function contentRange(text: string): Answer['range'] {
  const said = /^bytes (\d{1,15})-(\d{1,15})\/(\d{1,16})$/.exec(text)?.slice(1).map(Number);
  return said && said[0] <= said[1] && said[1] < said[2] ? said : undefined;
}

/** Requests to one or more servers: a window of connections, stalls, a cap; one try each. */
export class HttpClient {
  readonly options: HttpOptions;
  /** Least time from asking to the answer's head, without the first request, which opens the connection. */
  rttS = 0;
  received = 0;
  /** Those that have ended. */
  readonly records: RequestRecord[] = [];
  readonly listeners = new Set<(record: RequestRecord) => void>();
  private readonly waits_: number[] = []; // of the last requests
  private active_ = 0;
  private readonly waiting_: (() => void)[] = [];
  private limit_: number;
  private capFreeS_ = 0;

  constructor(options: Partial<HttpOptions> = {}) {
    this.options = { ...defaultHttpOptions, ...options };
    this.limit_ = this.options.connections;
  }

  /** What a request takes to be answered, in the middle of the last ones: servers and busy pages add to the round trip. */
  get latencyS(): number {
    const sorted = [...this.waits_].sort((a, b) => a - b);
    return sorted[sorted.length >> 1] ?? this.rttS;
  }

  /** One GET; network problems come back in the answer, only cancelling throws. */
  async get(url: string, get: GetOptions): Promise<Answer> {
    const { options } = this;
    const { range, ifRange, maxBytes, kind, signal, stallTimeoutS = options.stallTimeoutS, onBytes, reload } = get;
    throwIfAborted(signal);
    if (this.active_ < this.limit_) ++this.active_;
    else await new Promise<void>((go) => this.waiting_.push(go));
    const abort = new AbortController();
    const cancel = (): void => abort.abort();
    const answer: Answer = { url, status: 0, problem: '', body: new Uint8Array(0), etag: '', complete: false, tooLong: false };
    const record: RequestRecord = {
      url, offset: range?.offset ?? 0, bytes: range?.bytes ?? -1, received: 0, kind,
      started: nowS(), firstByte: -1, ended: 0, status: 0, ok: false,
    };
    const chunks: Uint8Array[] = [];
    let timer: ReturnType<typeof setTimeout> | undefined;
    const alive = (): void => {
      clearTimeout(timer);
      timer = setTimeout(() => {
        answer.problem = `no byte for ${stallTimeoutS.toFixed(1)} s`;
        cancel();
      }, stallTimeoutS * 1000);
    };
    signal?.addEventListener('abort', cancel);
    try {
      throwIfAborted(signal);
      alive();
      const headers: Record<string, string> = {};
      if (range) headers.Range = `bytes=${range.offset}-${range.offset + range.bytes - 1}`;
      if (ifRange) headers['If-Range'] = ifRange;
      const cache = reload ? 'reload' : range ? options.rangeCache : 'default';
      const response = await (options.fetch ?? globalThis.fetch)(url, { headers, signal: abort.signal, cache });
      alive();
      record.firstByte = nowS();
      const { status, body } = response;
      record.ok = status === (range ? 206 : 200);
      const header = (name: string): string => response.headers.get(name) ?? '';
      const etag = header('etag');
      Object.assign(answer, { status, url: response.url || url, etag: etag[0] === '"' ? etag : '', range: contentRange(header('content-range')) });
      const reader = record.ok ? body?.getReader() : undefined;
      while (reader && !answer.tooLong) {
        const { done, value } = await reader.read();
        alive();
        if (done) break;
        if (options.capBytesS > 0) {
          clearTimeout(timer);
          await this.holdBack_(value.length, signal); // nobody may know of it before
          alive();
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
      if (!answer.complete || !record.ok) cancel(); // what nobody reads
      (this.waiting_.shift() ?? (() => --this.active_))();
      answer.body = concat(chunks, record.received); // what came before a cut is worth keeping
      record.ok &&= answer.complete;
      record.status = answer.status;
      record.ended = nowS();
      this.note_(record);
    }
    return answer;
  }

  /** Waits as long as the cap wants. */
  private async holdBack_(bytes: number, signal?: AbortSignal): Promise<void> {
    this.capFreeS_ = Math.max(nowS(), this.capFreeS_) + bytes / this.options.capBytesS;
    await sleepS(this.capFreeS_ - nowS(), signal);
    throwIfAborted(signal);
  }

  private note_(record: RequestRecord): void {
    const { url, ok, firstByte, started, status } = record;
    if (ok && this.records.length > 0) {
      const wait = firstByte - started;
      this.rttS = Math.min(this.rttS || wait, wait);
      if (this.waits_.push(wait) > latencySamples) this.waits_.shift();
    }
    if (this.records.push(record) <= 4 && status > 0) {
      const timing = performance.getEntriesByName?.(absolute(url), 'resource').at(-1) as PerformanceResourceTiming | undefined;
      if (timing && /^h[23]/.test(timing.nextHopProtocol)) this.limit_ = this.options.streams;
    }
    for (const listener of this.listeners) listener(record);
  }
}

/** Pieces of `total` bytes as one. */
export function concat(chunks: readonly Uint8Array[], total: number): Uint8Array {
  if (chunks.length === 1) return chunks[0];
  const out = new Uint8Array(total);
  let at = 0;
  for (const c of chunks) {
    out.set(c, at);
    at += c.length;
  }
  return out;
}

/** Whether what could not be had will not be there later on, either. */
export function isForGood(error: unknown): boolean {
  return error instanceof FormatError || (error instanceof InputError && /^status 4(?!08|29)/.test(error.found));
}

/** For messages. */
export function whatCame(a: Answer): string {
  return a.problem || (a.status > 0 ? `status ${a.status}` : 'no answer');
}
