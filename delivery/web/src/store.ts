import { FormatError, InputError } from './errors';
import { Answer, GetOptions, HttpClient, RequestKind, concat, isAbort, shownUrl, sleepS, whatCame } from './http';
import { bootstrapBytes, manifestOfContainer } from './manifest';

/** How a package's bytes are read: ranges of a container, files of a tree, or one whole container. */
export type PackageForm = 'range' | 'files' | 'whole';

/** What a read needs to know about an entry. */
export interface Place {
  path: string;
  offset: number;
  bytes: number;
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
  manifest(signal?: AbortSignal): Promise<Uint8Array>;
  /** Exactly these bytes of an entry. */
  read(place: Place, offset: number, bytes: number, how: ReadOptions): Promise<Uint8Array>;
  /** A file of a tree that is no entry; undefined where there is none, and nothing to verify that it is. */
  extraFile?(path: string, maxBytes: number, how: ReadOptions): Promise<Uint8Array | undefined>;
  /** Forgets what it remembers. */
  dispose(): void;
}

/** What a server has shown of a container so far. */
export interface Source {
  /** Where its answers come from. */
  at: string;
  etag: string;
  /** Bytes of the container; -1 = not known. */
  total: number;
}
/** Who reads ranges once something has failed: PatientRanges. */
export interface RangeReader {
  /** What a server said that knows no ranges. */
  noRanges?: InputError;
  /** `first` is an answer of the first URL that is not what was asked for. */
  fetch(offset: number, bytes: number, how: ReadOptions, first?: Answer): Promise<Uint8Array>;
}

/** Whether an answer from there is read without asking the server first (CORS). */
export function sameOrigin(url: string): boolean {
  const here = globalThis.location;
  return !here || new URL(url, here.href).origin === here.origin;
}

/** Asks for a range of the container that reading began with. */
export function rangeRequest({ at, etag }: Source, offset: number, bytes: number, { kind, signal, onBytes }: ReadOptions): GetOptions {
  // If-Range from another origin would cost a preflight request.
  return { range: { offset, bytes }, ifRange: sameOrigin(at) ? etag : '', maxBytes: bytes, kind, signal, onBytes };
}

/** Whether an answer is what rangeRequest asked for; then what it says of the container is kept. */
function isAsAsked(source: Source, a: Answer, offset: number, bytes: number): boolean {
  const { range, etag } = a;
  const total = range ? range.total : source.total;
  const wanted = offset > 0 || total < 0 ? bytes : Math.min(bytes, total);
  const good =
    a.status === 206 && a.complete && (!source.etag || !etag || etag === source.etag) && (source.total < 0 || total === source.total) &&
    // Another origin may keep the header to itself; then only the length tells.
    (range ? range.first === offset : !sameOrigin(a.url)) && (a.body.length === wanted || (offset === 0 && total < 0));
  if (good) Object.assign(source, { at: a.url, etag: source.etag || etag, total });
  return good;
}

const troubles = () => import('./store_troubles');
/** Without a byte from the first of several mirrors, before anything is known of them. */
const firstPatienceS = 0.7;

/** Ranges of a container. What was read is not asked for again, unless it was read `once`. */
class RangeStore implements PackageStore {
  readonly form = 'range';
  private parts_: { begin: number; bytes: Uint8Array }[] = [];
  private readonly source_: Source;
  private patient_?: RangeReader;

  constructor(
    private readonly urls_: readonly string[],
    private readonly client_: HttpClient,
  ) {
    this.source_ = { at: urls_[0], etag: '', total: -1 };
    if (urls_.length > 1) this.becomePatient_().catch(() => undefined);
  }
  get noRanges(): InputError | undefined {
    return this.patient_?.noRanges;
  }
  get name(): string {
    return shownUrl(this.urls_[0]);
  }

  async manifest(signal?: AbortSignal): Promise<Uint8Array> {
    const bytes = await this.fetch_(0, bootstrapBytes, { kind: 'manifest', signal });
    this.parts_.push({ begin: 0, bytes });
    return manifestOfContainer(bytes, this.name);
  }

  async read(place: Place, offset: number, bytes: number, how: ReadOptions): Promise<Uint8Array> {
    const begin = place.offset + offset;
    const end = begin + bytes;
    const chunks = this.known_(begin, end);
    const from = chunks.reduce((at, c) => at + c.length, begin);
    if (from < end) chunks.push(await this.fetch_(from, end - from, how));
    let got = chunks.length === 1 ? chunks[0] : concat(chunks, bytes);
    let isNew = from < end;
    try {
      await how.verify?.(got);
    } catch (error) {
      if (!(error instanceof FormatError)) throw error;
      this.parts_ = this.parts_.filter((p) => p.begin >= end || p.begin + p.bytes.length <= begin); // what was known may be what is bad
      got = await this.fetch_(begin, bytes, how, error);
      isNew = true;
    }
    if (isNew && !how.once) {
      this.parts_ = this.parts_.filter((p) => p.begin < begin || p.begin + p.bytes.length > end);
      this.parts_.push({ begin, bytes: got });
    }
    return got;
  }
  /** What is known from a place on. */
  private known_(begin: number, end: number): Uint8Array[] {
    const chunks: Uint8Array[] = [];
    for (let at = begin; at < end; at += chunks[chunks.length - 1].length) {
      const part = this.parts_.find((p) => p.begin <= at && p.begin + p.bytes.length > at);
      if (!part) break;
      chunks.push(part.bytes.subarray(at - part.begin, end - part.begin));
    }
    return chunks;
  }

  private async fetch_(offset: number, bytes: number, how: ReadOptions, damaged?: Error): Promise<Uint8Array> {
    const { urls_: urls, client_: client, source_: source } = this;
    const { stallTimeoutS: most } = client.options;
    let first: Answer | undefined;
    const beyond = offset > 0 && source.total >= 0 && offset + bytes > source.total; // told below
    if (!this.patient_ && !damaged && !beyond) {
      const stallTimeoutS = urls.length > 1 ? Math.min(firstPatienceS, most) : most;
      first = await client.get(urls[0], { ...rangeRequest(source, offset, bytes, how), stallTimeoutS });
      if (isAsAsked(source, first, offset, bytes)) return first.body;
    }
    const patient = await this.becomePatient_().catch(() => {
      throw damaged ?? new InputError(this.name, `byte ${offset}`, 'an answer with status 206', first ? whatCame(first) : 'another');
    });
    return patient.fetch(offset, bytes, { ...how, verify: damaged && how.verify }, first);
  }
  private async becomePatient_(): Promise<RangeReader> {
    const { PatientRanges } = await troubles().catch(() => sleepS(this.client_.options.retryDelayS).then(troubles));
    return (this.patient_ ??= new PatientRanges(this.urls_, this.client_, this.source_));
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
  const files = () => import('./store_files');
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
