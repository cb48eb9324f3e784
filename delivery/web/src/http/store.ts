import type { ByteRange } from '../format/manifest';
import type { RequestKind } from './requests';

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
