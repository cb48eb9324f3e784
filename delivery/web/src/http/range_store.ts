import { concat } from '../format/sha256';
import { FormatError, InputError, throwIfAborted } from '../format/errors';
import { bootstrapBytes } from '../format/layout';
import { type ByteRange, manifestOfContainer } from '../format/manifest';
import type { HttpClient } from './client';
import { Asking, Mirror, Mirrors, retriesOf } from './mirrors';
import { Answer, isSameFile, nowS, shownUrl, whatCame } from './requests';
import type { PackageForm, PackageStore, Place, ReadOptions } from './store';

/** A server may answer less than was asked for, but no fewer bytes. */
const leastPart = 1024;
/** Damaged bytes let the first ones be read again no more often, seconds. */
const leastLookS = 10;

/** Whether the page's own origin answers at a URL: other origins may keep headers to themselves (CORS). */
function sameOrigin(url: string): boolean {
  const here = globalThis.location;
  return !here || new URL(url, here.href).origin === here.origin;
}

/** A server that has answered ranges answers 200 for one, and the file is still the same. */
class RangesEnded extends InputError {}

/**
 * Reads ranges of a container. Bytes that were read are not asked for again, unless they were read `once`.
 * Where servers stop answering ranges of the same file, the tree beside the container is read, if `openTree`
 * finds the same package there.
 */
export class RangeStore implements PackageStore {
  /** Error of a server that knows no ranges. */
  noRanges?: InputError;
  /** The first request has had no answer. */
  unanswered = false;
  private start_ = new Uint8Array(0);
  private looked_ = { s: -Infinity, found: Promise.resolve() };
  private tree_?: Promise<PackageStore>;
  private form_: PackageForm = 'range';
  private parts_: { begin: number; bytes: Uint8Array }[] = []; // the last read first
  private readonly mirrors_: Mirrors;

  constructor(urls: readonly string[], client: HttpClient, private readonly openTree_?: (manifest: Uint8Array,
      signal?: AbortSignal) => Promise<PackageStore>) {
    this.mirrors_ = new Mirrors(urls, client);
  }
  get form(): PackageForm {
    return this.form_;
  }
  get name(): string {
    return shownUrl(this.mirrors_.all[0].url);
  }

  async manifest(signal?: AbortSignal): Promise<Uint8Array> {
    const bytes = Math.max(bootstrapBytes, this.mirrors_.client.options.startBytes);
    const start = await this.readRange_({ offset: 0, bytes }, { kind: 'manifest', signal });
    return (this.start_ = start.subarray(0, bootstrapBytes));
  }

  async read(place: Place, range: ByteRange, how: ReadOptions): Promise<Uint8Array> {
    if (this.tree_) return (await this.tree_).read(place, range, how);
    try {
      return await this.readRange_(range, how);
    } catch (error) {
      // Damaged bytes may be those of another package.
      if (error instanceof FormatError && how.verify && !/replaced/.test(error.found)) {
        await this.look_();
        throwIfAborted(how.signal);
      }
      if (!(error instanceof RangesEnded) || !this.openTree_) throw error;
      this.tree_ ??= this.openTree_(manifestOfContainer(await this.manifest(), this.name), how.signal);
      this.tree_.then(() => (this.form_ = 'files'), () => (this.tree_ = undefined));
      const tree = await this.tree_.catch((failure: unknown) => {
        // replaced; or no tree, or no part that reads trees
        throw failure instanceof FormatError ? failure : error;
      });
      return tree.read(place, range, how);
    }
  }
  private async readRange_({ offset: begin, bytes }: ByteRange, how: ReadOptions): Promise<Uint8Array> {
    if (bytes === 0) return new Uint8Array(0); // WebP's tables are empty; no range header can say that
    const end = begin + bytes;
    const part = this.parts_.find((p) => p.begin <= begin && p.begin + p.bytes.length > begin);
    let got: Uint8Array | undefined;
    if (part)
      try {
        const known = part.bytes.subarray(begin - part.begin, end - part.begin);
        const have = known.length;
        const rest = { ...how, verify: undefined };
        got = have < bytes ? concat([known, await this.fetch_(begin + have, bytes - have, rest)]) : known;
        await how.verify?.(got);
        if (have === bytes) return got;
      } catch (error) {
        if (!(error instanceof FormatError) || !how.verify) throw error;
        // the remembered bytes may be the bad ones
        this.parts_ = this.parts_.filter((p) => p.begin >= end || p.begin + p.bytes.length <= begin);
        got = undefined;
      }
    got ??= await this.fetch_(begin, bytes, how);
    if (!how.once) this.parts_ = [{ begin, bytes: got },
      ...this.parts_.filter((p) => p.begin < begin || p.begin + p.bytes.length > end)];
    return got;
  }

  private fetch_(offset: number, bytes: number, how: ReadOptions): Promise<Uint8Array> {
    return this.mirrors_.ask(bytes, async (m, asking) => {
      const got = await this.fetchFrom_(m, asking, offset, bytes, how);
      await how.verify?.(got);
      return got;
    });
  }
  /** Fetches from one mirror; a cut transfer goes on where it broke. */
  private async fetchFrom_(m: Mirror, asking: Asking, offset: number, bytes: number,
      { kind, signal, onBytes }: ReadOptions): Promise<Uint8Array> {
    const { client } = this.mirrors_;
    const mayTryAgain = retriesOf(client, signal);
    const chunks: Uint8Array[] = [];
    let etag: string | undefined; // of the first part
    for (let have = 0; ; ) {
      // before memory is taken
      this.require_(m, offset === 0 || m.total < 0 || offset + bytes <= m.total, offset,
        `a file of ${offset + bytes} bytes`, m.total);
      const before = have;
      const range = { offset: offset + have, bytes: bytes - have };
      const a = await client.get(m.url, {
        range, kind, signal, maxBytes: range.bytes, ...asking,
        onBytes: (n) => onBytes?.(before + n),
      });
      m.at = a.url;
      // 416 of the first bytes: an empty file, or a server that refuses parts. Or what came is no part as it
      // is stored.
      const isNone = a.status === 200 || a.status === 416;
      const isPart = a.status !== 206 || (!a.tooLong && (a.complete || !a.encoding) &&
        (a.range || !sameOrigin(a.url)));
      if (m.total < 0 && (isNone || (offset === 0 && !isPart)))
        throw (this.noRanges = new InputError(shownUrl(m.url), '', 'a server that answers ranges',
          whatCame(a)));
      if (a.status === 200 && isSameFile(a, m.sameStart ? { ...m, etag: '' } : m))
        throw new RangesEnded(shownUrl(m.url), `byte ${offset}`, 'an answer with status 206',
          'status 200: ranges are no longer answered');
      if (isNone) this.requireSame_(m, false, offset, `status ${a.status}`);
      if (a.status === 206) {
        this.checkRange_(m, a, range);
        etag ??= a.etag;
        if (offset === 0) this.requireSame_(m, !a.etag || a.etag === etag, offset, 'another ETag');
        else if (a.etag && a.etag !== m.etag)
          try {
            await (m.sameStart ??= this.requireStart_(m, 'another ETag'));
          } catch (error) {
            m.sameStart = undefined;
            throw error;
          }
        chunks.push(a.body);
        have += a.body.length;
        if (a.complete) {
          const isEnd = m.total < 0 ? offset === 0 : m.total <= offset + have;
          if (have === bytes || isEnd) return concat(chunks);
          if (a.body.length >= leastPart) continue; // some servers send no more at once
        }
      }
      if ((asking.othersLeft && have === before) || !(await mayTryAgain(a))) {
        this.unanswered ||= a.status === 0 && m.total < 0 && !/^no byte/.test(a.problem);
        throw new InputError(shownUrl(m.url), `byte ${range.offset}`, 'an answer with status 206',
          whatCame(a));
      }
    }
  }
  /** Throws where the package is seen to be another one; asks only now and then. */
  private look_(): Promise<void> {
    if (nowS() < this.looked_.s + leastLookS) return this.looked_.found;
    const found = this.requireStart_(this.mirrors_.all.find((m) => m.alive)!, 'other bytes')
      .catch((now) => {
        if (now instanceof FormatError) throw now;
      });
    this.looked_ = { s: nowS(), found };
    return found;
  }
  /** Throws where the package begins with other bytes now. */
  private async requireStart_(m: Mirror, found: string): Promise<void> {
    const { start_: start, mirrors_: { client: { options: { stallTimeoutS } } } } = this;
    const now = await this.fetchFrom_(m, { stallTimeoutS, reload: true, othersLeft: false }, 0, start.length,
      { kind: 'manifest' });
    this.requireSame_(m, `${now}` === `${start}`, 0, found);
  }
  private require_({ url }: Mirror, good: boolean, offset: number, expected: string, found: unknown): void {
    if (!good) throw new FormatError(shownUrl(url), `byte ${offset}`, expected, `${found}`);
  }

  private requireSame_(m: Mirror, same: boolean, offset: number, found: string): void {
    this.require_(m, same, offset, 'the file that reading began with',
      `${found}: it was replaced, open it anew`);
  }
  /** Requires an answer from the file that reading began with, and with the range that was asked for. */
  private checkRange_(m: Mirror, { range, etag, url }: Answer,
      { offset, bytes }: { offset: number; bytes: number }): void {
    m.etag ||= etag;
    // Another origin may keep Content-Range to itself; then digests alone tell.
    if (!range) return this.require_(m, !sameOrigin(url), offset, 'a Content-Range', 'none that can be read');
    const [first, last] = range;
    const total = range[2] < 0 ? m.total : range[2];
    this.requireSame_(m, m.total < 0 || total === m.total, offset, `${total} bytes`);
    this.require_(m,
      first === offset && last < Math.min(offset + bytes, total < 0 ? last + 1 : total), offset,
      'the range that was asked for', `${first}-${last}`);
    m.total = total;
  }

  dispose(): void {
    this.parts_ = [];
  }
}
