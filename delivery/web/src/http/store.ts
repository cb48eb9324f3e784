import { startBytes } from '../format/layout';
import type { ByteRange } from '../format/manifest';
import type { RequestKind } from './requests';

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
   * How ranges use the browser's cache. Default no-store: Chromium answers ranges of one URL that may be
   * cached one after the other, however many were asked for at once; with a round trip for each, a slow link
   * stands idle.
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

/** How a package's bytes are read: ranges of a container, files of a tree, or one whole container. */
export type PackageForm = 'range' | 'files' | 'whole';

/** Path and range of an entry that bytes are read of. */
export interface Place extends ByteRange {
  path: string;
}
/** How bytes are read. */
export interface ReadOptions {
  kind: RequestKind;
  signal?: AbortSignal;
  onBytes?: (received: number) => void;
  /** The bytes are read once only: the store need not remember them. */
  once?: boolean;
  /** Throws FormatError when the bytes are wrong; the bytes are then asked for at another mirror. */
  verify?: (bytes: Uint8Array) => Promise<void>;
}

/** Source of a package's bytes. */
export interface PackageStore {
  readonly form: PackageForm;
  /** Name of the store in messages. */
  readonly name: string;
  /** The bytes of manifest.json; of a container that is read by ranges, its first bytes. */
  manifest(signal?: AbortSignal): Promise<Uint8Array>;
  /** Reads exactly this range of the container, which lies within an entry. */
  read(place: Place, range: ByteRange, how: ReadOptions): Promise<Uint8Array>;
  /** Reads a file of a tree that is no entry; undefined where there is no such file, and no `verify`. */
  extraFile?(path: string, maxBytes: number, how: ReadOptions): Promise<Uint8Array | undefined>;
  /** Forgets bytes that were read. */
  dispose(): void;
}

/** See OpenOptions.mode. */
export type StoreMode = 'auto' | 'range' | 'files';
/** A store that was opened, and the manifest's bytes. */
export interface OpenedStore {
  store: PackageStore;
  manifest: Uint8Array;
}
