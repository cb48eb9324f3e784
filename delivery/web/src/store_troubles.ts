import { FormatError, InputError, TexmeshError } from './errors';
import { Answer, GetOptions, HttpClient, HttpOptions, concat, nowS, shownUrl, sleepS, throwIfAborted, whatCame } from './http';
import { Source, RangeReader, ReadOptions, rangeRequest, sameOrigin } from './store';
import { Throughput, defaultThroughput } from './throughput';

// What happens once something has failed, or where there are mirrors: loaded then, or as soon as a first picture stands.

const silenceFactor = 4;
const leastPatienceRtts = 8;
const leastPatienceS = 0.5;

/** A URL that a package can be had from, and what it has shown so far. */
export class Mirror implements Source {
  alive = true;
  etag = '';
  total = -1;
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

/** Whether asking again may help. */
function mayRetry(a: Answer): boolean {
  const { status } = a;
  if (status === 0 || status === 408 || status === 429 || status >= 500) return true;
  return (status === 200 || status === 206) && !a.complete && !a.tooLong;
}

/** Waits longer from try to try; false when there have been enough. */
class Retries {
  private left_: number;
  private delayS_: number;
  constructor(options: HttpOptions) {
    this.left_ = options.retries;
    this.delayS_ = options.retryDelayS;
  }
  async wait(signal?: AbortSignal): Promise<boolean> {
    if (this.left_-- <= 0) return false;
    await sleepS(this.delayS_, signal);
    throwIfAborted(signal);
    this.delayS_ *= 2;
    return true;
  }
}

/** A whole file; with retries, unless somebody else has it. */
export async function getWhole(
  client: HttpClient,
  url: string,
  maxBytes: number,
  how: Pick<GetOptions, 'kind' | 'signal' | 'onBytes' | 'reload' | 'stallTimeoutS'>,
  elsewhere = false,
): Promise<Uint8Array> {
  const retries = new Retries(client.options);
  for (;;) {
    const a = await client.get(url, { maxBytes, ...how });
    if (a.status === 200 && a.complete) return a.body;
    if (a.tooLong) throw new InputError(shownUrl(url), '', `at most ${maxBytes} bytes`, 'more');
    if (!mayRetry(a) || elsewhere || !(await retries.wait(how.signal)))
      throw new InputError(shownUrl(url), '', 'a file', whatCame(a));
  }
}

/** Ranges of a container from mirrors that may fail: retries, cut transfers that go on where they broke, servers that have other bytes. */
export class PatientRanges implements RangeReader {
  noRanges?: InputError;
  private readonly mirrors_: Mirrors;

  /** `known` is what the first URL has shown so far. */
  constructor(
    urls: readonly string[],
    private readonly client_: HttpClient,
    known: Source,
  ) {
    this.mirrors_ = new Mirrors(urls);
    Object.assign(this.mirrors_.all[0], known);
  }
  private get name_(): string {
    return shownUrl(this.mirrors_.all[0].url);
  }

  fetch(offset: number, bytes: number, how: ReadOptions, first?: Answer): Promise<Uint8Array> {
    let answer = first;
    return fromMirrors(this.mirrors_, this.client_, bytes, async (m, patience) => {
      const begun = m === this.mirrors_.all[0] ? answer : undefined;
      answer = undefined;
      const got = await this.fetchFrom_(m, offset, bytes, how, patience, false, begun);
      try {
        await how.verify?.(got);
        return got;
      } catch (error) {
        if (this.mirrors_.alive > 1) throw error;
        // A cache on the way may hold something bad; the server itself is asked once.
        const fresh = await this.fetchFrom_(m, offset, bytes, how, patience, true);
        await how.verify?.(fresh);
        return fresh;
      }
    });
  }

  private async fetchFrom_(
    m: Mirror,
    offset: number,
    bytes: number,
    how: ReadOptions,
    stallTimeoutS: number,
    reload: boolean,
    first?: Answer,
  ): Promise<Uint8Array> {
    let got: Uint8Array[] = [];
    let have = 0;
    let answer = first;
    const retries = new Retries(this.client_.options);
    // Nothing is made room for that cannot come.
    if (offset > 0 && m.total >= 0 && offset + bytes > m.total)
      throw new FormatError(this.name_, `byte ${offset}`, `a file of ${offset + bytes} bytes`, `${m.total}`);
    for (;;) {
      const before = have;
      const onBytes = how.onBytes && ((n: number): void => how.onBytes!(before + n));
      const request = rangeRequest(m, offset + have, bytes - have, { ...how, onBytes });
      const a = answer ?? (await this.client_.get(m.url, { ...request, stallTimeoutS, reload }));
      answer = undefined;
      m.at = a.url;
      if (a.status === 206) {
        this.checkRange_(m, a, offset + have, bytes - have);
        got.push(a.body);
        have += a.body.length;
        const wanted = m.total >= 0 ? Math.min(bytes, m.total - offset) : bytes;
        if (a.complete) {
          if (have === wanted || (m.total < 0 && offset === 0)) return got.length === 1 ? got[0] : concat(got, have);
          throw new FormatError(this.name_, `byte ${offset}`, `${wanted} bytes`, `${have}`);
        }
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
      if (m.total < 0) throw (this.noRanges = new InputError(file, '', 'a server that answers ranges', 'status 200'));
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
}
