import { codecTraits, joinFragment } from '../format/codec';
import { type DocumentDecoder, decodeHere } from '../format/document_decoder';
import { fragmentFilePath } from '../format/entry_paths';
import { FormatError, InputError, isAbort } from '../format/errors';
import type { FragmentFiles } from '../format/fragment_files';
import { previewPath, rungPath } from '../format/layout';
import { type ByteRange, hasGlb } from '../format/manifest';
import { requireDigest } from '../format/sha256';
import { fragmentCount, rungCount } from '../format/tables';
import { HttpClient } from './client';
import { type RequestKind, type RequestRecord, nowS } from './requests';
import { PackageDocuments, type PlaneFiles, decodeWith } from './package_documents';
import type { HttpOptions, OpenedStore, ReadOptions, StoreMode } from './store';
import { RangeStore } from './range_store';

/**
 * Finds out how the server can be read (SPEC.md, section 19): ranges of the container; the tree beside the
 * container where the server answers 200 to a range; the whole container where there is no tree. Where a
 * server stops answering ranges, the tree, too.
 */
export async function openStore(url: string, mirrors: readonly string[], mode: StoreMode, client: HttpClient,
    signal?: AbortSignal): Promise<OpenedStore> {
  const urls = [url, ...mirrors.filter((m) => m !== url)];
  const files = () => import('./without_ranges');
  if (mode === 'files' || /^[^?#]*\/([?#]|$)/.test(url))
    return (await files()).openTree(urls, client, signal);
  const openTree = async (manifest: Uint8Array, aborted?: AbortSignal) =>
    (await files()).openSameTree(urls, client, manifest, aborted);
  const store = new RangeStore(urls, client, mode === 'range' ? undefined : openTree);
  try {
    return { store, manifest: await store.manifest(signal) };
  } catch (error) {
    const { noRanges, unanswered } = store;
    // Whole files are better than nothing, whatever other mirrors answered.
    if (!(noRanges || unanswered) || isAbort(error)) throw error;
    if (mode === 'range') throw noRanges ?? error;
    const { openWithoutRanges, sendsWholeAlone } = await files().catch(() => {
      throw noRanges ?? error;
    });
    if (!noRanges && !(await sendsWholeAlone(url, client, signal))) throw error;
    return openWithoutRanges(urls, client, signal);
  }
}

/** Options of a package's opening. */
export interface OpenOptions extends Partial<HttpOptions> {
  /**
   * range: byte ranges of the container, nothing else. files: the tree beside the container. auto: ranges,
   * and the tree (or at last the whole container) where the server answers 200 to a range.
   */
  mode?: StoreMode;
  /** Further URLs of the same container. */
  mirrors?: readonly string[];
  signal?: AbortSignal;
}

const withoutRanges = () => import('./without_ranges');

/**
 * Reads a package on demand. Opening reads the manifest only; index, textures and tables are read when they
 * are first asked for, and never twice. Everything handed out has been checked: entries against their
 * SHA-256, fragments against the truncated digest in the tables, documents against each other.
 */
export class PackageReader extends PackageDocuments {
  /** Reads the manifest of a package at a URL; see OpenOptions. */
  static async openUrl<T extends PackageReader>(
      this: new (...args: ConstructorParameters<typeof PackageReader>) => T, url: string,
      options: OpenOptions = {}, decoder: DocumentDecoder = decodeHere): Promise<T> {
    const client = new HttpClient(options);
    const { signal, mode = 'auto', mirrors = [] } = options;
    const openedS = nowS();
    const { store, manifest } = await openStore(url, mirrors, mode, client, signal);
    const container = store.form === 'range' ? store.name : '';
    const { parsed, id } =
      await decodeWith(decoder, client.options.stallTimeoutS, signal, 'manifest', manifest, container);
    return new this(store, client, url, parsed, id, openedS, decoder);
  }

  /** Reads a container that is in memory. */
  static async openBytes<T extends PackageReader>(
      this: new (...args: ConstructorParameters<typeof PackageReader>) => T, bytes: Uint8Array,
      name = 'package'): Promise<T> {
    const store = (await withoutRanges()).openBytes(bytes, name);
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

  // ---- meshes and previews

  /** The GLB of a scale as it is stored, without an index. InputError: no file of its own, see hasGlb. */
  async scaleGlb(scale: number, how: Partial<ReadOptions> = {}): Promise<Uint8Array> {
    const s = this.manifest.scales.find((k) => k.scale === scale);
    if (!s) throw new InputError(this.store.name, `scale ${scale}`, 'a scale of the package', 'none');
    if (!hasGlb(s)) throw new InputError(this.store.name, `scale ${scale}`, 'a scale with a file of its own',
      'one of the stream');
    return this.readChecked(s.glb, { kind: 'mesh', once: true, ...how });
  }
  /** The GLB of a proxy as it is stored, without an index. 0 = the smallest. InputError: there is none. */
  async proxyGlb(proxy: number, how: Partial<ReadOptions> = {}): Promise<Uint8Array> {
    const found = this.manifest.proxies[proxy];
    if (!found) throw new InputError(this.store.name, `proxy ${proxy}`, 'a proxy of the package', 'none');
    return this.readChecked(found.glb, { kind: 'mesh', once: true, ...how });
  }
  /** The preview of a full-size plane, preview/PPP.jpg. */
  async preview(plane: number, signal?: AbortSignal): Promise<Uint8Array> {
    const read = async (): Promise<Uint8Array> =>
      this.readChecked(await this.findWithoutPlane_(previewPath(plane), signal), { kind: 'preview', signal });
    return this.readOnce_(`preview/${plane}`, read, signal);
  }

  // ---- fragments

  /** The table stream of a rung, which the rung's fragments share. */
  async tableStream(plane: number, rung: number, signal?: AbortSignal): Promise<Uint8Array> {
    const { tableBytes } = await this.planeTables(plane, signal);
    const { tableStreams } = this.planeDocument_(plane);
    const streams = await this.readOnce_(`streams/${plane}`,
      () => this.readChecked(tableStreams, { kind: 'texture', signal }), signal);
    if (!(rung in tableBytes)) throw new InputError(this.store.name, `texture plane ${plane}`,
      `a rung under ${tableBytes.length}`, `${rung}`);
    const begin = tableBytes.subarray(0, rung).reduce((sum, n) => sum + n, 0);
    return streams.subarray(begin, begin + tableBytes[rung]);
  }
  /** Tables, packs and offsets of a plane. */
  async planeFiles(plane: number, signal?: AbortSignal): Promise<PlaneFiles> {
    await this.tables([plane], signal);
    return { ...this.planeDocument_(plane), complete: (await this.fragmentFiles(signal))?.[plane] };
  }
  /** Where a fragment's stream stands within its rung's entry; bytes 0 = not stored. */
  async fragmentRange(plane: number, rung: number, fragment: number): Promise<ByteRange> {
    const { tables: t, offsets } = await this.planeFiles(plane);
    const at = rung * fragmentCount(t) + fragment;
    if (!(rung >= 0 && rung < rungCount(t) && fragment >= 0 && fragment < fragmentCount(t)))
      throw new InputError(this.store.name, `texture plane ${plane}`, 'a rung and a fragment of it',
        `${rung}, ${fragment}`);
    return { offset: offsets[at], bytes: t.sizeBytes[at] };
  }
  /** The first 8 bytes of the SHA-256 of a fragment's stream. */
  async fragmentDigest(plane: number, rung: number, fragment: number): Promise<Uint8Array> {
    const t = await this.planeTables(plane);
    const at = 8 * (rung * fragmentCount(t) + fragment);
    return t.digest.subarray(at, at + 8);
  }
  /** A fragment's stream at a rung, digest checked. */
  async fragment(plane: number, rung: number, fragment: number, signal?: AbortSignal): Promise<Uint8Array> {
    const { offset, bytes } = await this.fragmentRange(plane, rung, fragment);
    const pack = await this.find(rungPath(plane, rung), signal);
    const path = `fragment ${fragment} of ${pack.path}`;
    if (bytes === 0) throw new FormatError(this.store.name, path, 'a stored fragment', '', 'T07');
    const sha256 = await this.fragmentDigest(plane, rung, fragment);
    const how = { kind: 'texture', once: this.form !== 'files', signal } as const;
    return this.readChecked({ path, offset: pack.offset + offset, bytes, sha256, rule: 'F03' }, how, pack);
  }
  /** The image file that any decoder takes: table stream and fragment, with lower rungs where needed. */
  async completeFragment(plane: number, rung: number, fragment: number,
      signal?: AbortSignal): Promise<Uint8Array> {
    const { codec } = (await this.textures(signal))[plane];
    const first = codecTraits(codec).incremental ? 0 : rung;
    const streams: Uint8Array[] = [];
    for (let r = first; r <= rung; ++r) streams.push(await this.fragment(plane, r, fragment, signal));
    return joinFragment(codec, await this.tableStream(plane, first, signal), streams);
  }

  /** Files of fragments that `unpack --fragments files` added to a tree; undefined where there are none. */
  async fragmentFiles(signal?: AbortSignal): Promise<FragmentFiles | undefined> {
    if (this.form !== 'files') return undefined;
    return this.readOnce_('files', async () => (await withoutRanges()).readFragmentList(this.store, signal),
      signal);
  }
  /** A fragment's complete file of such a tree, digest checked. */
  async fragmentFile(plane: number, rung: number, fragment: number,
      signal?: AbortSignal): Promise<Uint8Array> {
    const { store } = this;
    const { extension } = codecTraits((await this.textures(signal))[plane].codec);
    const path = fragmentFilePath(plane, rung, fragment, extension);
    const file = (await this.planeFiles(plane, signal)).complete?.[rung]?.get(fragment);
    if (!file || !store.extraFile) throw new FormatError(store.name, path, 'a file', 'none');
    const verify = (bytes: Uint8Array): Promise<void> => requireDigest(bytes, file.sha256, store.name, path);
    const got = await store.extraFile(path, file.bytes, { kind: 'texture', signal, once: true, verify });
    if (!got) throw new FormatError(store.name, path, 'a file', 'none');
    return got;
  }

  // ---- vertex splits

  /** Head of the vertex-split stream; undefined when the package has none. */
  async splitStreamHead(signal?: AbortSignal): Promise<Uint8Array | undefined> {
    return (await this.splitStreamStart(0, signal))?.subarray(0, this.manifest.stream!.headBytes);
  }
  /** The checked head of the vertex-split stream, and so many bytes behind it (or all there are). */
  async splitStreamStart(more: number, signal?: AbortSignal): Promise<Uint8Array | undefined> {
    const { stream: s } = this.manifest;
    return s && this.readWithHead_(s, Math.min(s.bytes, s.headBytes + more), { kind: 'stream', signal });
  }
  /** Bytes of the vertex-split stream, not checked; InputError where there is none. */
  async splitStream(offset: number, bytes: number, how: Partial<ReadOptions> = {}): Promise<Uint8Array> {
    const { stream } = this.manifest;
    if (!stream) throw new InputError(this.store.name, '', 'a stream of vertex splits', 'none');
    return this.store.read(stream, { offset: stream.offset + offset, bytes },
      { kind: 'stream', once: true, ...how });
  }
}
