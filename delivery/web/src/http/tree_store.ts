import { codecTraits } from '../format/codec';
import { requireDigest } from '../format/digests';
import { fragmentFilePath, isValidEntryPath, manifestPath } from '../format/entry_paths';
import { FormatError, InputError } from '../format/errors';
import { FragmentFiles, readFragmentFiles } from '../format/fragment_files';
import { GetOptions, HttpClient, isAbort, shownUrl, whatCame } from './client';
import { bootstrapBytes } from '../format/layout';
import { ByteRange, manifestOfContainer } from '../format/manifest';
import { Asking, Mirror, Mirrors } from './mirrors';
import type { PackageReader } from './package_reader';
import { OpenedStore, PackageStore, Place, ReadOptions, retriesOf } from './store';

// For servers that know no ranges; loaded when one is met.

const fragmentFilesPath = 'fragments.json';

/** See PackageReader.fragmentFiles. */
export async function fragmentFiles(store: PackageStore, signal?: AbortSignal): Promise<FragmentFiles | undefined> {
  // Packs do, too.
  const bytes = await store.extraFile?.(fragmentFilesPath, 256 << 20, { kind: 'index', signal }).catch((error: unknown) => {
    if (!(error instanceof InputError)) throw error;
    return undefined;
  });
  return bytes && readFragmentFiles(bytes);
}
/** See PackageReader.fragmentFile. */
export async function fragmentFile(
  reader: PackageReader,
  plane: number,
  rung: number,
  fragment: number,
  signal?: AbortSignal,
): Promise<Uint8Array> {
  const { store } = reader;
  const { extension } = codecTraits((await reader.textures(signal))[plane].codec);
  const path = fragmentFilePath(plane, rung, fragment, extension);
  const file = (await reader.planeFiles(plane, signal)).complete?.[rung]?.get(fragment);
  if (!file || !store.extraFile) throw new FormatError(store.name, path, 'a file', 'none');
  const verify = (bytes: Uint8Array): Promise<void> => requireDigest(bytes, file.sha256, store.name, path);
  const got = await store.extraFile(path, file.bytes, { kind: 'texture', signal, once: true, verify });
  if (!got) throw new FormatError(store.name, path, 'a file', 'none');
  return got;
}

/** A whole file; with retries, unless somebody else has it. */
async function getWhole(client: HttpClient, url: string, how: GetOptions, elsewhere: boolean): Promise<Uint8Array> {
  const again = retriesOf(client, how.signal);
  for (;;) {
    const a = await client.get(url, how);
    if (a.status === 200 && a.complete) return a.body;
    if (a.tooLong) throw new InputError(shownUrl(url), '', `at most ${how.maxBytes} bytes`, 'more');
    if (elsewhere || !(await again(a))) throw new InputError(shownUrl(url), '', 'a file', whatCame(a));
  }
}

/** Whole files of a tree, beside the container or by itself: for servers without ranges. */
export class TreeStore implements PackageStore {
  readonly form = 'files';
  private readonly files_ = new Map<string, Promise<Uint8Array>>();
  private readonly mirrors_: Mirrors;
  private readonly from_ = new Map<string, Mirror>(); // who was asked last

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
          throw new FormatError(this.name, place.path, `${place.bytes} bytes`, `${whole.length}`);
        const begin = offset - place.offset;
        const part = whole.subarray(begin, begin + bytes);
        await how.verify?.(part);
        return part;
      } catch (error) {
        if (!(error instanceof FormatError)) throw error;
        this.files_.delete(place.path);
        // Damaged on the way, perhaps: elsewhere, or once more, past caches.
        const from = this.from_.get(place.path);
        if (!(from && this.mirrors_.failed(from)) && reload) throw error;
      }
  }
  /** A file of the tree; a failed one may be asked for again. */
  private file_(path: string, maxBytes: number, how: ReadOptions, reload = false): Promise<Uint8Array> {
    const known = this.files_.get(path);
    if (known)
      return known.catch((error: unknown) => {
        if (isAbort(error) && !how.signal?.aborted) return this.file_(path, maxBytes, how, reload); // another asker's
        throw error;
      });
    if (!isValidEntryPath(path)) throw new FormatError(this.name, path, 'a path within the package', 'another');
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
    return getWhole(this.mirrors_.client, joinUrl(m.url, path), { kind, signal, onBytes, maxBytes, ...asking }, asking.elsewhere);
  }
  extraFile(path: string, maxBytes: number, how: ReadOptions): Promise<Uint8Array | undefined> {
    return this.mirrors_.ask(Math.min(maxBytes, bootstrapBytes), async (m, asking) => {
      try {
        const got = await this.get_(m, path, maxBytes, how, asking);
        await how.verify?.(got);
        return got;
      } catch (error) {
        // Nobody has to have it.
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
      throw new FormatError(this.name, place.path, `${offset + bytes} bytes`, `${this.bytes_.length}`);
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

/** https://host/a/NAME.texmesh -> https://host/a/NAME/ ; '' when the URL is not of that form. */
export function treeUrl(url: string): string {
  const m = /^([^?#]*)\.texmesh([?#].*)?$/.exec(url);
  return m ? `${m[1]}/${m[2] ?? ''}` : '';
}

async function opened(store: PackageStore, signal?: AbortSignal): Promise<OpenedStore> {
  return { store, manifest: await store.manifest(signal) };
}
const treesOf = (urls: readonly string[]): string[] => urls.map(treeUrl).filter((root) => root !== '');

/** A tree, by its own URL or that of the container beside it. */
export function openTree(urls: readonly string[], client: HttpClient, signal?: AbortSignal): Promise<OpenedStore> {
  const isTree = urls[0].replace(/[?#].*$/, '').endsWith('/');
  const roots = isTree ? urls : treesOf(urls);
  if (roots.length === 0)
    throw new InputError(shownUrl(urls[0]), '', 'a URL that ends in .texmesh or /, for mode files', 'another');
  return opened(new TreeStore(roots, client), signal);
}

/** The tree beside a container, or the whole container. */
export async function openWithoutRanges(urls: readonly string[], client: HttpClient, signal?: AbortSignal): Promise<OpenedStore> {
  const roots = treesOf(urls);
  if (roots.length > 0) {
    try {
      const found = await opened(new TreeStore(roots, client), signal);
      if (found.manifest[0] === 0x7b) return found; // a brace: no page of the server's own
    } catch (error) {
      if (!(error instanceof InputError)) throw error;
    }
  }
  return new Mirrors(urls, client).ask(bootstrapBytes, async (m, { elsewhere, ...asking }) => {
    const how = { kind: 'other', signal, maxBytes: client.options.maxWholeBytes, ...asking } as const;
    const bytes = await getWhole(client, m.url, how, elsewhere);
    return opened(openBytes(bytes, shownUrl(m.url)), signal);
  });
}
