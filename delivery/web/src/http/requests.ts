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

/** First and last byte, bytes of the file; undefined where it does not say so. */
export function contentRange(text: string): Answer['range'] {
  const said = /^bytes (\d{1,15})-(\d{1,15})\/(\d{1,16})$/.exec(text)?.slice(1).map(Number);
  return said && said[0] <= said[1] && said[1] < said[2] ? said : undefined;
}

/** https://host/path without user, password and query, for messages. */
export function shownUrl(url: string): string {
  return url.replace(/^(\w+:\/\/)[^/@]*@/, '$1').replace(/[?#].*$/, '');
}

/** Whether what could not be had will not be there later on, either. */
export function isForGood(error: unknown): boolean {
  return error instanceof FormatError || (error instanceof InputError && /^status 4(?!08|29)/.test(error.found));
}

/** For messages. */
export function whatCame(a: Answer): string {
  return a.problem || (a.status > 0 ? `status ${a.status}` : 'no answer');
}
