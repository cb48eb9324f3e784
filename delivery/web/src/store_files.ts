import { codecTraits } from './codec';
import { requireDigest } from './digests';
import { fragmentFilePath, isValidEntryPath } from './entry_paths';
import { FormatError, InputError } from './errors';
import { FragmentFiles, readFragmentFiles } from './fragment_files';
import { HttpClient, isAbort, shownUrl } from './http';
import { manifestPath } from './layout';
import { bootstrapBytes, manifestOfContainer } from './manifest';
import type { PackageReader } from './package_reader';
import type { OpenedStore, PackageStore, Place, ReadOptions } from './store';
import { Mirror, Mirrors, fromMirrors, getWhole } from './store_troubles';

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

/** Whole files of a tree, beside the container or by itself: for servers without ranges. */
export class TreeStore implements PackageStore {
  readonly form = 'files';
  private readonly files_ = new Map<string, Promise<Uint8Array>>();
  private readonly mirrors_: Mirrors;
  private readonly from_ = new Map<string, Mirror>(); // who was asked last

  constructor(
    roots: readonly string[],
    private readonly client_: HttpClient,
  ) {
    this.mirrors_ = new Mirrors(roots);
  }
  get name(): string {
    return shownUrl(this.mirrors_.all[0].url);
  }
  manifest(signal?: AbortSignal): Promise<Uint8Array> {
    return this.file_(manifestPath, bootstrapBytes, { kind: 'manifest', signal });
  }
  async read(place: Place, offset: number, bytes: number, how: ReadOptions): Promise<Uint8Array> {
    const take = async (reload: boolean): Promise<Uint8Array> => {
      const whole = await this.file_(place.path, place.bytes, how, reload);
      if (whole.length !== place.bytes)
        throw new FormatError(this.name, place.path, `${place.bytes} bytes`, `${whole.length}`);
      const part = whole.subarray(offset, offset + bytes);
      await how.verify?.(part);
      return part;
    };
    for (let again = false; ; again = true)
      try {
        return await take(again);
      } catch (error) {
        if (!(error instanceof FormatError)) throw error;
        this.files_.delete(place.path);
        // Damaged on the way, perhaps: elsewhere, or once more, past caches.
        const elsewhere = this.mirrors_.alive > 1;
        const from = this.from_.get(place.path);
        if (elsewhere && from) this.mirrors_.failed(from, 0);
        else if (again) throw error;
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
    const wanted = fromMirrors(this.mirrors_, this.client_, maxBytes, (m, patienceS) => {
      this.from_.set(path, m);
      return this.ask_(m, path, maxBytes, how, patienceS, reload);
    });
    if (how.once) return wanted;
    this.files_.set(path, wanted);
    wanted.catch(() => this.files_.delete(path));
    return wanted;
  }
  private ask_(m: Mirror, path: string, maxBytes: number, how: ReadOptions, stallTimeoutS: number, reload: boolean): Promise<Uint8Array> {
    const { kind, signal, onBytes } = how;
    const elsewhere = this.mirrors_.alive > 1;
    return getWhole(this.client_, joinUrl(m.url, path), maxBytes, { kind, signal, onBytes, reload, stallTimeoutS }, elsewhere);
  }
  extraFile(path: string, maxBytes: number, how: ReadOptions): Promise<Uint8Array | undefined> {
    return fromMirrors(this.mirrors_, this.client_, Math.min(maxBytes, bootstrapBytes), async (m, patienceS) => {
      const take = async (reload: boolean): Promise<Uint8Array> => {
        const got = await this.ask_(m, path, maxBytes, how, patienceS, reload);
        await how.verify?.(got);
        return got;
      };
      try {
        return await take(false);
      } catch (error) {
        // Nobody has to have it.
        if (!how.verify && error instanceof InputError && /^status 40[34]$/.test(error.found)) return undefined;
        if (!(error instanceof FormatError) || this.mirrors_.alive > 1) throw error;
        return take(true); // past caches
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
  async read(place: Place, offset: number, bytes: number, how: ReadOptions): Promise<Uint8Array> {
    const begin = place.offset + offset;
    if (begin + bytes > this.bytes_.length)
      throw new FormatError(this.name, place.path, `${begin + bytes} bytes`, `${this.bytes_.length}`);
    const part = this.bytes_.subarray(begin, begin + bytes);
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
  const whole = new Mirrors(urls);
  return fromMirrors(whole, client, bootstrapBytes, async (m, stallTimeoutS) => {
    const how = { kind: 'other', signal, stallTimeoutS } as const;
    const bytes = await getWhole(client, m.url, client.options.maxWholeBytes, how, whole.alive > 1);
    return opened(openBytes(bytes, shownUrl(m.url)), signal);
  });
}
