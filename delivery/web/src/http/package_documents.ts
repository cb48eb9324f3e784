import type { About } from '../format/about';
import { type DocumentDecoder, type Documents, decodeHere } from '../format/document_decoder';
import type { PlaneDocument } from '../format/documents';
import { planeOfPath } from '../format/entry_paths';
import { FormatError, InputError, abortError, isAbort, throwIfAborted } from '../format/errors';
import type { FragmentFiles } from '../format/fragment_files';
import type { ByteRange, EntryRef, Manifest, PagedRef, StreamRef } from '../format/manifest';
import { type QualityTable, requireGroups } from '../format/quality_table';
import { requireDigest } from '../format/sha256';
import type { PackageData, PlaneTables } from '../format/tables';
import type { TextureInfo } from '../format/textures';
import type { HttpClient } from './client';
import type { RequestKind } from './requests';
import type { PackageForm, PackageStore, Place, ReadOptions } from './store';

/** Result of a function of format/documents. */
export type Decoded<K extends keyof Documents> = Awaited<ReturnType<Documents[K]>>;

/** Rejects after so many seconds, or when a signal says so; `clear` ends the waiting. */
function lateness(mostS: number, signal?: AbortSignal): { late: Promise<never>; clear(): void } {
  let clear = (): void => undefined;
  const late = new Promise<never>((_, fail) => {
    const cancel = (): void => fail(abortError());
    const timer = setTimeout(cancel, 1000 * mostS);
    signal?.addEventListener('abort', cancel);
    clear = () => {
      clearTimeout(timer);
      signal?.removeEventListener('abort', cancel);
    };
  });
  return { late, clear: () => clear() };
}

/** A document by `decoder`, or on this thread where `decoder` fails or does not answer in time. */
export async function decodeWith<K extends keyof Documents>(
  decoder: DocumentDecoder,
  mostS: number,
  signal: AbortSignal | undefined,
  name: K,
  ...args: Parameters<Documents[K]>
): Promise<Decoded<K>> {
  throwIfAborted(signal);
  const { late, clear } = lateness(mostS, signal);
  try {
    const result = await Promise.race([decoder(name, ...args), late]);
    throwIfAborted(signal);
    return result;
  } catch (error) {
    if (error instanceof FormatError || signal?.aborted) throw error;
    return decodeHere(name, ...args);
  } finally {
    clear();
  }
}

/** Places of the fragments of a plane. */
export interface PlaneFiles extends PlaneDocument {
  /** Complete files instead of packs, where the package is a tree that has them: [rung] by fragment. */
  complete?: FragmentFiles[number];
}

/** A whole document up to so many bytes is read at once; larger ones by pages. */
const wholeDocumentBytes = 192 << 10;
/** Sections of tables closer together than this are read by one request. */
const gapBytes = 4096;
/** The page of the index with the entries of no plane. */
const noPlane = -1;

/** The head of a document or stream as an entry of its own. */
const headOf = ({ path, offset, headBytes, headSha256 }: StreamRef): EntryRef =>
  ({ path: `head of ${path}`, offset, bytes: headBytes, sha256: headSha256, rule: 'R02' });

/**
 * The documents of a package, each read when it is first asked for, and never twice. Everything handed out
 * has been checked: entries against their SHA-256, documents against each other.
 */
export class PackageDocuments {
  private readonly reads_ = new Map<string, Promise<unknown>>();
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
    /** Decoder of documents: loads have workers. Where the decoder fails, this thread decodes. */
    public decodeDocument = decodeHere,
  ) {}

  /** How the bytes come: ranges of the container, files of a tree, or one whole container. */
  get form(): PackageForm {
    return this.store.form;
  }
  /** Forgets what was read. Loads of this package must be disposed of on their own. */
  dispose(): void {
    this.store.dispose();
    this.reads_.clear();
    this.planes_.clear();
    this.decodeDocument = decodeHere;
  }

  // ---- reading once, and checking

  /** Reads once for all who ask; again after a failure, or where another asker cancelled. */
  protected async readOnce_<T>(name: string, read: () => Promise<T>, signal?: AbortSignal): Promise<T> {
    const known = this.reads_.get(name) as Promise<T> | undefined;
    const wanted = known ?? read();
    if (!known) {
      this.keepRead_(name, wanted);
      wanted.catch(() => this.reads_.get(name) === wanted && this.reads_.delete(name));
    }
    try {
      return await wanted;
    } catch (error) {
      if (known && isAbort(error) && !signal?.aborted) return this.readOnce_(name, read, signal);
      throw error;
    }
  }
  /** readOnce_ gives this under that name from now on. */
  protected keepRead_(name: string, read: Promise<unknown>): void {
    this.reads_.set(name, read);
  }
  /** Reads a range of the container within an entry; these parts of the range are held to their digests. */
  protected readParts_(place: Place, range: ByteRange, how: ReadOptions,
      ...parts: EntryRef[]): Promise<Uint8Array> {
    const verify = async (got: Uint8Array): Promise<void> => {
      for (const { path, offset, bytes, sha256, rule } of parts)
        await requireDigest(got.subarray(offset - range.offset).subarray(0, bytes), sha256, this.store.name,
          path, rule);
    };
    return this.store.read(place, range, { ...how, verify });
  }
  /** Reads an entry, or a part of one, and checks the digest. */
  readChecked(part: EntryRef, how: ReadOptions, place: Place = part): Promise<Uint8Array> {
    return this.readParts_(place, part, how, part);
  }
  /** Reads the first bytes of an entry with a head; the head, which must be among these bytes, is checked. */
  protected readWithHead_(ref: StreamRef, bytes: number, how: ReadOptions): Promise<Uint8Array> {
    return this.readParts_(ref, { offset: ref.offset, bytes }, how, headOf(ref));
  }
  /** Reads a document, or only the head of a long one where ranges can be had. */
  private readPaged_(ref: PagedRef, how: ReadOptions): Promise<Uint8Array> {
    const part = ref.bytes <= wholeDocumentBytes || this.form !== 'range' ? ref : headOf(ref);
    return this.readParts_(ref, part, how, headOf(ref), part);
  }
  /** Reads and decodes a document once for all who ask. */
  private document_<K extends 'indexPages' | 'tableSections' | 'textures' | 'quality'>(name: K,
      signal: AbortSignal | undefined, read: (m: Manifest) => Promise<Uint8Array>): Promise<Decoded<K>> {
    const { manifest } = this;
    const decode = (bytes: Uint8Array) =>
      this.decoded(signal, name, ...([bytes, manifest] as Parameters<Documents[K]>));
    return this.readOnce_(name, () => read(manifest).then(decode), signal);
  }
  /** Decodes or checks by a function of documents.ts. */
  decoded<K extends keyof Documents>(signal: AbortSignal | undefined, name: K,
      ...args: Parameters<Documents[K]>): Promise<Decoded<K>> {
    return decodeWith(this.decodeDocument, this.client.options.stallTimeoutS, signal, name, ...args);
  }

  // ---- index

  /** Every entry but manifest.json and index.bin, in container order. */
  async index(): Promise<EntryRef[]> {
    return decodeHere('readIndex', await this.readChecked(this.manifest.index, { kind: 'index' }));
  }
  /** Entries of a plane by their paths, or of none. */
  private indexPage_(plane: number, signal?: AbortSignal): Promise<Map<string, EntryRef>> {
    const how = { kind: 'index', signal } as const;
    const read = async (): Promise<Map<string, EntryRef>> => {
      const { index } = this.manifest;
      const pages = await this.document_('indexPages', signal, () => this.readPaged_(index, how));
      const page = pages.find((p) => p.plane === plane);
      return page ? this.decoded(signal, 'indexPage', await this.readChecked(page, how, index), page,
        this.manifest) : new Map();
    };
    return this.readOnce_(`index/${plane}`, read, signal);
  }
  /** An entry of the index; only the page of the index with that entry is read. */
  async find(path: string, signal?: AbortSignal): Promise<EntryRef> {
    return this.findOn(planeOfPath(path), path, signal);
  }
  /** An entry on the index page of a plane, or (-1) of no plane. */
  async findOn(plane: number, path: string, signal?: AbortSignal): Promise<EntryRef> {
    const entry = (await this.indexPage_(plane, signal)).get(path);
    if (!entry) throw new FormatError(this.store.name, path, 'an entry of the index', '', 'R07');
    return entry;
  }
  /** An entry that belongs to no plane. */
  protected findWithoutPlane_(path: string, signal?: AbortSignal): Promise<EntryRef> {
    return this.findOn(noPlane, path, signal);
  }
  /** The bytes of an entry. */
  async entry(path: string, kind: RequestKind = 'other', signal?: AbortSignal): Promise<Uint8Array> {
    return this.readChecked(await this.find(path, signal), { kind, signal });
  }

  // ---- textures, quality, provenance

  /** The texture planes: full-size ones first, then mips. */
  textures(signal?: AbortSignal): Promise<TextureInfo[]> {
    return this.document_('textures', signal,
      (m) => this.readChecked(m.textures, { kind: 'textures', signal }));
  }
  /** Measured quality of scales and rungs. */
  async quality(signal?: AbortSignal): Promise<QualityTable> {
    const read = (m: Manifest): Promise<Uint8Array> =>
      this.readChecked(m.quality, { kind: 'quality', signal });
    const [table, textures] =
      await Promise.all([this.document_('quality', signal, read), this.textures(signal)]);
    requireGroups(table, textures);
    return table;
  }
  /** Provenance: what the package was made from and with, as JSON. */
  async provenance(): Promise<unknown> {
    return JSON.parse(new TextDecoder().decode(await this.readChecked(this.manifest.provenance,
      { kind: 'other' })));
  }
  /** about.json: what the object is, whose it is, what its coordinates mean; fetched when first asked for. */
  about(signal?: AbortSignal): Promise<About> {
    const read = async (): Promise<About> => {
      const bytes = await this.readChecked(this.manifest.about, { kind: 'other', signal });
      return (await import('../format/about')).readAbout(bytes); // short, and few ask for it
    };
    return this.readOnce_('about', read, signal);
  }
  /**
   * Reads what a first plan and its first fragments need by one request, or as much of that as is small:
   * index, textures.json, quality.json, table streams, tables, and `withMesh` the coarsest mesh. False where
   * not even the documents before the tables are small.
   */
  async prefetchDocuments(signal?: AbortSignal, withMesh = false): Promise<boolean> {
    const { index, tables, scales } = this.manifest;
    const { offset, bytes: meshBytes } = scales[scales.length - 1].glb;
    const ends = [withMesh ? offset + meshBytes : 0, tables.offset + tables.bytes, tables.offset].map((end) =>
      end - index.offset);
    const bytes = ends.find((n) => n > 0 && n <= wholeDocumentBytes);
    if (!bytes) return false;
    // Whoever takes a document of these bytes holds the document to its digest.
    const read = (): Promise<Uint8Array> =>
      this.store.read(index, { offset: index.offset, bytes }, { kind: 'tables', signal });
    if (this.form === 'range') await this.readOnce_(`documents/${bytes}`, read, signal);
    return true;
  }

  // ---- tables

  /** Tables of one plane. */
  async planeTables(plane: number, signal?: AbortSignal): Promise<PlaneTables> {
    return (await this.tables([plane], signal))[plane]!;
  }
  /** Tables by plane: of these planes and those read before, or of all. One request reads neighbours. */
  async tables(planes?: readonly number[], signal?: AbortSignal): Promise<(PlaneTables | undefined)[]> {
    const { tables } = this.manifest;
    const how = { kind: 'tables', signal } as const;
    const sections = await this.document_('tableSections', signal, () => this.readPaged_(tables, how));
    const wanted = [...new Set(planes ?? sections.keys())].sort((a, b) => a - b);
    let last = { offset: 0, bytes: -Infinity };
    const reads = wanted.map((p) => {
      const section = sections[p];
      if (!section)
        throw new InputError(this.store.name, `texture plane ${p}`, `one of ${sections.length}`, 'another');
      let run: ByteRange = { offset: section.offset, bytes: section.bytes };
      if (!this.reads_.has(`tables/${p}`)) {
        if (run.offset - last.offset - last.bytes <= gapBytes) {
          last.bytes = run.offset + run.bytes - last.offset;
          run = last;
        }
        last = run;
      }
      const bytes = async (): Promise<Uint8Array> => {
        await this.readOnce_(`tables/${run.offset}+${run.bytes}`, () => this.store.read(tables, run, how),
          signal);
        return this.readChecked(section, how, tables);
      };
      const read = async (): Promise<void> => {
        const [got, textures, entries] =
          await Promise.all([bytes(), this.textures(signal), this.indexPage_(p, signal)]);
        this.planes_.set(p, await this.decoded(signal, 'planeTables', got, section, p, textures[p], entries));
      };
      return () => this.readOnce_(`tables/${p}`, read, signal);
    });
    await Promise.all(reads.map((read) => read()));
    return sections.map((_, p) => this.planes_.get(p)?.tables);
  }
  /** Tables, packs and offsets of a plane whose tables were read. */
  protected planeDocument_(plane: number): PlaneDocument {
    return this.planes_.get(plane)!;
  }
  /** Data that decisions about textures are made from, with the tables of these planes. */
  async data(planes?: readonly number[], signal?: AbortSignal): Promise<PackageData> {
    const [textures, tables, quality] =
      await Promise.all([this.textures(signal), this.tables(planes, signal), this.quality(signal)]);
    return { manifest: this.manifest, textures, tables, quality };
  }
}
