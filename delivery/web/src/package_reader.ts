import { requireDigest } from './digests';
import { FormatError, InputError } from './errors';
import type { PackageData } from './fragment_list';
import type { FragmentFiles } from './fragment_files';
import { toHex } from './bytes';
import { HttpClient, HttpOptions, RequestKind, RequestRecord, isAbort, nowS } from './http';
import * as layout from './layout';
import { ByteRange, EntryRef, Manifest, PagedRef, readManifest } from './manifest';
import type { QualityTable } from './quality_table';
import { sha256 } from './sha256';
import { PackageForm, PackageStore, ReadOptions, StoreMode, openStore } from './store';
import type { PlaneTables, TablesHead } from './tables';
import type { TextureInfo } from './textures';
import type { DocumentDecoder, Documents } from './worker_protocol';

const here = () => import('./documents');
const more = () => import('./package_more');

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
export interface PlaneFiles {
  tables: PlaneTables;
  /** By rung. */
  packs: EntryRef[];
  /** Of each fragment's stream within its rung's pack: [rung * F + fragment]. */
  offsets: Float64Array;
  /** Complete files instead of packs, where the package is a tree that has them: [rung] by fragment. */
  complete?: FragmentFiles[number];
}

/** A whole document up to so many bytes is read at once; larger ones by pages. */
const wholeDocumentBytes = 192 << 10;
/** Sections of tables closer together than this are read by one request. */
const gapBytes = 4096;

const decodeHere = (async (name, ...args: unknown[]) => ((await here())[name] as (...of: unknown[]) => unknown)(...args)) as DocumentDecoder;

/**
 * Reads a package on demand. Opening reads the manifest only; index, textures and tables are read when they are first
 * asked for, and never twice. Everything handed out has been checked: entries against their SHA-256, fragments against
 * the truncated digest in the tables, documents against each other.
 */
export class PackageReader {
  readonly manifest: Manifest;
  /** Package id: SHA-256 of the bytes of manifest.json, in hexadecimal digits. */
  readonly id: string;
  /** When the first request was made, seconds of performance.now(). */
  readonly openedS: number;
  /** Bytes received by kind. */
  readonly bytesByKind: Partial<Record<RequestKind, number>> = {};
  private readonly listeners_ = new Set<(record: RequestRecord) => void>();
  private readonly once_ = new Map<string, Promise<unknown>>();
  private readonly planes_ = new Map<number, PlaneFiles>();
  /** Who decodes documents, when it is not this thread: loads say it, which have workers. Where that fails, this thread does. */
  decodeDocument = decodeHere;

  constructor(
    readonly store: PackageStore,
    readonly client: HttpClient,
    readonly url: string,
    manifest: { parsed: Manifest; id: string },
    openedS: number,
  ) {
    this.manifest = manifest.parsed;
    this.id = manifest.id;
    this.openedS = openedS;
  }

  /** Reads the manifest of a package at a URL; see OpenOptions. */
  static async openUrl<T extends PackageReader>(
    this: new (...args: ConstructorParameters<typeof PackageReader>) => T,
    url: string,
    options: OpenOptions = {},
  ): Promise<T> {
    const client = new HttpClient(options);
    const openedS = nowS();
    const early: RequestRecord[] = [];
    client.onRequest = (record) => early.push(record);
    const { store, manifest } = await openStore(url, options.mirrors ?? [], options.mode ?? 'auto', client, options.signal);
    const id = toHex(await sha256(manifest));
    const reader = new this(store, client, url, { parsed: readManifest(manifest), id }, openedS);
    client.onRequest = (record) => reader.noteRequest_(record);
    early.forEach(client.onRequest);
    return reader;
  }

  /** Reads a container that is in memory. */
  static async openBytes<T extends PackageReader>(
    this: new (...args: ConstructorParameters<typeof PackageReader>) => T,
    bytes: Uint8Array,
    name = 'package',
  ): Promise<T> {
    const store = (await import('./store_files')).openBytes(bytes, name);
    const manifest = await store.manifest();
    const id = toHex(await sha256(manifest));
    return new this(store, new HttpClient(), name, { parsed: readManifest(manifest), id }, nowS());
  }

  /** Requests so far, those of opening included. */
  requests: RequestRecord[] = [];
  /** Calls back for every finished request; gives a function that ends it. */
  onRequest(listener: (record: RequestRecord) => void): () => void {
    this.listeners_.add(listener);
    return () => this.listeners_.delete(listener);
  }
  private noteRequest_(record: RequestRecord): void {
    this.requests.push(record);
    this.bytesByKind[record.kind] = (this.bytesByKind[record.kind] ?? 0) + record.received;
    for (const listener of this.listeners_) listener(record);
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
  private digestCheck_(place: string, digest: Uint8Array): (bytes: Uint8Array) => Promise<void> {
    return (bytes) => requireDigest(bytes, digest, this.store.name, place);
  }
  private readAll_(ref: EntryRef, how: ReadOptions): Promise<Uint8Array> {
    return this.store.read(ref, 0, ref.bytes, { ...how, verify: this.digestCheck_(`entry ${ref.path}`, ref.sha256) });
  }
  /** A document, or only its head where it is long and that can be had. */
  private readPaged_(ref: PagedRef, kind: RequestKind, signal?: AbortSignal, all = false): Promise<Uint8Array> {
    const whole = all || ref.bytes <= wholeDocumentBytes || this.form !== 'range';
    const verify = async (bytes: Uint8Array): Promise<void> => {
      await this.digestCheck_(`head of ${ref.path}`, ref.headSha256)(bytes.subarray(0, ref.headBytes));
      if (whole) await this.digestCheck_(`entry ${ref.path}`, ref.sha256)(bytes);
    };
    return this.store.read(ref, 0, whole ? ref.bytes : ref.headBytes, { kind, signal, verify });
  }
  private async decoded_<K extends keyof Documents>(
    signal: AbortSignal | undefined,
    name: K,
    ...args: Parameters<Documents[K]>
  ): Promise<Awaited<ReturnType<Documents[K]>>> {
    try {
      return await this.decodeDocument(name, ...args);
    } catch (error) {
      if (error instanceof FormatError || signal?.aborted) throw error;
      return decodeHere(name, ...args); // no workers, or those of a load that has ended
    }
  }

  // ---- index

  /** Every entry but manifest.json and index.bin, in container order. */
  async index(): Promise<EntryRef[]> {
    return decodeHere('readIndex', await this.readPaged_(this.manifest.index, 'index', undefined, true));
  }

  /** Read and decoded once for all who ask. */
  private document_<K extends 'indexHead' | 'tablesHead' | 'textures' | 'quality'>(
    name: K,
    read: () => Promise<Uint8Array>,
    signal?: AbortSignal,
  ): Promise<Awaited<ReturnType<Documents[K]>>> {
    const decoded = async (): Promise<Awaited<ReturnType<Documents[K]>>> =>
      this.decoded_(signal, name, ...([await read(), this.manifest] as Parameters<Documents[K]>));
    return this.shared_(name, decoded, signal);
  }
  private async loadIndexPage_(plane: number, signal?: AbortSignal): Promise<Map<string, EntryRef>> {
    const { manifest } = this;
    const { pages, minor } = await this.document_('indexHead', () => this.readPaged_(manifest.index, 'index', signal), signal);
    const page = pages.find((p) => p.plane === plane);
    if (!page) return new Map();
    const verify = this.digestCheck_(`index of plane ${plane}`, page.sha256);
    const bytes = await this.store.read(manifest.index, page.offset, page.bytes, { kind: 'index', signal, verify });
    return this.decoded_(signal, 'indexPage', bytes, plane, page.entries, minor, manifest);
  }
  private indexPage_(plane: number, signal?: AbortSignal): Promise<Map<string, EntryRef>> {
    return this.shared_(`index/${plane}`, () => this.loadIndexPage_(plane, signal), signal);
  }
  /** An entry of the index, of which only the page that has it is read. */
  async find(path: string, signal?: AbortSignal): Promise<EntryRef> {
    const entry = (await this.indexPage_(layout.planeOfPath(path), signal)).get(path);
    if (!entry) throw new FormatError(this.store.name, `entry ${path}`, 'an entry of the index', 'none');
    return entry;
  }
  /** The bytes of an entry. */
  async entry(path: string, kind: RequestKind = 'other', signal?: AbortSignal): Promise<Uint8Array> {
    return this.readAll_(await this.find(path, signal), { kind, signal });
  }

  // ---- documents

  /** The texture planes: full-size ones first, then mips. */
  textures(signal?: AbortSignal): Promise<TextureInfo[]> {
    return this.document_('textures', () => this.readAll_(this.manifest.textures, { kind: 'textures', signal }), signal);
  }

  /** Measured quality of scales and rungs. */
  quality(signal?: AbortSignal): Promise<QualityTable> {
    return this.document_('quality', () => this.readAll_(this.manifest.quality, { kind: 'quality', signal }), signal);
  }

  /** What the package was made from and with, as JSON. */
  async provenance(): Promise<unknown> {
    const bytes = await this.readAll_(this.manifest.provenance, { kind: 'other' });
    return JSON.parse(new TextDecoder().decode(bytes));
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
    const head = await this.document_('tablesHead', () => this.readPaged_(this.manifest.tables, 'tables', signal), signal);
    const wanted = [...new Set(planes ?? head.planes.keys())].sort((a, b) => a - b);
    for (const p of wanted)
      if (!head.planes[p]) throw new InputError(this.store.name, `texture plane ${p}`, `one of ${head.planes.length}`, 'another');
    const read = (p: number, run: readonly number[], bytes?: Promise<Uint8Array>): Promise<PlaneFiles> =>
      this.shared_(`tables/${p}`, () => this.readSection_(head, p, run[0], bytes ?? this.readRun_(head, run, signal), signal), signal);
    const missing = wanted.filter((p) => !this.once_.has(`tables/${p}`));
    for (const run of this.runsOf_(head, missing)) {
      const bytes = this.readRun_(head, run, signal);
      for (const p of run) read(p, run, bytes).catch(() => undefined); // told below
    }
    // Where another asker has cancelled, each plane by a request of its own.
    await Promise.all(wanted.map((p) => read(p, [p])));
    return head.planes.map((_, p) => this.planes_.get(p)?.tables);
  }
  /** From the first byte of the run's first plane on. */
  private readRun_({ planes }: TablesHead, run: readonly number[], signal?: AbortSignal): Promise<Uint8Array> {
    const begin = planes[run[0]].offset;
    const last = planes[run[run.length - 1]];
    const verify = async (got: Uint8Array): Promise<void> => {
      for (const p of run) {
        const { offset, bytes, sha256: digest } = planes[p];
        await this.digestCheck_(`texture plane ${p}`, digest)(got.subarray(offset - begin, offset - begin + bytes));
      }
    };
    return this.store.read(this.manifest.tables, begin, last.offset + last.bytes - begin, { kind: 'tables', once: true, signal, verify });
  }
  private async readSection_(
    { planes, minor }: TablesHead,
    p: number,
    first: number,
    run: Promise<Uint8Array>,
    signal?: AbortSignal,
  ): Promise<PlaneFiles> {
    const begin = planes[p].offset - planes[first].offset;
    const [got, textures, entries] = await Promise.all([run, this.textures(signal), this.indexPage_(p, signal)]);
    const { tables, offsets } = await this.decoded_(signal, 'planeTables', got.subarray(begin, begin + planes[p].bytes), p, minor, textures[p], entries);
    const packs = Array.from(tables.rungQuality, (_, r) => entries.get(layout.rungPath(p, r))!);
    const files = { tables, packs, offsets };
    this.planes_.set(p, files);
    return files;
  }
  private runsOf_({ planes }: TablesHead, wanted: readonly number[]): number[][] {
    const runs: number[][] = [];
    let end = -Infinity;
    for (const p of wanted) {
      const { offset, bytes } = planes[p];
      if (offset - end <= gapBytes) runs[runs.length - 1].push(p);
      else runs.push([p]);
      end = offset + bytes;
    }
    return runs;
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
    return this.readAll_(s.glb, { kind: 'mesh', once: true, ...how });
  }
  /** preview/PPP.jpg of a full-size plane. */
  async preview(plane: number, signal?: AbortSignal): Promise<Uint8Array> {
    const range = this.manifest.previews[plane];
    const path = layout.previewPath(plane);
    // The first picture's digest covers its parts.
    const picture = this.once_.get('picture');
    if (range && this.form === 'range' && picture) {
      await picture;
      return this.store.read({ path, ...range }, 0, range.bytes, { kind: 'preview', signal });
    }
    return this.entry(path, 'preview', signal);
  }
  /** What the fragments of a rung have in common. */
  async tableStream(plane: number, rung: number, signal?: AbortSignal): Promise<Uint8Array> {
    const { tableBytes } = await this.planeTables(plane, signal);
    if (!(rung in tableBytes))
      throw new InputError(this.store.name, `texture plane ${plane}`, `a rung under ${tableBytes.length}`, `${rung}`);
    const read = (): Promise<Uint8Array> => this.entry(layout.tableStreamsPath(plane), 'texture', signal);
    const streams = await this.shared_(`streams/${plane}`, read, signal);
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
    return this.shared_('files', async () => (await import('./store_files')).fragmentFiles(this.store, signal), signal);
  }
  /** A fragment's complete file of such a tree, digest checked. */
  async fragmentFile(plane: number, rung: number, fragment: number, signal?: AbortSignal): Promise<Uint8Array> {
    return (await import('./store_files')).fragmentFile(this, plane, rung, fragment, signal);
  }

  /** Reads index, tables, textures.json and quality.json by one request, where they are small; false where not. */
  async prefetchDocuments(signal?: AbortSignal): Promise<boolean> {
    const { index, tables, textures, quality } = this.manifest;
    const bytes = quality.offset + quality.bytes - index.offset;
    if (bytes > wholeDocumentBytes || bytes <= 0) return false;
    if (this.form !== 'range') return true;
    const verify = async (got: Uint8Array): Promise<void> => {
      for (const { path, offset, bytes: size, sha256: digest } of [index, tables, textures, quality])
        await this.digestCheck_(`entry ${path}`, digest)(got.subarray(offset - index.offset).subarray(0, size));
    };
    await this.store.read({ path: 'documents', offset: index.offset, bytes }, 0, bytes, { kind: 'tables', signal, verify });
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
    return (await this.splitStreamStart(0, signal))?.subarray(0, this.manifest.stream!.headBytes);
  }
  /** The head and so many bytes behind it (or all there are); the head is checked. */
  async splitStreamStart(more: number, signal?: AbortSignal): Promise<Uint8Array | undefined> {
    const ref = this.manifest.stream;
    if (!ref) return undefined;
    const check = this.digestCheck_(`head of ${layout.splitStreamPath}`, ref.headSha256);
    const verify = (got: Uint8Array): Promise<void> => check(got.subarray(0, ref.headBytes));
    return this.splitStream(0, Math.min(ref.bytes, ref.headBytes + more), { once: false, signal, verify });
  }
  /** Bytes of the vertex-split stream; whoever takes blocks of it checks them by its head. */
  async splitStream(offset: number, bytes: number, how: Partial<ReadOptions> = {}): Promise<Uint8Array> {
    const ref = this.manifest.stream;
    if (!ref) throw new FormatError(this.store.name, layout.splitStreamPath, 'a stream of vertex splits', 'none');
    return this.store.read({ path: layout.splitStreamPath, ...ref }, offset, bytes, { kind: 'stream', once: true, ...how });
  }
}
