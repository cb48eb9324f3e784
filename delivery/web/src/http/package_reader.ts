import { requireDigest } from '../format/digests';
import { FormatError, InputError } from '../format/errors';
import type { PackageData } from '../decide/fragment_list';
import type { FragmentFiles } from '../format/fragment_files';
import { HttpClient, HttpOptions, RequestKind, RequestRecord, abortError, isAbort, nowS, throwIfAborted } from './client';
import * as layout from '../format/layout';
import type { PlaneDocument } from '../format/documents';
import type { ByteRange, EntryRef, Manifest, PagedRef, StreamRef } from '../format/manifest';
import type { QualityTable } from '../format/quality_table';
import { PackageForm, PackageStore, Place, ReadOptions, StoreMode, openStore } from './store';
import type { PlaneTables } from '../format/tables';
import type { TextureInfo } from '../format/textures';
import type { DocumentDecoder, Documents } from '../worker/protocol';

const here = () => import('../format/documents');
const more = () => import('./rare_reads');

/** Of a package's opening. */
export interface OpenOptions extends Partial<HttpOptions> {
  /**
   * range: byte ranges of the container, nothing else. files: the tree beside the container. auto: ranges, and the tree
   * (or at last the whole container) where the server answers 200 to a range.
   */
  mode?: StoreMode;
  /** Further URLs of the same container. */
  mirrors?: readonly string[];
  signal?: AbortSignal;
}

/** Where the fragments of a plane are. */
export interface PlaneFiles extends PlaneDocument {
  /** Complete files instead of packs, where the package is a tree that has them: [rung] by fragment. */
  complete?: FragmentFiles[number];
}

/** A whole document up to so many bytes is read at once; larger ones by pages. */
const wholeDocumentBytes = 192 << 10;
/** Sections of tables closer together than this are read by one request. */
const gapBytes = 4096;

type Decoded<K extends keyof Documents> = Awaited<ReturnType<Documents[K]>>;
const headOf = ({ path, offset, headBytes, headSha256 }: StreamRef): EntryRef => ({ path: `head of ${path}`, offset, bytes: headBytes, sha256: headSha256 });
/** Decodes documents on this thread. */
export const decodeHere = (async (name, ...args: unknown[]) => ((await here())[name] as (...of: unknown[]) => unknown)(...args)) as DocumentDecoder;
/** Elsewhere; on this thread where that fails or does not answer: there are no workers, or those of a load that has ended. */
async function decoded<K extends keyof Documents>(
  decoder: DocumentDecoder,
  { options }: HttpClient,
  signal: AbortSignal | undefined,
  name: K,
  ...args: Parameters<Documents[K]>
): Promise<Decoded<K>> {
  throwIfAborted(signal);
  let over = (): void => undefined;
  const late = new Promise<never>((_, fail) => {
    const cancel = (): void => fail(abortError());
    const timer = setTimeout(cancel, 1000 * options.stallTimeoutS);
    signal?.addEventListener('abort', cancel);
    over = () => {
      clearTimeout(timer);
      signal?.removeEventListener('abort', cancel);
    };
  });
  try {
    const result = await Promise.race([decoder(name, ...args), late]);
    throwIfAborted(signal);
    return result;
  } catch (error) {
    if (error instanceof FormatError || signal?.aborted) throw error;
    return decodeHere(name, ...args);
  } finally {
    over();
  }
}

/**
 * Reads a package on demand. Opening reads the manifest only; index, textures and tables are read when they are first
 * asked for, and never twice. Everything handed out has been checked: entries against their SHA-256, fragments against
 * the truncated digest in the tables, documents against each other.
 */
export class PackageReader {
  private readonly once_ = new Map<string, Promise<unknown>>();
  private readonly planes_ = new Map<number, PlaneDocument>();

  constructor(
    readonly store: PackageStore,
    readonly client: HttpClient,
    readonly url: string,
    readonly manifest: Manifest,
    /** Package id: SHA-256 of the bytes of manifest.json, in hexadecimal digits. */
    readonly id: string,
    /** When the first request was made, seconds of performance.now(). */
    readonly openedS: number,
    /** Who decodes documents: loads have workers that do. Where that fails, this thread does. */
    public decodeDocument = decodeHere,
  ) {}

  /** Reads the manifest of a package at a URL; see OpenOptions. */
  static async openUrl<T extends PackageReader>(
    this: new (...args: ConstructorParameters<typeof PackageReader>) => T,
    url: string,
    options: OpenOptions = {},
    decoder = decodeHere,
  ): Promise<T> {
    const client = new HttpClient(options);
    const { signal, mode = 'auto', mirrors = [] } = options;
    const openedS = nowS();
    const { store, manifest } = await openStore(url, mirrors, mode, client, signal);
    const { parsed, id } = await decoded(decoder, client, signal, 'manifest', manifest, store.form === 'range' ? store.name : '');
    return new this(store, client, url, parsed, id, openedS, decoder);
  }

  /** Reads a container that is in memory. */
  static async openBytes<T extends PackageReader>(
    this: new (...args: ConstructorParameters<typeof PackageReader>) => T,
    bytes: Uint8Array,
    name = 'package',
  ): Promise<T> {
    const store = (await import('./tree_store')).openBytes(bytes, name);
    const { parsed, id } = await decodeHere('manifest', await store.manifest());
    return new this(store, new HttpClient(), name, parsed, id, nowS());
  }

  /** Requests so far, those of opening included. */
  get requests(): readonly RequestRecord[] {
    return this.client.records;
  }
  /** Bytes received by kind. */
  get bytesByKind(): Partial<Record<RequestKind, number>> {
    const bytes: Partial<Record<RequestKind, number>> = {};
    for (const { kind, received } of this.requests) bytes[kind] = (bytes[kind] ?? 0) + received;
    return bytes;
  }
  /** Calls back for every finished request; gives a function that ends it. */
  onRequest(listener: (record: RequestRecord) => void): () => void {
    const { listeners } = this.client;
    listeners.add(listener);
    return () => listeners.delete(listener);
  }

  /** How the bytes come: ranges of the container, files of a tree, or one whole container. */
  get form(): PackageForm {
    return this.store.form;
  }
  /** Forgets what was read. Loads of this package must be disposed of on their own. */
  dispose(): void {
    this.store.dispose();
    this.once_.clear();
    this.planes_.clear();
    this.decodeDocument = decodeHere;
  }

  /** Read once for all who ask; again after a failure, or where it was another asker who cancelled. */
  private async shared_<T>(name: string, read: () => Promise<T>, signal?: AbortSignal): Promise<T> {
    const known = this.once_.get(name) as Promise<T> | undefined;
    const wanted = known ?? read();
    if (!known) {
      this.once_.set(name, wanted);
      wanted.catch(() => this.once_.get(name) === wanted && this.once_.delete(name));
    }
    try {
      return await wanted;
    } catch (error) {
      if (known && isAbort(error) && !signal?.aborted) return this.shared_(name, read, signal);
      throw error;
    }
  }
  /** A range of the container within an entry; of what comes, these parts are held to their digests. */
  private read_(place: Place, range: ByteRange, how: ReadOptions, ...parts: EntryRef[]): Promise<Uint8Array> {
    const verify = async (got: Uint8Array): Promise<void> => {
      for (const { path, offset, bytes, sha256 } of parts)
        await requireDigest(got.subarray(offset - range.offset).subarray(0, bytes), sha256, this.store.name, path);
    };
    return this.store.read(place, range, { ...how, verify });
  }
  /** An entry, or a part of one. */
  readChecked(part: EntryRef, how: ReadOptions, place: Place = part): Promise<Uint8Array> {
    return this.read_(place, part, how, part);
  }
  /** A document, or only its head where it is long and that can be had. */
  private readPaged_(ref: PagedRef, how: ReadOptions): Promise<Uint8Array> {
    const part = ref.bytes <= wholeDocumentBytes || this.form !== 'range' ? ref : headOf(ref);
    return this.read_(ref, part, how, headOf(ref), part);
  }
  /** A document, read and decoded once for all who ask. */
  private document_<K extends 'indexPages' | 'tableSections' | 'textures' | 'quality'>(
    name: K,
    signal: AbortSignal | undefined,
    read: (m: Manifest) => Promise<Uint8Array>,
  ): Promise<Decoded<K>> {
    const { manifest } = this;
    const decode = (bytes: Uint8Array) => this.decoded(signal, name, ...([bytes, manifest] as Parameters<Documents[K]>));
    return this.shared_(name, () => read(manifest).then(decode), signal);
  }
  /** Decodes or checks by a function of documents.ts. */
  decoded<K extends keyof Documents>(signal: AbortSignal | undefined, name: K, ...args: Parameters<Documents[K]>): Promise<Decoded<K>> {
    return decoded(this.decodeDocument, this.client, signal, name, ...args);
  }

  // ---- index

  /** Every entry but manifest.json and index.bin, in container order. */
  async index(): Promise<EntryRef[]> {
    return (await more()).readIndex(this);
  }
  /** Entries of a plane by their paths; plane -1: of none. */
  private indexPage_(plane: number, signal?: AbortSignal): Promise<Map<string, EntryRef>> {
    const how = { kind: 'index', signal } as const;
    const read = async (): Promise<Map<string, EntryRef>> => {
      const { index } = this.manifest;
      const pages = await this.document_('indexPages', signal, () => this.readPaged_(index, how));
      const page = pages.find((p) => p.plane === plane);
      return page ? this.decoded(signal, 'indexPage', await this.readChecked(page, how, index), page, this.manifest) : new Map();
    };
    return this.shared_(`index/${plane}`, read, signal);
  }
  /** An entry of the index, of which only the page that has it is read. */
  async find(path: string, signal?: AbortSignal): Promise<EntryRef> {
    return (await more()).find(this, path, signal);
  }
  /** An entry of that page of the index: of a plane, or (-1) of none. */
  async findOn(plane: number, path: string, signal?: AbortSignal): Promise<EntryRef> {
    const entry = (await this.indexPage_(plane, signal)).get(path);
    if (!entry) throw new FormatError(this.store.name, path, 'an entry of the index', 'none');
    return entry;
  }
  /** The bytes of an entry. */
  async entry(path: string, kind: RequestKind = 'other', signal?: AbortSignal): Promise<Uint8Array> {
    return this.readChecked(await this.find(path, signal), { kind, signal });
  }

  // ---- documents

  /** The texture planes: full-size ones first, then mips. */
  textures(signal?: AbortSignal): Promise<TextureInfo[]> {
    return this.document_('textures', signal, (m) => this.readChecked(m.textures, { kind: 'textures', signal }));
  }

  /** Measured quality of scales and rungs. */
  quality(signal?: AbortSignal): Promise<QualityTable> {
    return this.document_('quality', signal, (m) => this.readChecked(m.quality, { kind: 'quality', signal }));
  }

  /** What the package was made from and with, as JSON. */
  async provenance(): Promise<unknown> {
    return (await more()).readProvenance(this);
  }

  /** Tables of one plane. */
  async planeTables(plane: number, signal?: AbortSignal): Promise<PlaneTables> {
    return (await this.tables([plane], signal))[plane]!;
  }

  /**
   * Tables by plane number: of these planes (and of those read before), or of all. Sections that stand together are
   * read by one request.
   */
  async tables(planes?: readonly number[], signal?: AbortSignal): Promise<(PlaneTables | undefined)[]> {
    const { tables } = this.manifest;
    const how = { kind: 'tables', signal } as const;
    const sections = await this.document_('tableSections', signal, () => this.readPaged_(tables, how));
    const wanted = [...new Set(planes ?? sections.keys())].sort((a, b) => a - b);
    let last = { offset: 0, bytes: -Infinity };
    const reads = wanted.map((p) => {
      const section = sections[p];
      if (!section) throw new InputError(this.store.name, `texture plane ${p}`, `one of ${sections.length}`, 'another');
      let run: ByteRange = { offset: section.offset, bytes: section.bytes };
      if (!this.once_.has(`tables/${p}`)) {
        if (run.offset - last.offset - last.bytes <= gapBytes) {
          last.bytes = run.offset + run.bytes - last.offset;
          run = last;
        }
        last = run;
      }
      const bytes = async (): Promise<Uint8Array> => {
        await this.shared_(`tables/${run.offset}+${run.bytes}`, () => this.store.read(tables, run, how), signal);
        return this.readChecked(section, how, tables);
      };
      const read = async (): Promise<void> => {
        const [got, textures, entries] = await Promise.all([bytes(), this.textures(signal), this.indexPage_(p, signal)]);
        this.planes_.set(p, await this.decoded(signal, 'planeTables', got, section, p, textures[p], entries));
      };
      return () => this.shared_(`tables/${p}`, read, signal);
    });
    await Promise.all(reads.map((read) => read()));
    return sections.map((_, p) => this.planes_.get(p)?.tables);
  }

  /** What decisions about textures are made from, with the tables of these planes. */
  async data(planes?: readonly number[], signal?: AbortSignal): Promise<PackageData> {
    const [textures, tables] = [await this.textures(signal), await this.tables(planes, signal)];
    return { manifest: this.manifest, textures, tables };
  }

  // ---- meshes and images

  /** Reads the range of the first picture, so that what it holds needs no further request. */
  firstPicture(how: Partial<ReadOptions> = {}): Promise<void> {
    return this.shared_('picture', async () => (await more()).readFirstPicture(this, how), how.signal);
  }
  /** The GLB of a scale; needs no index. */
  async scaleGlb(scale: number, how: Partial<ReadOptions> = {}): Promise<Uint8Array> {
    const s = this.manifest.scales.find((k) => k.scale === scale);
    if (!s) throw new InputError(this.store.name, `scale ${scale}`, 'a scale of the package', 'none');
    return this.readChecked(s.glb, { kind: 'mesh', once: true, ...how });
  }
  /** preview/PPP.jpg of a full-size plane. */
  async preview(plane: number, signal?: AbortSignal): Promise<Uint8Array> {
    const read = async (): Promise<Uint8Array> => this.readChecked(await this.findOn(-1, layout.previewPath(plane), signal), { kind: 'preview', signal });
    return this.shared_(`preview/${plane}`, read, signal);
  }
  /** See firstPicture. */
  keepPreview(plane: number, bytes: Uint8Array): void {
    this.once_.set(`preview/${plane}`, Promise.resolve(bytes));
  }
  /** What the fragments of a rung have in common. */
  async tableStream(plane: number, rung: number, signal?: AbortSignal): Promise<Uint8Array> {
    const { tableBytes } = await this.planeTables(plane, signal);
    const { tableStreams } = this.planes_.get(plane)!;
    const streams = await this.shared_(`streams/${plane}`, () => this.readChecked(tableStreams, { kind: 'texture', signal }), signal);
    if (!(rung in tableBytes)) throw new InputError(this.store.name, `texture plane ${plane}`, `a rung under ${tableBytes.length}`, `${rung}`);
    const begin = tableBytes.subarray(0, rung).reduce((sum, n) => sum + n, 0);
    return streams.subarray(begin, begin + tableBytes[rung]);
  }

  /** Where a fragment's stream stands within its rung's entry; bytes 0 = not stored. */
  async fragmentRange(plane: number, rung: number, fragment: number): Promise<ByteRange> {
    return (await more()).fragmentRange(this, plane, rung, fragment);
  }
  /** The first 8 bytes of the SHA-256 of a fragment's stream. */
  async fragmentDigest(plane: number, rung: number, fragment: number): Promise<Uint8Array> {
    return (await more()).fragmentDigest(this, plane, rung, fragment);
  }
  /** Tables, packs and offsets of a plane. */
  async planeFiles(plane: number, signal?: AbortSignal): Promise<PlaneFiles> {
    await this.tables([plane], signal);
    return { ...this.planes_.get(plane)!, complete: (await this.fragmentFiles(signal))?.[plane] };
  }
  /** What `unpack --fragments files` added to a tree; undefined where there is nothing of the kind. */
  async fragmentFiles(signal?: AbortSignal): Promise<FragmentFiles | undefined> {
    if (this.form !== 'files') return undefined;
    return this.shared_('files', async () => (await import('./tree_store')).fragmentFiles(this.store, signal), signal);
  }
  /** A fragment's complete file of such a tree, digest checked. */
  async fragmentFile(plane: number, rung: number, fragment: number, signal?: AbortSignal): Promise<Uint8Array> {
    return (await import('./tree_store')).fragmentFile(this, plane, rung, fragment, signal);
  }

  /** Reads index, tables, textures.json and quality.json by one request, where they are small; false where not. */
  async prefetchDocuments(signal?: AbortSignal): Promise<boolean> {
    const { index, quality } = this.manifest;
    const bytes = quality.offset + quality.bytes - index.offset;
    if (bytes > wholeDocumentBytes || bytes <= 0) return false;
    // Whoever takes a document of it holds it to its digest.
    if (this.form === 'range') await this.store.read(index, { offset: index.offset, bytes }, { kind: 'tables', signal });
    return true;
  }

  /** A fragment's stream at a rung, digest checked. */
  async fragment(plane: number, rung: number, fragment: number, signal?: AbortSignal): Promise<Uint8Array> {
    return (await more()).fragment(this, plane, rung, fragment, signal);
  }
  /** The image file that any decoder takes: table stream and fragment joined, with the lower rungs' where needed. */
  async completeFragment(plane: number, rung: number, fragment: number, signal?: AbortSignal): Promise<Uint8Array> {
    return (await more()).completeFragment(this, plane, rung, fragment, signal);
  }

  /** Head of the vertex-split stream; undefined when the package has none. */
  async splitStreamHead(signal?: AbortSignal): Promise<Uint8Array | undefined> {
    return (await more()).splitStreamHead(this, signal);
  }
  /** The head and so many bytes behind it (or all there are); the head is checked. */
  async splitStreamStart(more: number, signal?: AbortSignal): Promise<Uint8Array | undefined> {
    const { stream: s } = this.manifest;
    return s && this.read_(s, { offset: s.offset, bytes: Math.min(s.bytes, s.headBytes + more) }, { kind: 'stream', signal }, headOf(s));
  }
  /** Bytes of the vertex-split stream; InputError where there is none. Whoever takes blocks of it checks them by its head. */
  async splitStream(offset: number, bytes: number, how: Partial<ReadOptions> = {}): Promise<Uint8Array> {
    const { stream } = this.manifest;
    if (!stream) throw new InputError(this.store.name, '', 'a stream of vertex splits', 'none');
    return this.store.read(stream, { offset: stream.offset + offset, bytes }, { kind: 'stream', once: true, ...how });
  }
}
