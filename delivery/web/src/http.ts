import { FormatError, InputError } from './errors';

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
  /** Without a byte. */
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
  /** Of Content-Range, when it may be read. */
  range?: { first: number; last: number; total: number };
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
  return error instanceof Error && error.name === 'AbortError';
}

/** As the browser names it. */
export function absolute(url: string): string {
  const here = globalThis.location?.href;
  return here && URL.canParse(url, here) ? new URL(url, here).href : url;
}

/** What cancelled calls throw. */
export function abortError(): Error {
  return new DOMException('The load was cancelled', 'AbortError');
}
/** Throws an AbortError where a signal says so. */
export function throwIfAborted(signal?: AbortSignal): void {
  if (signal?.aborted) throw abortError();
}

function contentRange(text: string): Answer['range'] {
  const m = /^bytes (\d{1,15})-(\d{1,15})\/(\d{1,16})$/.exec(text);
  if (!m) return undefined;
  const [first, last, total] = m.slice(1).map(Number);
  return first <= last && last < total ? { first, last, total } : undefined;
}

/** Requests to one or more servers: a window of connections, stalls, a cap; one try each. */
export class HttpClient {
  readonly options: HttpOptions;
  /** Least time from asking to the answer's head, without the first request, which opens the connection. */
  rttS = 0;
  private readonly waits_: number[] = []; // of the last requests
  received = 0;
  requests = 0;
  onRequest?: (record: RequestRecord) => void;
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
    return sorted.length > 0 ? sorted[sorted.length >> 1] : this.rttS;
  }

  private async enter_(): Promise<void> {
    if (this.active_ >= this.limit_) await new Promise<void>((go) => this.waiting_.push(go));
    else ++this.active_;
  }
  private leave_(): void {
    const next = this.waiting_.shift();
    if (next) next();
    else --this.active_;
  }

  /** One GET; network problems come back in the answer, only cancelling throws. */
  async get(url: string, get: GetOptions): Promise<Answer> {
    const { signal, range, kind, stallTimeoutS = this.options.stallTimeoutS } = get;
    throwIfAborted(signal);
    await this.enter_();
    const abort = new AbortController();
    const cancel = (): void => abort.abort();
    signal?.addEventListener('abort', cancel);
    const record: RequestRecord = {
      url, offset: range?.offset ?? 0, bytes: range?.bytes ?? -1, received: 0, kind,
      started: nowS(), firstByte: -1, ended: 0, status: 0, ok: false,
    };
    const answer: Answer = { url, status: 0, problem: '', body: new Uint8Array(0), etag: '', complete: false, tooLong: false };
    const stall = stallTimer(stallTimeoutS, cancel);
    try {
      throwIfAborted(signal);
      await this.transfer_(get, abort.signal, answer, record, stall);
    } catch (error) {
      if (signal?.aborted) throw abortError();
      answer.problem = stall.fired ? `no byte for ${stallTimeoutS.toFixed(1)} s` : String((error as Error).message);
    } finally {
      stall.stop();
      signal?.removeEventListener('abort', cancel);
      if (!answer.complete) cancel();
      this.leave_();
      record.ended = nowS();
      record.status = answer.status;
      record.ok = answer.complete && answer.status === (range ? 206 : 200);
      this.note_(url, record);
    }
    return answer;
  }

  private async transfer_(get: GetOptions, signal: AbortSignal, answer: Answer, record: RequestRecord, stall: StallTimer): Promise<void> {
    const { range, ifRange } = get;
    const headers: Record<string, string> = {};
    if (range) headers.Range = `bytes=${range.offset}-${range.offset + range.bytes - 1}`;
    if (ifRange) headers['If-Range'] = ifRange;
    const cache = get.reload ? 'reload' : range ? this.options.rangeCache : 'default';
    const response = await (this.options.fetch ?? globalThis.fetch)(answer.url, { headers, signal, cache });
    stall.restart();
    record.firstByte = nowS();
    const { status, body } = response;
    const header = (name: string): string => response.headers.get(name) ?? '';
    answer.status = status;
    answer.url = response.url || answer.url;
    if (header('etag').startsWith('"')) answer.etag = header('etag');
    answer.range = contentRange(header('content-range'));
    if (status !== (range ? 206 : 200)) {
      void body?.cancel().catch(() => undefined);
      answer.complete = status !== 206;
      return;
    }
    await this.readBody_(body, get, answer, record, stall);
    // Content-Length, where nothing was decoded on the way.
    const said = header('content-encoding') ? '' : header('content-length');
    const length = answer.range && range ? answer.range.last - answer.range.first + 1 : /^\d+$/.test(said) ? +said : answer.body.length;
    answer.complete = !answer.tooLong && length === answer.body.length;
  }

  private async readBody_(body: Response['body'], get: GetOptions, answer: Answer, record: RequestRecord, stall: StallTimer): Promise<void> {
    const chunks: Uint8Array[] = [];
    const reader = body?.getReader();
    try {
      while (reader && !answer.tooLong) {
        const { done, value } = await reader.read();
        stall.restart();
        if (done) break;
        chunks.push(value);
        record.received += value.length;
        this.received += value.length;
        if (record.received > get.maxBytes) answer.tooLong = true;
        else get.onBytes?.(record.received);
        await this.holdBack_(value.length, stall, get.signal);
      }
    } finally {
      // What came before a cut is worth keeping.
      answer.body = chunks.length === 1 ? chunks[0] : concat(chunks, record.received);
    }
  }

  /** Waits as long as the cap wants. */
  private async holdBack_(bytes: number, stall: StallTimer, signal?: AbortSignal): Promise<void> {
    if (!(this.options.capBytesS > 0)) return;
    const now = nowS();
    this.capFreeS_ = Math.max(now, this.capFreeS_) + bytes / this.options.capBytesS;
    stall.stop();
    if (this.capFreeS_ > now) await sleepS(this.capFreeS_ - now, signal);
    throwIfAborted(signal);
    stall.restart();
  }

  private note_(url: string, record: RequestRecord): void {
    if (record.ok && record.firstByte >= 0 && this.requests > 0) {
      const wait = record.firstByte - record.started;
      this.rttS = this.rttS > 0 ? Math.min(this.rttS, wait) : wait;
      if (this.waits_.push(wait) > latencySamples) this.waits_.shift();
    }
    ++this.requests;
    if (this.requests <= 4 && typeof performance.getEntriesByName === 'function') {
      const timing = performance.getEntriesByName(absolute(url), 'resource').at(-1) as PerformanceResourceTiming | undefined;
      if (timing && /^h[23]/.test(timing.nextHopProtocol)) this.limit_ = this.options.streams;
    }
    this.onRequest?.(record);
  }
}

/** Pieces of `total` bytes as one. */
export function concat(chunks: readonly Uint8Array[], total: number): Uint8Array {
  const out = new Uint8Array(total);
  let at = 0;
  for (const c of chunks) {
    out.set(c, at);
    at += c.length;
  }
  return out;
}

/** Aborts after so many seconds without a restart. */
interface StallTimer {
  fired: boolean;
  restart(): void;
  stop(): void;
}
function stallTimer(seconds: number, onStall: () => void): StallTimer {
  let timer: ReturnType<typeof setTimeout>;
  const stop = (): void => clearTimeout(timer);
  const fire = (): void => {
    stall.fired = true;
    onStall();
  };
  const restart = (): void => {
    stop();
    timer = setTimeout(fire, seconds * 1000);
  };
  const stall: StallTimer = { fired: false, restart, stop };
  restart();
  return stall;
}

/** Whether what could not be had will not be there later on, either. */
export function isForGood(error: unknown): boolean {
  return error instanceof FormatError || (error instanceof InputError && /^status 4(?!08|29)/.test(error.found));
}

/** For messages. */
export function whatCame(a: Answer): string {
  return a.problem !== '' ? a.problem : a.status === 0 ? 'no answer' : `status ${a.status}`;
}
