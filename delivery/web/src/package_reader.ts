import { samePrefix, toHex } from './bytes';
import { CodecId, codecTraits, joinFragment } from './codec';
import { FormatError, InputError } from './errors';
import type { PackageData } from './fragment_list';
import type { FragmentFiles } from './fragment_files';
import { HttpClient, HttpOptions, RequestKind, RequestRecord, isAbort, nowS, sleepS } from './http';
import type { IndexHead } from './index_table';
import * as layout from './layout';
import {
  ByteRange, EntryRef, Manifest, PagedRef, mostManifestPreviews, readManifest,
} from './manifest';
import type { QualityTable } from './quality_table';
import { sha256 } from './sha256';
import { PackageForm, PackageStore, ReadOptions, StoreMode, openStore } from './store';
import type { PlaneTables, TablesHead } from './tables';
import type { TextureInfo } from './textures';

const documents = () => import('./documents');

const fragmentFilesPath = 'fragments.json';
const fragmentCount = (t: PlaneTables): number => t.columns * t.rows;
const rungCount = (t: PlaneTables): number => t.rungQuality.length;

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

const sum = (values: ArrayLike<number>, from = 0, to = values.length): number => {
  let total = 0;
  for (let i = from; i < to; ++i) total += values[i];
  return total;
};

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
  private wholeTables_?: Promise<Uint8Array>;
  private readonly tables_ = new Map<number, PlaneTables>();
  private readonly offsets_ = new Map<number, Float64Array>(); // by plane: [rung * F + fragment]

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
    const bytes: Partial<Record<RequestKind, number>> = {};
    const early: RequestRecord[] = [];
    client.onRequest = (record) => {
      bytes[record.kind] = (bytes[record.kind] ?? 0) + record.received;
      early.push(record);
    };
    const { store, manifest } = await openStore(url, options.mirrors ?? [], options.mode ?? 'auto', client, options.signal);
    const id = toHex(await sha256(manifest));
    const reader = new this(store, client, url, { parsed: readManifest(manifest), id }, openedS);
    Object.assign(reader.bytesByKind, bytes);
    reader.requests = early;
    client.onRequest = (record) => reader.noteRequest_(record);
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
    this.tables_.clear();
    this.offsets_.clear();
    this.wholeTables_ = undefined;
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
  private fail_(place: string, expected: string, found: string): never {
    throw new FormatError(this.store.name, place, expected, found);
  }
  private digestCheck_(place: string, digest: Uint8Array): (bytes: Uint8Array) => Promise<void> {
    return async (bytes) => {
      const found = await sha256(bytes);
      if (!samePrefix(found, digest)) this.fail_(place, `SHA-256 ${toHex(digest)}`, toHex(found.subarray(0, digest.length)));
    };
  }
  private readAll_(ref: EntryRef, how: ReadOptions): Promise<Uint8Array> {
    return this.store.read(ref, 0, ref.bytes, { ...how, verify: this.digestCheck_(`entry ${ref.path}`, ref.sha256) });
  }
  private async readPaged_(ref: PagedRef, how: ReadOptions): Promise<Uint8Array> {
    const bytes = await this.readAll_(ref, how);
    await this.digestCheck_(`head of ${ref.path}`, ref.headSha256)(bytes.subarray(0, ref.headBytes));
    return bytes;
  }
  private readHead_(ref: PagedRef, how: ReadOptions): Promise<Uint8Array> {
    const verify = this.digestCheck_(`head of ${ref.path}`, ref.headSha256);
    return this.store.read(ref, 0, ref.headBytes, { ...how, verify });
  }
  private requireHead_(ref: PagedRef, headBytes: number): void {
    if (ref.headBytes !== headBytes) this.fail_(`head of ${ref.path}`, `${ref.headBytes} bytes`, `${headBytes}`);
  }

  // ---- index

  /** Every entry but manifest.json and index.bin, in container order. */
  async index(): Promise<EntryRef[]> {
    const bytes = await this.readPaged_(this.manifest.index, { kind: 'index' });
    return (await documents()).readIndex(bytes);
  }

  private async loadIndexHead_(signal?: AbortSignal): Promise<IndexHead> {
    const ref = this.manifest.index;
    const small = ref.bytes <= wholeDocumentBytes || this.form !== 'range';
    const bytes = await (small ? this.readPaged_(ref, { kind: 'index', signal }) : this.readHead_(ref, { kind: 'index', signal }));
    const head = (await documents()).readIndexHead(bytes);
    this.requireHead_(ref, head.bytes);
    return head;
  }
  private async loadIndexPage_(plane: number, signal?: AbortSignal): Promise<Map<string, EntryRef>> {
    const head = await this.shared_('index', () => this.loadIndexHead_(signal), signal);
    const page = head.pages.findIndex((p) => p.plane === plane);
    const entries = new Map<string, EntryRef>();
    if (page < 0) return entries;
    const { offset, bytes } = head.pages[page];
    const { readIndexPage } = await documents();
    let read: EntryRef[] = [];
    const verify = async (got: Uint8Array): Promise<void> => void (read = await readIndexPage(head, page, got));
    await this.store.read(this.manifest.index, offset, bytes, { kind: 'index', signal, verify });
    for (const e of read) entries.set(e.path, e);
    if (plane < 0) this.checkManifestRefs_(entries);
    return entries;
  }
  private checkManifestRefs_(entries: Map<string, EntryRef>): void {
    const m = this.manifest;
    for (const ref of [m.tables, m.textures, m.quality, m.provenance, ...m.scales.map((s) => s.glb)]) {
      const e = entries.get(ref.path);
      if (!e || e.offset !== ref.offset || e.bytes !== ref.bytes || !samePrefix(e.sha256, ref.sha256))
        this.fail_(`index entry ${ref.path}`, 'what the manifest says of it', e ? 'another offset, size or digest' : 'none');
    }
  }
  /** An entry of the index, of which only the page that has it is read. */
  async find(path: string, signal?: AbortSignal): Promise<EntryRef> {
    const plane = layout.planeOfPath(path);
    const page = await this.shared_(`index/${plane}`, () => this.loadIndexPage_(plane, signal), signal);
    const entry = page.get(path);
    if (!entry) return this.fail_(`entry ${path}`, 'an entry of the index', 'none');
    return entry;
  }
  /** The bytes of an entry. */
  async entry(path: string, kind: RequestKind = 'other', signal?: AbortSignal): Promise<Uint8Array> {
    return this.readAll_(await this.find(path, signal), { kind, signal });
  }

  // ---- documents

  /** The texture planes: full-size ones first, then mips. */
  textures(signal?: AbortSignal): Promise<TextureInfo[]> {
    return this.shared_('textures', () => this.loadTextures_(signal), signal);
  }
  private async loadTextures_(signal?: AbortSignal): Promise<TextureInfo[]> {
    const m = this.manifest;
    const { fullSizePlanes, missingFeature, readTextures } = await documents();
    const textures = readTextures(await this.readAll_(m.textures, { kind: 'textures', signal }));
    if (textures.length !== m.planeCount) this.fail_(layout.texturesPath, `${m.planeCount} planes`, `${textures.length}`);
    const feature = missingFeature(textures, m.requiredFeatures);
    if (feature !== '') this.fail_('/requiredFeatures', feature, 'a codec without it');
    const full = fullSizePlanes(textures);
    const mips = m.requiredFeatures.includes('mips');
    if (mips !== full < textures.length)
      this.fail_(layout.texturesPath, mips ? 'mips, as the manifest requires' : 'no mips', `${textures.length - full}`);
    if (m.previews.length !== Math.min(full, mostManifestPreviews))
      this.fail_(layout.manifestPath, 'previews of the full-size planes', `${m.previews.length}`);
    return textures;
  }

  /** Measured quality of scales and rungs. */
  quality(signal?: AbortSignal): Promise<QualityTable> {
    const read = async (): Promise<QualityTable> => {
      const bytes = await this.readAll_(this.manifest.quality, { kind: 'quality', signal });
      return (await documents()).readQuality(bytes);
    };
    return this.shared_('quality', read, signal);
  }

  /** What the package was made from and with, as JSON. */
  async provenance(): Promise<unknown> {
    const bytes = await this.readAll_(this.manifest.provenance, { kind: 'other' });
    return JSON.parse(new TextDecoder().decode(bytes));
  }

  private async loadTablesHead_(signal?: AbortSignal): Promise<TablesHead> {
    const ref = this.manifest.tables;
    if (ref.bytes <= wholeDocumentBytes || this.form !== 'range')
      this.wholeTables_ = this.readPaged_(ref, { kind: 'tables', signal });
    const { readTablesHead } = await documents();
    const head = readTablesHead(await (this.wholeTables_ ?? this.readHead_(ref, { kind: 'tables', signal })));
    this.requireHead_(ref, head.bytes);
    if (head.planes.length !== this.manifest.planeCount)
      this.fail_(layout.tablesPath, `${this.manifest.planeCount} planes`, `${head.planes.length}`);
    const last = head.planes[head.planes.length - 1];
    const end = last ? last.offset + last.bytes : head.bytes;
    if (end !== ref.bytes) this.fail_(layout.tablesPath, `${end} bytes`, `${ref.bytes}`);
    return head;
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
    const head = await this.shared_('tables', () => this.loadTablesHead_(signal), signal);
    const wanted = [...new Set(planes ?? head.planes.keys())].sort((a, b) => a - b);
    for (const p of wanted)
      if (!(p >= 0 && p < head.planes.length))
        throw new InputError(this.store.name, `texture plane ${p}`, `one of ${head.planes.length}`, 'another');
    const read = (p: number, run: readonly number[], bytes?: Promise<Uint8Array>): Promise<PlaneTables> =>
      this.shared_(`tables/${p}`, () => this.readSection_(head, p, run[0], bytes ?? this.readRun_(head, run, signal), signal), signal);
    const missing = wanted.filter((p) => !this.once_.has(`tables/${p}`));
    for (const run of this.runsOf_(head, missing)) {
      const bytes = this.readRun_(head, run, signal);
      for (const p of run) read(p, run, bytes).catch(() => undefined); // told below
    }
    // Where another asker has cancelled, each plane by a request of its own.
    await Promise.all(wanted.map((p) => read(p, [p])));
    return head.planes.map((_, p) => this.tables_.get(p));
  }
  /** From the first byte of the run's first plane on. */
  private async readRun_(head: TablesHead, run: readonly number[], signal?: AbortSignal): Promise<Uint8Array> {
    const begin = head.planes[run[0]].offset;
    if (this.wholeTables_) return (await this.wholeTables_).subarray(begin);
    const last = head.planes[run[run.length - 1]];
    const verify = async (got: Uint8Array): Promise<void> => {
      for (const p of run) {
        const { offset, bytes, sha256: digest } = head.planes[p];
        await this.digestCheck_(`texture plane ${p}`, digest)(got.subarray(offset - begin, offset - begin + bytes));
      }
    };
    return this.store.read(this.manifest.tables, begin, last.offset + last.bytes - begin, { kind: 'tables', once: true, signal, verify });
  }
  private async readSection_(
    head: TablesHead,
    p: number,
    first: number,
    run: Promise<Uint8Array>,
    signal?: AbortSignal,
  ): Promise<PlaneTables> {
    const [{ readTablesSection }, got] = await Promise.all([documents(), run]);
    await sleepS(0); // a turn of the page for each
    const { offset, bytes } = head.planes[p];
    const begin = offset - head.planes[first].offset;
    const table = await readTablesSection(head, p, got.subarray(begin, begin + bytes));
    await this.checkPlane_(p, table, signal);
    this.tables_.set(p, table);
    return table;
  }
  private runsOf_(head: TablesHead, planes: readonly number[]): number[][] {
    const runs: number[][] = [];
    for (const p of planes) {
      const last = runs[runs.length - 1];
      const before = last && head.planes[last[last.length - 1]];
      if (before && head.planes[p].offset - before.offset - before.bytes <= gapBytes) last.push(p);
      else runs.push([p]);
    }
    return runs;
  }
  /** Tables, textures.json and index speak of the same fragments and bytes. */
  private async checkPlane_(plane: number, t: PlaneTables, signal?: AbortSignal): Promise<void> {
    const info = (await this.textures(signal))[plane];
    const place = `texture plane ${plane}`;
    const sameRungs =
      t.rungQuality.length === info.rungQuality.length && info.rungQuality.every((q, r) => q === t.rungQuality[r]);
    if (t.columns !== info.columns || t.rows !== info.rows || !sameRungs)
      this.fail_(place, 'the grid and rungs of textures.json in tables.bin', 'others');
    if (t.incremental !== codecTraits(info.codec).incremental)
      this.fail_(place, 'tables of the codec in textures.json', 'others');
    const requireSum = async (path: string, bytes: number): Promise<void> => {
      const entry = await this.find(path, signal);
      if (entry.bytes !== bytes) this.fail_(`entry ${path}`, `${bytes} bytes, as tables.bin adds up`, `${entry.bytes}`);
    };
    await requireSum(layout.tableStreamsPath(plane), sum(t.tableBytes));
    const n = fragmentCount(t);
    const offsets = new Float64Array(n * rungCount(t));
    for (let r = 0; r < rungCount(t); ++r) {
      await requireSum(layout.rungPath(plane, r), sum(t.sizeBytes, r * n, (r + 1) * n));
      let at = 0;
      for (const f of t.order) {
        offsets[r * n + f] = at;
        at += t.sizeBytes[r * n + f];
      }
    }
    this.offsets_.set(plane, offsets);
  }

  /** What decisions about textures are made from, with the tables of these planes. */
  async data(planes?: readonly number[], signal?: AbortSignal): Promise<PackageData> {
    const [textures, tables] = [await this.textures(signal), await this.tables(planes, signal)];
    return { manifest: this.manifest, textures, tables };
  }

  // ---- meshes and images

  /** Reads the range of the first picture, so that what it holds needs no further request. */
  firstPicture(how: Partial<ReadOptions> = {}): Promise<void> {
    return this.shared_('picture', () => this.loadFirstPicture_(how), how.signal);
  }
  private async loadFirstPicture_(how: Partial<ReadOptions>): Promise<void> {
    if (this.form !== 'range') return;
    const { offset, bytes, sha256: digest } = this.manifest.firstPicture;
    const verify = this.digestCheck_('first picture', digest);
    await this.store.read({ path: 'first picture', offset, bytes }, 0, bytes, { kind: 'first-picture', ...how, verify });
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
    const t = await this.planeTables(plane, signal);
    if (!(rung >= 0 && rung < rungCount(t)))
      throw new InputError(this.store.name, `texture plane ${plane}`, `a rung under ${rungCount(t)}`, `${rung}`);
    const read = (): Promise<Uint8Array> => this.entry(layout.tableStreamsPath(plane), 'texture', signal);
    const streams = await this.shared_(`streams/${plane}`, read, signal);
    const begin = sum(t.tableBytes, 0, rung);
    return streams.subarray(begin, begin + t.tableBytes[rung]);
  }

  /** Where a fragment's stream stands within its rung's entry; bytes 0 = not stored. */
  async fragmentRange(plane: number, rung: number, fragment: number): Promise<ByteRange> {
    const t = await this.planeTables(plane);
    if (!(rung >= 0 && rung < rungCount(t) && fragment >= 0 && fragment < fragmentCount(t)))
      throw new InputError(this.store.name, `texture plane ${plane}`, 'a rung and a fragment of it', `${rung}, ${fragment}`);
    const at = rung * fragmentCount(t) + fragment;
    return { offset: this.offsets_.get(plane)![at], bytes: t.sizeBytes[at] };
  }
  /** The first 8 bytes of the SHA-256 of a fragment's stream. */
  async fragmentDigest(plane: number, rung: number, fragment: number): Promise<Uint8Array> {
    const t = await this.planeTables(plane);
    const at = 8 * (rung * fragmentCount(t) + fragment);
    return t.digest.subarray(at, at + 8);
  }
  /** Tables, packs and offsets of a plane. */
  async planeFiles(plane: number, signal?: AbortSignal): Promise<PlaneFiles> {
    const tables = await this.planeTables(plane, signal);
    const paths = Array.from({ length: rungCount(tables) }, (_, r) => layout.rungPath(plane, r));
    const packs = await Promise.all(paths.map((path) => this.find(path, signal)));
    const complete = (await this.fragmentFiles(signal))?.[plane];
    return { tables, packs, offsets: this.offsets_.get(plane)!, complete };
  }
  /** What `unpack --fragments files` added to a tree; undefined where there is nothing of the kind. */
  fragmentFiles(signal?: AbortSignal): Promise<FragmentFiles | undefined> {
    return this.shared_('files', () => this.loadFragmentFiles_(signal), signal);
  }
  private async loadFragmentFiles_(signal?: AbortSignal): Promise<FragmentFiles | undefined> {
    const { store } = this;
    if (!store.extraFile) return undefined;
    // Packs do, too.
    const bytes = await store.extraFile(fragmentFilesPath, 256 << 20, { kind: 'index', signal }).catch((error: unknown) => {
      if (!(error instanceof InputError)) throw error;
      return undefined;
    });
    return bytes && (await import('./store_files')).readFragmentFiles(bytes);
  }
  /** A fragment's complete file of such a tree, digest checked. */
  async fragmentFile(plane: number, rung: number, fragment: number, signal?: AbortSignal): Promise<Uint8Array> {
    const { extension } = codecTraits((await this.textures(signal))[plane].codec);
    const path = layout.fragmentFilePath(plane, rung, fragment, extension);
    const file = (await this.planeFiles(plane, signal)).complete?.[rung]?.get(fragment);
    const verify = file && this.digestCheck_(path, file.sha256);
    const got = file && (await this.store.extraFile?.(path, file.bytes, { kind: 'texture', signal, once: true, verify }));
    return got ?? this.fail_(path, 'a file', 'none');
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
    const range = await this.fragmentRange(plane, rung, fragment);
    const pack = await this.find(layout.rungPath(plane, rung), signal);
    const place = `fragment ${fragment} of ${pack.path}`;
    if (range.bytes === 0) this.fail_(place, 'a stored fragment', 'none');
    const verify = this.digestCheck_(place, await this.fragmentDigest(plane, rung, fragment));
    return this.store.read(pack, range.offset, range.bytes, { kind: 'texture', once: this.form !== 'files', signal, verify });
  }
  /** The image file that any decoder takes: table stream and fragment joined, with the lower rungs' where needed. */
  async completeFragment(plane: number, rung: number, fragment: number, signal?: AbortSignal): Promise<Uint8Array> {
    const codec: CodecId = (await this.textures(signal))[plane].codec;
    const first = codecTraits(codec).incremental ? 0 : rung;
    const streams: Uint8Array[] = [];
    for (let r = first; r <= rung; ++r) streams.push(await this.fragment(plane, r, fragment, signal));
    return joinFragment(codec, await this.tableStream(plane, first, signal), streams);
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
    const bytes = Math.min(ref.bytes, ref.headBytes + more);
    return this.store.read({ path: layout.splitStreamPath, ...ref }, 0, bytes, { kind: 'stream', signal, verify });
  }
  /** Bytes of the vertex-split stream; whoever takes blocks of it checks them by its head. */
  async splitStream(offset: number, bytes: number, how: Partial<ReadOptions> = {}): Promise<Uint8Array> {
    const ref = this.manifest.stream;
    if (!ref) return this.fail_(layout.splitStreamPath, 'a stream of vertex splits', 'none');
    return this.store.read({ path: layout.splitStreamPath, ...ref }, offset, bytes, { kind: 'stream', once: true, ...how });
  }
}

