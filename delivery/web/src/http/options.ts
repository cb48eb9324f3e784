import { startBytes } from '../format/layout';

/** Limits on servers: time, tries, bytes, requests at once. */
export interface HttpOptions {
  /** Stands in for the browser's fetch; gets a URL and a RequestInit. */
  fetch?: typeof fetch;
  /** Bytes of the first request, at least 16384: manifest, first picture, and what stands behind these. */
  startBytes: number;
  /** Retries of one request, after cut connections, stalls and statuses 408, 429, 5xx. */
  retries: number;
  /** Pause before the first retry, doubled for each further one. */
  retryDelayS: number;
  /** Longest time without a byte, or without a worker's answer about a document. */
  stallTimeoutS: number;
  /**
   * How ranges use the browser's cache. Default no-store: Chromium answers ranges of one URL that may be cached one after
   * the other, however many were asked for at once; with a round trip for each, a slow link stands idle.
   */
  rangeCache: RequestCache;
  /** Requests at once while the server speaks HTTP/1.1. */
  connections: number;
  /** Requests at once over HTTP/2 and HTTP/3. */
  streams: number;
  /** Most bytes of a container from a server that knows no ranges. */
  maxWholeBytes: number;
  /** Bytes per second at most, for trying slow links; 0 = no limit. */
  capBytesS: number;
}
/** Options where the caller says nothing. */
export const defaultHttpOptions: HttpOptions = {
  startBytes,
  retries: 3,
  retryDelayS: 0.2,
  stallTimeoutS: 10,
  rangeCache: 'no-store',
  connections: 6,
  streams: 32,
  maxWholeBytes: 1 << 30,
  capBytesS: 0,
};
