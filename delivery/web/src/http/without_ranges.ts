import { isValidEntryPath, manifestPath } from '../format/entry_paths';
import { FormatError, InputError, isAbort } from '../format/errors';
import { FragmentFiles, readFragmentFiles } from '../format/fragment_files';
import { bootstrapBytes } from '../format/layout';
import { ByteRange, manifestOfContainer } from '../format/manifest';
import type { HttpClient } from './client';
import { Asking, Mirror, Mirrors, retriesOf } from './mirrors';
import { GetOptions, shownUrl, whatCame } from './requests';
import type { OpenedStore, PackageStore, Place, ReadOptions } from './store';

// For servers that know no ranges, and for containers in memory; loaded with the first of them.

/** Gets a whole file; with retries, unless another mirror may have the file. */
async function getWhole(client: HttpClient, url: string, how: GetOptions,
    othersLeft: boolean): Promise<Uint8Array> {
  const mayTryAgain = retriesOf(client, how.signal);
  for (;;) {
    const a = await client.get(url, how);
    // A page for people, as of a login, begins with blanks or '<'. Files of packages begin with letters.
    const page = /html/.test(a.type) && a.body[0] < 61;
    if (a.status === 200 && a.complete && !page) return a.body;
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
        // another asker cancelled
        if (isAbort(error) && !how.signal?.aborted) return this.file_(path, maxBytes, how, reload);
        throw error;
      });
    if (!isValidEntryPath(path))
      throw new FormatError(this.name, path, 'a path within the package', '', 'K05');
    const wanted = this.mirrors_.ask(maxBytes, (m, asking) => {
      this.from_.set(path, m);
      return this.get_(m, path, maxBytes, how, { ...asking, reload });
    });
    if (how.once) return wanted;
    this.files_.set(path, wanted);
    wanted.catch(() => this.files_.delete(path));
    return wanted;
  }
  private get_(m: Mirror, path: string, maxBytes: number, { kind, signal, onBytes }: ReadOptions,
      asking: Asking): Promise<Uint8Array> {
    return getWhole(this.mirrors_.client, joinUrl(m.url, path),
      { kind, signal, onBytes, maxBytes, ...asking }, asking.othersLeft);
  }
  extraFile(path: string, maxBytes: number, how: ReadOptions): Promise<Uint8Array | undefined> {
    return this.mirrors_.ask(Math.min(maxBytes, bootstrapBytes), async (m, asking) => {
      try {
        const got = await this.get_(m, path, maxBytes, how, asking);
        await how.verify?.(got);
        return got;
      } catch (error) {
        // Extra files need not exist.
        if (!how.verify && error instanceof InputError && /^status 40[34]\b/.test(error.found))
          return undefined;
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

/** A container in memory. */
class WholeStore implements PackageStore {
  readonly form = 'whole';
  constructor(
    private bytes_: Uint8Array,
    readonly name: string,
  ) {}
  manifest(): Promise<Uint8Array> {
    return Promise.resolve(manifestOfContainer(this.bytes_.subarray(0, bootstrapBytes), this.name));
  }
  async read(place: Place, { offset, bytes }: ByteRange, how: ReadOptions): Promise<Uint8Array> {
    if (offset + bytes > this.bytes_.length)
      throw new FormatError(this.name, place.path, `${offset + bytes} bytes`, `${this.bytes_.length}`, 'K01');
    const part = this.bytes_.subarray(offset, offset + bytes);
    await how.verify?.(part);
    return part;
  }
  dispose(): void {
    this.bytes_ = new Uint8Array(0);
  }
}

/** A container that is in memory already. */
export function openBytes(bytes: Uint8Array, name: string): PackageStore {
  return new WholeStore(bytes, name);
}

/** URL of the tree of a container: https://host/a/NAME.texmesh -> https://host/a/NAME/ ; '' else. */
export function treeUrl(url: string): string {
  const m = /^([^?#]*)\.texmesh([?#].*)?$/.exec(url);
  return m ? `${m[1]}/${m[2] ?? ''}` : '';
}

async function opened(store: PackageStore, signal?: AbortSignal): Promise<OpenedStore> {
  return { store, manifest: await store.manifest(signal) };
}
const treesOf = (urls: readonly string[]): string[] => urls.map(treeUrl).filter((root) => root !== '');

/** Opens a tree by its own URL, or by the URL of the container beside the tree. */
export function openTree(urls: readonly string[], client: HttpClient,
    signal?: AbortSignal): Promise<OpenedStore> {
  const isTree = urls[0].replace(/[?#].*$/, '').endsWith('/');
  const roots = isTree ? urls : treesOf(urls);
  if (roots.length === 0)
    throw new InputError(shownUrl(urls[0]), '', 'a URL that ends in .texmesh or /, for mode files',
      'another');
  return opened(new TreeStore(roots, client), signal);
}

/** Opens the tree beside a container that ranges were read of, whose manifest must have these bytes. */
export async function openSameTree(urls: readonly string[], client: HttpClient, manifest: Uint8Array,
    signal?: AbortSignal): Promise<PackageStore> {
  const roots = treesOf(urls);
  if (roots.length === 0) throw new InputError(shownUrl(urls[0]), '', 'an answer with status 206',
    'status 200: ranges are no longer answered');
  const { store, manifest: got } = await opened(new TreeStore(roots, client), signal);
  if (got.length !== manifest.length || got.some((byte, i) => byte !== manifest[i]))
    throw new FormatError(store.name, 'manifest.json', 'the package that reading began with',
      'another: it was replaced, open it anew');
  return store;
}

/**
 * Whether a server gives no answer to a range, and one to a request for the whole file: browsers refuse a
 * compressed range, as they asked for none.
 */
export async function sendsWholeAlone(url: string, client: HttpClient,
    signal?: AbortSignal): Promise<boolean> {
  const how = { kind: 'other', signal, reload: true, maxBytes: 0 } as const;
  return (await client.get(url, how)).status === 200 &&
    (await client.get(url, { ...how, range: { offset: 0, bytes: 1 } })).status === 0;
}

/** Opens the tree beside a container, or the whole container. */
export async function openWithoutRanges(urls: readonly string[], client: HttpClient,
    signal?: AbortSignal): Promise<OpenedStore> {
  const roots = treesOf(urls);
  if (roots.length > 0) {
    try {
      const found = await opened(new TreeStore(roots, client), signal);
      if (found.manifest[0] === 0x7b) return found; // a brace: no page of the server's own
    } catch (error) {
      if (!(error instanceof InputError)) throw error;
    }
  }
  return new Mirrors(urls, client).ask(bootstrapBytes, async (m, { othersLeft, ...asking }) => {
    const how = { kind: 'other', signal, maxBytes: client.options.maxWholeBytes, ...asking } as const;
    const bytes = await getWhole(client, m.url, how, othersLeft);
    return opened(openBytes(bytes, shownUrl(m.url)), signal);
  });
}

const fragmentFilesPath = 'fragments.json';

/** See PackageReader.fragmentFiles. */
export async function readFragmentList(store: PackageStore,
    signal?: AbortSignal): Promise<FragmentFiles | undefined> {
  // A tree without the list has packs.
  const bytes = await store.extraFile?.(fragmentFilesPath, 256 << 20, { kind: 'index', signal })
      .catch((error: unknown) => {
    if (!(error instanceof InputError)) throw error;
    return undefined;
  });
  return bytes && readFragmentFiles(bytes);
}
