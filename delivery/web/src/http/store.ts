import type { ByteRange } from '../format/manifest';
import type { RequestKind } from './requests';

/** How a package's bytes are read: ranges of a container, files of a tree, or one whole container. */
export type PackageForm = 'range' | 'files' | 'whole';

/** What a read needs to know about an entry. */
export interface Place extends ByteRange {
  path: string;
}
/** How something is read. */
export interface ReadOptions {
  kind: RequestKind;
  signal?: AbortSignal;
  onBytes?: (received: number) => void;
  /** Not to be remembered: what is read once only. */
  once?: boolean;
  /** Throws FormatError when the bytes are not what they should be; they are then asked for elsewhere. */
  verify?: (bytes: Uint8Array) => Promise<void>;
}

/** Where a package's bytes come from. */
export interface PackageStore {
  readonly form: PackageForm;
  /** For messages. */
  readonly name: string;
  /** The bytes of manifest.json; of a container that is read by ranges, its first bytes. */
  manifest(signal?: AbortSignal): Promise<Uint8Array>;
  /** Exactly these bytes of an entry, which stand there in the container. */
  read(place: Place, range: ByteRange, how: ReadOptions): Promise<Uint8Array>;
  /** A file of a tree that is no entry; undefined where there is none, and nothing to verify that it is. */
  extraFile?(path: string, maxBytes: number, how: ReadOptions): Promise<Uint8Array | undefined>;
  /** Forgets what it remembers. */
  dispose(): void;
}

/** See OpenOptions.mode. */
export type StoreMode = 'auto' | 'range' | 'files';
/** A store, and the manifest's bytes. */
export interface OpenedStore {
  store: PackageStore;
  manifest: Uint8Array;
}
