import { FormatError, InputError, TexmeshError } from './errors';
import {
  Answer, GetOptions, HttpClient, RequestKind, Retries, concat, getWhole, isAbort, mayRetry, nowS, shownUrl, whatCame,
} from './http';
import { bootstrapBytes, manifestOfContainer } from './manifest';
import { Throughput, defaultThroughput } from './throughput';

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

/** The server answers whole files only. */
class NoRanges extends InputError {}

const silenceFactor = 4;
const leastPatienceRtts = 8;
const leastPatienceS = 0.5;

/** A URL that a package can be had from, and what it has shown so far. */
export class Mirror {
  alive = true;
  etag = '';
  total = -1;
  /** Where its answers come from. */
  at: string;
  readonly throughput = new Throughput({ ...defaultThroughput });
  owedBytes = 0;
  lastS = 0;
  constructor(readonly url: string) {
    this.at = url;
  }
}

/** Which mirror delivers first, by what each has delivered so far and has to deliver yet. */
export class Mirrors {
  readonly all: Mirror[];
  constructor(urls: readonly string[]) {
    this.all = urls.map((url) => new Mirror(url));
  }
  get alive(): number {
    return this.all.filter((m) => m.alive).length;
  }
  choose(bytes: number): Mirror {
    let best: Mirror | undefined;
    let bestS = 0;
    for (const m of this.all) {
      if (!m.alive) continue;
      const s = (m.owedBytes + bytes) / m.throughput.bytesS();
      if (!best || s < bestS) {
        best = m;
        bestS = s;
      }
    }
    return best ?? this.all[0];
  }
  asked(m: Mirror, bytes: number): number {
    m.owedBytes += bytes;
    return m.owedBytes / m.throughput.bytesS();
  }
  delivered(m: Mirror, bytes: number, fromS: number, atS: number): void {
    m.throughput.add(bytes, atS - Math.max(m.lastS, fromS));
    m.lastS = atS;
    m.owedBytes -= bytes;
  }
  /** A mirror that fails is not asked again, as long as there are others. Says whether there are. */
  failed(m: Mirror, bytes: number): boolean {
    m.owedBytes -= bytes;
    if (m.alive && this.alive > 1) m.alive = false;
    return !m.alive;
  }
}

/** Tries mirror after mirror; a failure of the last one is everybody's. */
export async function fromMirrors<T>(
  mirrors: Mirrors,
  client: HttpClient,
  bytes: number,
  ask: (m: Mirror, patienceS: number) => Promise<T>,
): Promise<T> {
  for (;;) {
    const m = mirrors.choose(bytes);
    const expectedS = mirrors.asked(m, bytes);
    const patient = Math.max(leastPatienceS, leastPatienceRtts * client.rttS, silenceFactor * expectedS);
    const patience = mirrors.alive > 1 ? Math.min(patient, client.options.stallTimeoutS) : client.options.stallTimeoutS;
    const started = nowS();
    try {
      const result = await ask(m, patience);
      mirrors.delivered(m, bytes, started + client.rttS, nowS());
      return result;
    } catch (error) {
      const cancelled = !(error instanceof TexmeshError); // which says nothing of the mirror
      if (cancelled) m.owedBytes -= bytes;
      if (cancelled || !mirrors.failed(m, bytes)) throw error;
    }
  }
}

/** Ranges of a container. What was read is not asked for again, unless it was read `once`. */
class RangeStore implements PackageStore {
  readonly form = 'range';
  private readonly parts_: { begin: number; bytes: Uint8Array }[] = []; // by begin, not overlapping
  private readonly mirrors_: Mirrors;
  /** What a server said that knows no ranges. */
  noRanges?: NoRanges;

  constructor(
    urls: readonly string[],
    private readonly client_: HttpClient,
  ) {
    this.mirrors_ = new Mirrors(urls);
  }
  get name(): string {
    return shownUrl(this.mirrors_.all[0].url);
  }

  async manifest(signal?: AbortSignal): Promise<Uint8Array> {
    const bytes = await this.fetchRange_(0, bootstrapBytes, { kind: 'manifest', signal });
    this.keep_(0, bytes);
    return manifestOfContainer(bytes, this.name);
  }

  async read(place: Place, offset: number, bytes: number, how: ReadOptions): Promise<Uint8Array> {
    const begin = place.offset + offset;
    if (bytes === 0) return new Uint8Array(0);
    const missing = this.missing_(begin, begin + bytes);
    if (!missing || missing.end - missing.begin < bytes) {
      const got = missing ? await this.fetchRange_(missing.begin, missing.end - missing.begin, how) : new Uint8Array(0);
      const whole = this.assemble_(begin, bytes, missing?.begin ?? 0, got);
      try {
        await how.verify?.(whole);
        if (missing && !how.once) this.keep_(missing.begin, got);
        return whole;
      } catch (error) {
        if (!(error instanceof FormatError)) throw error;
        this.drop_(begin, begin + bytes); // what was known may be what is bad
      }
    }
    const got = await this.fetchRange_(begin, bytes, how, how.verify);
    if (!how.once) this.keep_(begin, got);
    return got;
  }
  private drop_(begin: number, end: number, within = false): void {
    for (let i = this.parts_.length - 1; i >= 0; --i) {
      const p = this.parts_[i];
      const [first, last] = [p.begin, p.begin + p.bytes.length];
      if (within ? first >= begin && last <= end : first < end && last > begin) this.parts_.splice(i, 1);
    }
  }

  /** The range from the first to the last byte that is not known; known gaps inside are asked for again. */
  private missing_(begin: number, end: number): { begin: number; end: number } | undefined {
    let from = begin;
    let to = end;
    for (const p of this.parts_) if (p.begin <= from && p.begin + p.bytes.length > from) from = p.begin + p.bytes.length;
    for (let i = this.parts_.length - 1; i >= 0; --i) {
      const p = this.parts_[i];
      if (p.begin < to && p.begin + p.bytes.length >= to) to = Math.max(from, p.begin);
    }
    return from < to ? { begin: from, end: to } : undefined;
  }
  private assemble_(begin: number, bytes: number, gotAt: number, got: Uint8Array): Uint8Array {
    if (gotAt === begin && got.length === bytes) return got;
    const out = new Uint8Array(bytes);
    for (const p of [...this.parts_, { begin: gotAt, bytes: got }]) {
      const from = Math.max(begin, p.begin);
      const to = Math.min(begin + bytes, p.begin + p.bytes.length);
      if (from < to) out.set(p.bytes.subarray(from - p.begin, to - p.begin), from - begin);
    }
    return out;
  }
  private keep_(begin: number, bytes: Uint8Array): void {
    this.drop_(begin, begin + bytes.length, true);
    this.parts_.push({ begin, bytes });
    this.parts_.sort((a, b) => a.begin - b.begin);
  }

  private fetchRange_(
    offset: number,
    bytes: number,
    how: ReadOptions,
    verify?: (got: Uint8Array) => Promise<void>,
  ): Promise<Uint8Array> {
    return fromMirrors(this.mirrors_, this.client_, bytes, async (m, patience) => {
      const got = await this.fetchFrom_(m, offset, bytes, how, patience, false);
      try {
        await verify?.(got);
        return got;
      } catch (error) {
        if (this.mirrors_.alive > 1) throw error;
        // A cache on the way may hold something bad; the server itself is asked once.
        const fresh = await this.fetchFrom_(m, offset, bytes, how, patience, true);
        await verify?.(fresh);
        return fresh;
      }
    });
  }

  private async fetchFrom_(
    m: Mirror,
    offset: number,
    bytes: number,
    how: ReadOptions,
    patience: number,
    reload: boolean,
  ): Promise<Uint8Array> {
    let got: Uint8Array[] = [];
    let have = 0;
    const retries = new Retries(this.client_.options);
    // Nothing is made room for that cannot come.
    if (offset > 0 && m.total >= 0 && offset + bytes > m.total)
      throw new FormatError(this.name, `byte ${offset}`, `a file of ${offset + bytes} bytes`, `${m.total}`);
    for (;;) {
      const before = have;
      const a = await this.client_.get(m.url, {
        range: { offset: offset + have, bytes: bytes - have },
        ifRange: sameOrigin(m.at) ? m.etag : '',
        maxBytes: bytes - have,
        kind: how.kind,
        signal: how.signal,
        stallTimeoutS: patience,
        onBytes: how.onBytes && ((n) => how.onBytes!(before + n)),
        reload,
      } satisfies GetOptions);
      m.at = a.url;
      if (a.status === 206) this.checkRange_(m, a, offset + have, bytes - have);
      if (a.status === 206) {
        got.push(a.body);
        have += a.body.length;
      }
      const wanted = m.total >= 0 ? Math.min(bytes, m.total - offset) : bytes;
      if (a.status === 206 && a.complete) {
        if (have === wanted || (m.total < 0 && offset === 0)) return got.length === 1 ? got[0] : concat(got, have);
        throw new FormatError(this.name, `byte ${offset}`, `${wanted} bytes`, `${have}`);
      }
      this.refuse_(m, a, offset, bytes);
      if (!mayRetry(a) || (this.mirrors_.alive > 1 && have === before) || !(await retries.wait(how.signal)))
        throw new InputError(shownUrl(m.url), `byte ${offset + have}`, 'an answer with status 206', whatCame(a));
      if (have === 0) got = [];
    }
  }

  /** Answers after which there is no use in trying again. */
  private refuse_(m: Mirror, a: Answer, offset: number, bytes: number): void {
    const file = shownUrl(m.url);
    if (a.status === 200) {
      if (m.total < 0) throw (this.noRanges = new NoRanges(file, '', 'a server that answers ranges', 'status 200'));
      throw new FormatError(
        file, '', 'the file that reading began with',
        'status 200: it was replaced, or the server no longer answers ranges',
      );
    }
    if (a.status === 416) throw new FormatError(file, `byte ${offset}`, 'a longer file', 'status 416');
    if (a.tooLong) throw new FormatError(file, `byte ${offset}`, `${bytes} bytes`, 'more');
  }

  private checkRange_(m: Mirror, a: Answer, offset: number, bytes: number): void {
    const fail = (expected: string, found: string): never => {
      throw new FormatError(shownUrl(m.url), `byte ${offset}`, expected, found);
    };
    if (m.etag !== '' && a.etag !== '' && a.etag !== m.etag)
      fail('the file that reading began with', 'another one (ETag)');
    if (m.etag === '') m.etag = a.etag;
    const { range } = a;
    if (!range) {
      // Another origin may keep the header to itself; then only the length tells.
      if (sameOrigin(a.url)) fail('a Content-Range', 'none that can be read');
      return;
    }
    if (m.total >= 0 && range.total !== m.total) fail(`a file of ${m.total} bytes`, `${range.total}`);
    if (range.first !== offset || range.last !== Math.min(offset + bytes, range.total) - 1)
      fail('the range that was asked for', `${range.first}-${range.last}`);
    m.total = range.total;
  }

  dispose(): void {
    this.parts_.length = 0;
  }
}

/** If-Range from another origin would cost a preflight request. */
function sameOrigin(url: string): boolean {
  const here = globalThis.location;
  return !here || new URL(url, here.href).origin === here.origin;
}

/** https://host/a/NAME.texmesh -> https://host/a/NAME/ ; '' when the URL is not of that form. */
export function treeUrl(url: string): string {
  const m = /^([^?#]*)\.texmesh([?#].*)?$/.exec(url);
  return m ? `${m[1]}/${m[2] ?? ''}` : '';
}

/** See OpenOptions.mode. */
export type StoreMode = 'auto' | 'range' | 'files';

/**
 * Finds out how the server can be read (SPEC.md, section 13): ranges of the container; the tree beside it where it
 * answers 200 to a range; the whole container where there is no tree. Gives the store and the manifest's bytes.
 */
export async function openStore(
  url: string,
  mirrors: readonly string[],
  mode: StoreMode,
  client: HttpClient,
  signal?: AbortSignal,
): Promise<{ store: PackageStore; manifest: Uint8Array }> {
  const urls = [url, ...mirrors.filter((m) => m !== url)];
  const use = async (store: PackageStore): Promise<{ store: PackageStore; manifest: Uint8Array }> => ({
    store,
    manifest: await store.manifest(signal),
  });
  const path = url.replace(/[?#].*$/, '');
  const files = () => import('./store_files');
  if (path.endsWith('/')) return use(new (await files()).TreeStore(urls, client));
  const roots = urls.map(treeUrl).filter((root) => root !== '');
  if (mode === 'files' && roots.length === 0)
    throw new InputError(shownUrl(url), '', 'a URL that ends in .texmesh or /, for mode files', 'another');
  if (mode === 'files') return use(new (await files()).TreeStore(roots, client));
  const ranges = new RangeStore(urls, client);
  try {
    return await use(ranges);
  } catch (error) {
    // Whole files are better than nothing, whatever the other mirrors said.
    if (!ranges.noRanges || isAbort(error)) throw error;
    if (mode === 'range') throw ranges.noRanges;
  }
  const { TreeStore, openBytes } = await files();
  if (roots.length > 0) {
    try {
      const found = await use(new TreeStore(roots, client));
      if (found.manifest[0] === 0x7b) return found; // a brace: no page of the server's own
    } catch (error) {
      if (!(error instanceof InputError)) throw error;
    }
  }
  const whole = new Mirrors(urls);
  return fromMirrors(whole, client, bootstrapBytes, async (m, stallTimeoutS) => {
    const how = { kind: 'other', signal, stallTimeoutS } as const;
    return use(openBytes(await getWhole(client, m.url, client.options.maxWholeBytes, how, whole.alive > 1), shownUrl(m.url)));
  });
}
