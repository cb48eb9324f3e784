import { FormatError } from './errors';
import { PackageReader, PlaneFiles } from './package_reader';
import { bytesToShow } from './allocation';
import { fragmentCount } from './tables';
import type { TextureInfo } from './textures';
import { ownLevels } from './composer';
import type { WorkerPool } from './worker_pool';
import type { Levels } from './worker_protocol';

/** A fragment to be had at a rung. */
export interface Wish {
  plane: number;
  fragment: number;
  rung: number;
  /** Index into the caller's list. */
  offer: number;
  /** Shown in place of a higher rung, too. */
  replaces?: boolean;
}
/** What becomes of wishes. Bytes arrive first; the picture follows when it is decoded. */
export interface TransferHooks {
  decoded(wish: Wish, levels: Levels): void;
  /** It cannot be had, or not decoded; the preview stays. */
  lost(wish: Wish, error: unknown): void;
}
/** Fragments at a border may reach so far beyond their plane. */
const beyondPx = 1024;

interface Part {
  wish: Wish;
  rung: number;
  offset: number;
  bytes: number;
  job: Job;
}
/** A wish under way: the streams it still lacks. */
interface Job {
  wish: Wish;
  first: number;
  streams: (Uint8Array | undefined)[];
  missing: number;
  failed: boolean;
}
interface Group {
  plane: number;
  rung: number;
  offset: number;
  bytes: number;
  parts: Part[];
}
/** How requests are made of wishes. */
export interface GroupOptions {
  /** Streams that nobody asked for but are fetched to join two requests, at most. */
  gapBytes: number;
  mostBytes: number;
  signal?: AbortSignal;
}

/**
 * Fetches fragments: streams of one rung that stand together by one request, lower rungs of incremental codecs once
 * only, decoding off the main thread.
 */
export class Transfers {
  private readonly planes_ = new Map<number, PlaneFiles>();
  private readonly held_ = new Map<string, Uint8Array[]>(); // streams of incremental codecs, from rung 0 on
  private underWay_ = 0; // requests and decodes

  constructor(
    private readonly reader_: PackageReader,
    private readonly textures_: readonly TextureInfo[],
    private readonly pool_: WorkerPool,
    private readonly hooks_: TransferHooks,
  ) {}

  /** Requests and fragments being decoded. */
  get pending(): number {
    return this.underWay_;
  }
  /** Must have been called for the planes of all wishes. */
  async prepare(planes: readonly number[], signal?: AbortSignal): Promise<void> {
    await Promise.all(
      planes.map(async (p) => {
        if (!this.planes_.has(p)) this.planes_.set(p, await this.reader_.planeFiles(p, signal));
      }),
    );
  }
  filesOf(plane: number): PlaneFiles {
    return this.planes_.get(plane)!;
  }
  private incremental_(plane: number): boolean {
    const { tables, complete } = this.filesOf(plane);
    return tables.incremental && !complete;
  }
  /** Bytes of a fragment at a rung: of what has to be fetched at most. */
  bytesOf(plane: number, rung: number, fragment: number): number {
    const { complete, tables } = this.filesOf(plane);
    return complete ? (complete[rung]?.get(fragment)?.bytes ?? 0) : bytesToShow(tables, rung, fragment);
  }

  /**
   * Fetches wishes. `arrived` is called when all bytes of one are there (before they are checked), `failed` when they
   * cannot be had. Resolves when every wish has arrived or failed.
   */
  async fetch(
    wishes: readonly Wish[],
    options: GroupOptions,
    arrived: (wish: Wish) => void,
    failed: (wish: Wish, error: unknown) => void,
  ): Promise<void> {
    ++this.underWay_; // what has arrived is not decoded before its request has ended
    try {
      const files = wishes.filter((w) => this.filesOf(w.plane).complete);
      const parts = wishes.filter((w) => !this.filesOf(w.plane).complete).flatMap((w) => this.partsOf_(w, options, arrived));
      await Promise.all([
        ...files.map((w) => this.fetchFile_(w, options, arrived, failed)),
        ...groupsOf(parts, options).map((g) => this.fetchGroup_(g, options, arrived, failed)),
      ]);
    } finally {
      --this.underWay_;
    }
  }

  private partsOf_(wish: Wish, options: GroupOptions, arrived: (wish: Wish) => void): Part[] {
    const { tables, offsets } = this.filesOf(wish.plane);
    const n = fragmentCount(tables);
    const incremental = this.incremental_(wish.plane);
    const held = incremental ? (this.held_.get(`${wish.plane}/${wish.fragment}`) ?? []) : [];
    const first = incremental ? 0 : wish.rung;
    const job: Job = { wish, first, streams: [], missing: 0, failed: false };
    const parts: Part[] = [];
    for (let rung = first; rung <= wish.rung; ++rung) {
      job.streams.push(held[rung - first]);
      if (job.streams[rung - first]) continue;
      const at = rung * n + wish.fragment;
      parts.push({ wish, rung, offset: offsets[at], bytes: tables.sizeBytes[at], job });
      ++job.missing;
    }
    if (parts.length === 0) {
      arrived(wish);
      void this.decode_(job, options.signal);
    }
    return parts;
  }

  private async fetchGroup_(
    group: Group,
    options: GroupOptions,
    arrived: (wish: Wish) => void,
    failed: (wish: Wish, error: unknown) => void,
  ): Promise<void> {
    const pack = this.filesOf(group.plane).packs[group.rung];
    const said = new Set<Part>();
    // The plan hears of each fragment when its last byte comes, though the answer ends later.
    const say = (upTo: number): void => {
      for (const p of group.parts)
        if (!said.has(p) && p.offset + p.bytes - group.offset <= upTo) {
          said.add(p);
          if (--p.job.missing === 0 && !p.job.failed) arrived(p.wish);
        }
    };
    try {
      const got = await this.reader_.store.read(pack, group.offset, group.bytes, {
        kind: 'texture', once: this.reader_.form !== 'files', signal: options.signal, onBytes: say,
      });
      for (const p of group.parts) {
        const at = p.offset - group.offset;
        p.job.streams[p.rung - p.job.first] = got.subarray(at, at + p.bytes);
      }
      say(Infinity);
      for (const p of group.parts)
        if (p.job.missing === 0 && p.job.streams.every((s) => s)) void this.decode_(p.job, options.signal);
    } catch (error) {
      for (const p of group.parts) {
        if (p.job.failed) continue;
        p.job.failed = true;
        if (said.has(p) && p.job.missing === 0) this.hooks_.lost(p.wish, error);
        else failed(p.wish, error);
      }
    }
  }

  private async fetchFile_(
    wish: Wish,
    options: GroupOptions,
    arrived: (wish: Wish) => void,
    failed: (wish: Wish, error: unknown) => void,
  ): Promise<void> {
    try {
      const file = await this.reader_.fragmentFile(wish.plane, wish.rung, wish.fragment, options.signal);
      arrived(wish);
      void this.decode_({ wish, first: wish.rung, streams: [file], missing: 0, failed: false }, options.signal);
    } catch (error) {
      failed(wish, error);
    }
  }

  private async decode_(job: Job, signal?: AbortSignal): Promise<void> {
    const { plane, fragment } = job.wish;
    ++this.underWay_;
    try {
      try {
        this.hooks_.decoded(job.wish, await this.decodeStreams_(job, signal));
      } catch (error) {
        if (!(error instanceof FormatError) || this.filesOf(plane).complete) throw error;
        // Damaged on the way: asked for once more, by itself, past what caches and bad mirrors hold.
        this.held_.delete(`${plane}/${fragment}`);
        for (let rung = job.first; rung <= job.wish.rung; ++rung)
          job.streams[rung - job.first] = await this.reader_.fragment(plane, rung, fragment, signal);
        this.hooks_.decoded(job.wish, await this.decodeStreams_(job, signal));
      }
    } catch (error) {
      this.hooks_.lost(job.wish, error);
    } finally {
      --this.underWay_;
    }
  }
  private async decodeStreams_(job: Job, signal?: AbortSignal): Promise<Levels> {
    const { plane, fragment, rung } = job.wish;
    const { tables, complete } = this.filesOf(plane);
    const streams = job.streams as Uint8Array[];
    const { codec, fragmentWidthPx, fragmentHeightPx, widthPx, heightPx } = this.textures_[plane];
    // A plane that the GPU can hold says how much room there is; the sides of its only fragment may say anything.
    const most: [number, number] = [Math.min(fragmentWidthPx, widthPx + beyondPx), Math.min(fragmentHeightPx, heightPx + beyondPx)];
    if (complete) {
      const digests = [complete[rung].get(fragment)!.sha256];
      return this.pool_.decode({ codec, tables: new Uint8Array(0), streams, digests, complete: true, levels: ownLevels, most });
    }
    const digests = streams.map((_, i) => {
      const at = 8 * ((job.first + i) * fragmentCount(tables) + fragment);
      return tables.digest.slice(at, at + 8);
    });
    const levels = await this.pool_.decode({
      codec, tables: await this.reader_.tableStream(plane, job.first, signal), streams, digests, complete: false, levels: ownLevels, most,
    });
    if (this.incremental_(plane)) this.held_.set(`${plane}/${fragment}`, streams);
    return levels;
  }

  dispose(): void {
    this.held_.clear();
    this.planes_.clear();
  }
}

/** Parts of one rung that stand together (or nearly) become one range. */
function groupsOf(parts: readonly Part[], options: GroupOptions): Group[] {
  const sorted = [...parts].sort(
    (a, b) => a.wish.plane - b.wish.plane || a.rung - b.rung || a.offset - b.offset,
  );
  const groups: Group[] = [];
  for (const p of sorted) {
    const g = groups[groups.length - 1];
    const end = g ? g.offset + g.bytes : 0;
    const joins =
      g && g.plane === p.wish.plane && g.rung === p.rung && p.offset - end <= options.gapBytes &&
      p.offset + p.bytes - g.offset <= options.mostBytes;
    if (joins) {
      g.bytes = p.offset + p.bytes - g.offset;
      g.parts.push(p);
    } else groups.push({ plane: p.wish.plane, rung: p.rung, offset: p.offset, bytes: p.bytes, parts: [p] });
  }
  return groups;
}
