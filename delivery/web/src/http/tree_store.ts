import { isValidEntryPath, manifestPath } from '../format/entry_paths';
import { FormatError, InputError, isAbort } from '../format/errors';
import { bootstrapBytes } from '../format/layout';
import type { ByteRange } from '../format/manifest';
import type { HttpClient } from './client';
import { Asking, Mirror, Mirrors } from './mirrors';
import { GetOptions, shownUrl, whatCame } from './requests';
import { retriesOf } from './retries';
import type { PackageStore, Place, ReadOptions } from './store';

/** Gets a whole file; with retries, unless another mirror may have the file. */
export async function getWhole(client: HttpClient, url: string, how: GetOptions, othersLeft: boolean): Promise<Uint8Array> {
  const mayTryAgain = retriesOf(client, how.signal);
  for (;;) {
    const a = await client.get(url, how);
    if (a.status === 200 && a.complete) return a.body;
    if (a.tooLong) throw new InputError(shownUrl(url), '', `at most ${how.maxBytes} bytes`, 'more');
    if (othersLeft || !(await mayTryAgain(a))) throw new InputError(shownUrl(url), '', 'a file', whatCame(a));
  }
}

/** Whole files of a tree, beside the container or by itself: for servers without ranges. */
export class TreeStore implements PackageStore {
  readonly form = 'files';
  private readonly files_ = new Map<string, Promise<Uint8Array>>();
  private readonly mirrors_: Mirrors;
  private readonly from_ = new Map<string, Mirror>(); // by path: the mirror that was asked last

  constructor(roots: readonly string[], client: HttpClient) {
    this.mirrors_ = new Mirrors(roots, client);
  }
  get name(): string {
    return shownUrl(this.mirrors_.all[0].url);
  }
  manifest(signal?: AbortSignal): Promise<Uint8Array> {
    return this.file_(manifestPath, bootstrapBytes, { kind: 'manifest', signal });
  }
  async read(place: Place, { offset, bytes }: ByteRange, how: ReadOptions): Promise<Uint8Array> {
    for (let reload = false; ; reload = true)
      try {
        const whole = await this.file_(place.path, place.bytes, how, reload);
        if (whole.length !== place.bytes)
          throw new FormatError(this.name, place.path, `${place.bytes} bytes`, `${whole.length}`, 'I08');
        const begin = offset - place.offset;
        const part = whole.subarray(begin, begin + bytes);
        await how.verify?.(part);
        return part;
      } catch (error) {
        if (!(error instanceof FormatError)) throw error;
        this.files_.delete(place.path);
        // The file may be damaged on the way: it is asked for at another mirror, or once more, past caches.
        const from = this.from_.get(place.path);
        if (!(from && this.mirrors_.failed(from)) && reload) throw error;
      }
  }
  /** A file of the tree; a file that failed may be asked for again. */
  private file_(path: string, maxBytes: number, how: ReadOptions, reload = false): Promise<Uint8Array> {
    const known = this.files_.get(path);
    if (known)
      return known.catch((error: unknown) => {
        if (isAbort(error) && !how.signal?.aborted) return this.file_(path, maxBytes, how, reload); // another asker cancelled
        throw error;
      });
    if (!isValidEntryPath(path)) throw new FormatError(this.name, path, 'a path within the package', '', 'K05');
    const wanted = this.mirrors_.ask(maxBytes, (m, asking) => {
      this.from_.set(path, m);
      return this.get_(m, path, maxBytes, how, { ...asking, reload });
    });
    if (how.once) return wanted;
    this.files_.set(path, wanted);
    wanted.catch(() => this.files_.delete(path));
    return wanted;
  }
  private get_(m: Mirror, path: string, maxBytes: number, { kind, signal, onBytes }: ReadOptions, asking: Asking): Promise<Uint8Array> {
    return getWhole(this.mirrors_.client, joinUrl(m.url, path), { kind, signal, onBytes, maxBytes, ...asking }, asking.othersLeft);
  }
  extraFile(path: string, maxBytes: number, how: ReadOptions): Promise<Uint8Array | undefined> {
    return this.mirrors_.ask(Math.min(maxBytes, bootstrapBytes), async (m, asking) => {
      try {
        const got = await this.get_(m, path, maxBytes, how, asking);
        await how.verify?.(got);
        return got;
      } catch (error) {
        // Extra files need not exist.
        if (!how.verify && error instanceof InputError && /^status 40[34]$/.test(error.found)) return undefined;
        throw error;
      }
    });
  }
  dispose(): void {
    this.files_.clear();
  }
}

/** https://host/a/NAME/?query and a path beneath it; query and fragment stay behind the path. */
function joinUrl(root: string, path: string): string {
  const end = root.search(/[?#]/);
  return end < 0 ? root + path : root.slice(0, end) + path + root.slice(end);
}
