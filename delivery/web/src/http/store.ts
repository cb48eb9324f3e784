import { FormatError, InputError } from '../format/errors';
import { Answer, HttpClient, RequestKind, concat, isAbort, shownUrl, sleepS, throwIfAborted, whatCame } from './client';
import { bootstrapBytes } from '../format/layout';
import type { ByteRange } from '../format/manifest';
import { Asking, Mirror, Mirrors } from './mirrors';

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

/** Whether an answer from there is read without asking the server first (CORS). */
function sameOrigin(url: string): boolean {
  const here = globalThis.location;
  return !here || new URL(url, here.href).origin === here.origin;
}

/** Whether asking again may help. */
function mayRetry({ status, complete, tooLong }: Answer): boolean {
  if (status === 200 || status === 206) return !complete && !tooLong;
  return status === 0 || status === 408 || status === 429 || status >= 500;
}

/** Waits longer from try to try; gives false when there have been enough, or the answer says that another would be no better. */
export function retriesOf({ options }: HttpClient, signal?: AbortSignal): (a: Answer) => Promise<boolean> {
  let [left, delayS] = [options.retries, options.retryDelayS];
  return async (a) => {
    if (!mayRetry(a) || left-- <= 0) return false;
    await sleepS(delayS, signal);
    throwIfAborted(signal);
    delayS *= 2;
    return true;
  };
}

/** Ranges of a container. What was read is not asked for again, unless it was read `once`. */
class RangeStore implements PackageStore {
  readonly form = 'range';
  /** What a server said that knows no ranges. */
  noRanges?: InputError;
  private parts_: { begin: number; bytes: Uint8Array }[] = []; // the last one first
  private readonly mirrors_: Mirrors;

  constructor(urls: readonly string[], client: HttpClient) {
    this.mirrors_ = new Mirrors(urls, client);
  }
  get name(): string {
    return shownUrl(this.mirrors_.all[0].url);
  }

  manifest(signal?: AbortSignal): Promise<Uint8Array> {
    return this.read(undefined, { offset: 0, bytes: bootstrapBytes }, { kind: 'manifest', signal });
  }

  async read(_: unknown, { offset: begin, bytes }: ByteRange, how: ReadOptions): Promise<Uint8Array> {
    if (bytes === 0) return new Uint8Array(0); // as WebP's tables are; no range says that
    const end = begin + bytes;
    const part = this.parts_.find((p) => p.begin <= begin && p.begin + p.bytes.length > begin);
    let got: Uint8Array | undefined;
    if (part)
      try {
        const known = part.bytes.subarray(begin - part.begin, end - part.begin);
        const have = known.length;
        got = have < bytes ? concat([known, await this.fetch_(begin + have, bytes - have, { ...how, verify: undefined })], bytes) : known;
        await how.verify?.(got);
        if (have === bytes) return got;
      } catch (error) {
        if (!(error instanceof FormatError) || !how.verify) throw error;
        this.parts_ = this.parts_.filter((p) => p.begin >= end || p.begin + p.bytes.length <= begin); // what was known may be what is bad
        got = undefined;
      }
    got ??= await this.fetch_(begin, bytes, how);
    if (!how.once) this.parts_ = [{ begin, bytes: got }, ...this.parts_.filter((p) => p.begin < begin || p.begin + p.bytes.length > end)];
    return got;
  }

  private fetch_(offset: number, bytes: number, how: ReadOptions): Promise<Uint8Array> {
    return this.mirrors_.ask(bytes, async (m, asking) => {
      const got = await this.fetchFrom_(m, asking, offset, bytes, how);
      await how.verify?.(got);
      return got;
    });
  }
  /** A cut transfer goes on where it broke. */
  private async fetchFrom_(m: Mirror, asking: Asking, offset: number, bytes: number, { kind, signal, onBytes }: ReadOptions): Promise<Uint8Array> {
    const { client } = this.mirrors_;
    const again = retriesOf(client, signal);
    const chunks: Uint8Array[] = [];
    for (let have = 0; ; ) {
      this.require_(m, offset === 0 || m.total < 0 || offset + bytes <= m.total, offset, `a file of ${offset + bytes} bytes`, m.total); // before room is made
      const before = have;
      const range = { offset: offset + have, bytes: bytes - have };
      const a = await client.get(m.url, {
        range, kind, signal, maxBytes: range.bytes, ...asking,
        ifRange: sameOrigin(m.at) ? m.etag : '', // from another origin it would cost a preflight request
        onBytes: (n) => onBytes?.(before + n),
      });
      m.at = a.url;
      if (a.status === 200 && m.total < 0) throw (this.noRanges = new InputError(shownUrl(m.url), '', 'a server that answers ranges', 'status 200'));
      this.require_(m, a.status !== 200, offset, 'the file that reading began with', 'status 200: it was replaced, or the server no longer answers ranges');
      if (a.status === 206) {
        this.checkRange_(m, a, range);
        chunks.push(a.body);
        have += a.body.length;
        if (a.complete) return concat(chunks, have);
      }
      if ((asking.elsewhere && have === before) || !(await again(a)))
        throw new InputError(shownUrl(m.url), `byte ${range.offset}`, 'an answer with status 206', whatCame(a));
    }
  }
  private require_({ url }: Mirror, good: boolean, offset: number, expected: string, found: unknown): void {
    if (!good) throw new FormatError(shownUrl(url), `byte ${offset}`, expected, `${found}`);
  }

  /** Whether it is of the file that reading began with, and what was asked for. */
  private checkRange_(m: Mirror, { range, etag, url, complete, body }: Answer, { offset, bytes }: { offset: number; bytes: number }): void {
    this.require_(m, !m.etag || !etag || etag === m.etag, offset, 'the file that reading began with', 'another one (ETag)');
    m.etag ||= etag;
    // Another origin may keep the header to itself; then only the length tells.
    if (!range) {
      this.require_(m, !sameOrigin(url), offset, 'a Content-Range', 'none that can be read');
      return this.require_(m, !complete || offset === 0 || body.length === bytes, offset, `${bytes} bytes`, body.length);
    }
    const [first, last, total] = range;
    this.require_(m, m.total < 0 || total === m.total, offset, `a file of ${m.total} bytes`, total);
    this.require_(m, first === offset && last === Math.min(offset + bytes, total) - 1, offset, 'the range that was asked for', `${first}-${last}`);
    m.total = total;
  }

  dispose(): void {
    this.parts_ = [];
  }
}

/** See OpenOptions.mode. */
export type StoreMode = 'auto' | 'range' | 'files';
/** A store, and the manifest's bytes. */
export interface OpenedStore {
  store: PackageStore;
  manifest: Uint8Array;
}

/**
 * Finds out how the server can be read (SPEC.md, section 13): ranges of the container; the tree beside it where it
 * answers 200 to a range; the whole container where there is no tree.
 */
export async function openStore(
  url: string,
  mirrors: readonly string[],
  mode: StoreMode,
  client: HttpClient,
  signal?: AbortSignal,
): Promise<OpenedStore> {
  const urls = [url, ...mirrors.filter((m) => m !== url)];
  const files = () => import('./tree_store');
  if (mode === 'files' || /^[^?#]*\/([?#]|$)/.test(url)) return (await files()).openTree(urls, client, signal);
  const store = new RangeStore(urls, client);
  try {
    return { store, manifest: await store.manifest(signal) };
  } catch (error) {
    const { noRanges } = store;
    // Whole files are better than nothing, whatever the other mirrors said.
    if (!noRanges || isAbort(error)) throw error;
    if (mode === 'range') throw noRanges;
    const { openWithoutRanges } = await files().catch(() => {
      throw noRanges;
    });
    return openWithoutRanges(urls, client, signal);
  }
}
