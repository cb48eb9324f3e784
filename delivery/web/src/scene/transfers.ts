import { FormatError } from '../format/errors';
import { bytesToShow, fragmentCount } from '../format/tables';
import type { TextureInfo } from '../format/textures';
import { PlaneFiles } from '../http/package_documents';
import { PackageReader } from '../http/package_reader';
import type { WorkerPool } from '../worker/pool';
import type { BlockRequest } from '../blocks/formats';
import type { Levels } from '../worker/protocol';
import { ownLevels } from './plane_storage';

/** A fragment that is wanted at a rung. */
export interface Wish {
  plane: number;
  fragment: number;
  rung: number;
  /** Index into the caller's list. */
  offer: number;
  /** The fragment is shown in place of a higher rung, too. */
  replaces?: boolean;
}
/** What becomes of wishes. Bytes arrive first; the picture follows when it is decoded. */
export interface TransferHooks {
  decoded(wish: Wish, levels: Levels): void;
  /** The fragment cannot be had, or cannot be decoded; the preview stays. */
  lost(wish: Wish, error: unknown): void;
  /** How a worker makes blocks of the fragment, where its texture is of blocks. */
  blocks?(wish: Wish): BlockRequest | undefined;
}
/** A fragment at a border may reach so far beyond its plane. */
const beyondPx = 1024;

/** A wish under way, with the streams that have come. */
interface Job {
  wish: Wish;
  /** Rung of the first stream. */
  first: number;
  streams: Uint8Array[];
  missing: number;
  failed: boolean;
}
/** A stream of a job, within its rung's pack. */
interface Part {
  job: Job;
  rung: number;
  offset: number;
  bytes: number;
}
/** They hear when all bytes of a wish are there (not yet checked), and when they cannot be had. */
interface Askers {
  arrived(wish: Wish): void;
  failed(wish: Wish, error: unknown): void;
}
/** How requests are made of wishes. */
export interface GroupOptions {
  /** Bytes that nobody asked for may be fetched to join two requests; so many at most. */
  gapBytes: number;
  mostBytes: number;
  signal?: AbortSignal;
}

/** Distance between files of fragments, more than any pack's length: requests for files are not joined. */
const fileSpacing = 2 ** 40;

/** Fetches fragments: neighbours of a rung by one request, lower rungs once; workers decode. */
export class Transfers {
  private readonly planes_ = new Map<number, PlaneFiles>();
  // streams of incremental codecs, from rung 0 on
  private readonly heldStreams_ = new Map<string, Uint8Array[]>();
  /** Requests and fragments being decoded. */
  pending = 0;

  constructor(
    private readonly reader_: PackageReader,
    private readonly textures_: readonly TextureInfo[],
    private readonly pool_: WorkerPool,
    private readonly hooks_: TransferHooks,
  ) {}

  /** Reads where the fragments of planes are; fetch() wants this for the planes of all wishes. */
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
  /** Most bytes that have to be fetched for a fragment at a rung. */
  bytesOf(plane: number, rung: number, fragment: number): number {
    const { complete, tables } = this.filesOf(plane);
    return complete ? (complete[rung]?.get(fragment)?.bytes ?? 0) : bytesToShow(tables, rung, fragment);
  }

  /**
   * Fetches wishes. `arrived` is called when all bytes of a wish are there (before the bytes are checked),
   * `failed` when they cannot be had. Resolves when every wish has arrived or failed.
   */
  async fetch(wishes: readonly Wish[], options: GroupOptions, arrived: Askers['arrived'],
      failed: Askers['failed']): Promise<void> {
    ++this.pending; // a wish that has arrived is not decoded before its request has ended
    const parts = wishes.flatMap((wish) => this.partsOf_(wish, arrived, options.signal));
    await Promise.all(groupsOf(parts, options)
      .map((group) => this.fetchGroup_(group, { arrived, failed }, options.signal)));
    --this.pending;
  }

  private partsOf_(wish: Wish, arrived: Askers['arrived'], signal?: AbortSignal): Part[] {
    const { plane, fragment } = wish;
    const { tables, offsets, complete } = this.filesOf(plane);
    const incremental = tables.incremental && !complete;
    const streams = [...((incremental && this.heldStreams_.get(`${plane}/${fragment}`)) || [])];
    const job: Job = { wish, first: incremental ? 0 : wish.rung, streams, missing: 0, failed: false };
    const parts: Part[] = [];
    for (let rung = job.first + streams.length; rung <= wish.rung; ++rung) {
      const at = rung * fragmentCount(tables) + fragment;
      const offset = complete ? fragment * fileSpacing : offsets[at];
      parts.push({ job, rung, offset,
        bytes: complete ? this.bytesOf(plane, rung, fragment) : tables.sizeBytes[at] });
    }
    streams.length = wish.rung + 1 - job.first;
    job.missing = parts.length;
    if (parts.length === 0) {
      arrived(wish);
      void this.decode_(job, signal);
    }
    return parts;
  }

  private async fetchGroup_(parts: Part[], { arrived, failed }: Askers, signal?: AbortSignal): Promise<void> {
    const { job, rung, offset: begin } = parts[0];
    const { plane, fragment } = job.wish;
    const { complete, packs } = this.filesOf(plane);
    let reported = 0;
    // The plan hears of each fragment when its last byte comes, though the answer ends later.
    const reportArrived = (upTo: number): void => {
      for (let p; (p = parts[reported]) && endOf(p) - begin <= upTo; ++reported)
        if (--p.job.missing === 0 && !p.job.failed) arrived(p.job.wish);
    };
    try {
      const got = complete
        ? await this.reader_.fragmentFile(plane, rung, fragment, signal)
        : await this.reader_.store.read(packs[rung],
            { offset: packs[rung].offset + begin, bytes: endOf(parts.at(-1)!) - begin }, {
            kind: 'texture', once: this.reader_.form !== 'files', signal, onBytes: reportArrived,
          });
      for (const p of parts)
        p.job.streams[p.rung - p.job.first] = got.subarray(p.offset - begin, endOf(p) - begin);
      reportArrived(Infinity);
      for (const p of parts) if (p.job.missing === 0 && !p.job.streams.includes(undefined as never))
        void this.decode_(p.job, signal);
    } catch (error) {
      parts.forEach((p, i) => {
        if (p.job.failed) return;
        p.job.failed = true;
        if (i < reported && p.job.missing === 0) this.hooks_.lost(p.job.wish, error);
        else failed(p.job.wish, error);
      });
    }
  }

  private async decode_(job: Job, signal?: AbortSignal): Promise<void> {
    const { plane, fragment, rung } = job.wish;
    ++this.pending;
    try {
      const levels = await this.decodeStreams_(job, signal).catch(async (error: unknown) => {
        if (!(error instanceof FormatError) || this.filesOf(plane).complete) throw error;
        // A fragment damaged on the way is asked for once more, by itself, past caches and bad mirrors.
        this.heldStreams_.delete(`${plane}/${fragment}`);
        for (let r = job.first; r <= rung; ++r)
          job.streams[r - job.first] = await this.reader_.fragment(plane, r, fragment, signal);
        return this.decodeStreams_(job, signal);
      });
      this.hooks_.decoded(job.wish, levels);
    } catch (error) {
      this.hooks_.lost(job.wish, error);
    } finally {
      --this.pending;
    }
  }
  private async decodeStreams_({ wish, first, streams }: Job, signal?: AbortSignal): Promise<Levels> {
    const { plane, fragment, rung } = wish;
    const { tables: t, complete } = this.filesOf(plane);
    const blocks = this.hooks_.blocks?.(wish);
    const { codec, fragmentWidthPx, fragmentHeightPx, widthPx, heightPx } = this.textures_[plane];
    const digestOf = (at: number): Uint8Array => t.digest.subarray(8 * at, 8 * at + 8);
    const levels = await this.pool_.decode({
      codec,
      tables: complete ? new Uint8Array(0) : await this.reader_.tableStream(plane, first, signal),
      streams,
      digests: complete ? [complete[rung].get(fragment)!.sha256]
        : streams.map((_, i) => digestOf((first + i) * fragmentCount(t) + fragment)),
      complete: !!complete,
      levels: blocks ? 1 : ownLevels,
      blocks,
      // The GPU can hold the plane, so the plane bounds the picture; an only fragment may have any sides.
      most: [Math.min(fragmentWidthPx, widthPx + beyondPx), Math.min(fragmentHeightPx, heightPx + beyondPx)],
    });
    if (t.incremental && !complete) this.heldStreams_.set(`${plane}/${fragment}`, streams);
    return levels;
  }

  dispose(): void {
    this.heldStreams_.clear();
    this.planes_.clear();
  }
}

const endOf = (p: Part): number => p.offset + p.bytes;

/** Parts of one rung that stand together (or nearly) become one range. */
function groupsOf(parts: readonly Part[], { gapBytes, mostBytes }: GroupOptions): Part[][] {
  const sorted =
    [...parts].sort((a, b) => a.job.wish.plane - b.job.wish.plane || a.rung - b.rung || a.offset - b.offset);
  const groups: Part[][] = [];
  sorted.forEach((p, i) => {
    const before = sorted[i - 1];
    const group = groups[groups.length - 1];
    const joins = before?.job.wish.plane === p.job.wish.plane && before.rung === p.rung &&
      p.offset - endOf(before) <= gapBytes;
    if (joins && endOf(p) - group[0].offset <= mostBytes) group.push(p);
    else groups.push([p]);
  });
  return groups;
}
