import { FormatError, InputError } from '../format/errors';

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
/** Gives the page a turn: resolves in a task of its own, where a timer would wait for 4 ms and more. */
export const nextTurn = (): Promise<void> =>
  new Promise((done) => {
    const { port1, port2 } = new MessageChannel();
    port1.onmessage = (): void => {
      port1.close();
      done();
    };
    port2.postMessage(0);
  });

/** Purpose of a request's bytes, in request events and in bytes counted by kind. */
export type RequestKind =
  | 'manifest'
  | 'index'
  | 'tables'
  | 'textures'
  | 'quality'
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

/** Answer to a request; the body holds no more bytes than were asked for. */
export interface Answer {
  /** HTTP status; 0: no answer at all, see problem. */
  status: number;
  problem: string;
  body: Uint8Array;
  /** URL of the answer, behind redirections. */
  url: string;
  /** Strong ETag; '' = none. */
  etag: string;
  /** Content-Type; '' = not said. */
  type: string;
  /** Content-Encoding, where that header may be read; '' = none. */
  encoding: string;
  /** Content-Length of a whole file; -1 = not said. */
  length: number;
  /** Content-Range, when that header may be read: first and last byte, bytes of the file (-1 = not said). */
  range?: number[];
  /** Seconds after which the server wants to be asked again; NaN: a date. */
  retryAfterS?: number;
  /** The body ended as it should. */
  complete: boolean;
  tooLong: boolean;
}

/** Options of one GET. */
export interface GetOptions {
  range?: { offset: number; bytes: number };
  maxBytes: number;
  kind: RequestKind;
  signal?: AbortSignal;
  stallTimeoutS?: number;
  /** Hears how many bytes have come so far. */
  onBytes?: (received: number) => void;
  reload?: boolean;
}

/** First and last byte, bytes of the file, from a Content-Range; undefined where the text is none. */
export function contentRange(text: string): Answer['range'] {
  const said = /^bytes (\d{1,15})-(\d{1,15})\/(-?\d{1,16})$/.exec(text.replace('*', '-1'))?.slice(1)
    .map(Number);
  return said && said[0] <= said[1] && (said[1] < said[2] || said[2] < 0) ? said : undefined;
}

/** Whether an answer is of the file with this ETag ('' = none) and length (-1 = unknown), if known. */
export function isSameFile({ etag, range, length }: Answer, known: { etag: string; total: number }): boolean {
  if (etag && known.etag) return etag === known.etag;
  const total = range ? range[2] : length;
  return total < 0 || known.total < 0 || total === known.total;
}

/** A URL without user, password and query, for messages. */
export function shownUrl(url: string): string {
  return url.replace(/^(\w+:\/\/)[^/@]*@/, '$1').replace(/[?#].*$/, '');
}

/** Whether an error says that asking later is of no use, either. */
export function isForGood(error: unknown): boolean {
  return error instanceof FormatError ||
    (error instanceof InputError && /^status 4(?!08|29)/.test(error.found));
}

/** An answer's problem or status, for messages. */
export function whatCame(a: Answer): string {
  const said = a.problem || (a.status > 0 ? `status ${a.status}${a.type && ` (${a.type})`}` : 'no answer');
  return said + (a.encoding && `, Content-Encoding: ${a.encoding}`);
}
