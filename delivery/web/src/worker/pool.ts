import type { DocumentDecoder } from '../format/document_decoder';
import { FormatError, abortError } from '../format/errors';
import { type Helper, type SharedWorkers, type WorkerEvents, startWorker } from './shared_workers';
import type {
  DecodeRequest, EnlargeRequest, Levels, PixelsRequest, SplitInfo, SplitUpdate, WorkerAnswer, WorkerRequest,
} from './protocol';

/** Images decoded at once, over all workers and loads of a page. */
const mostAtOnce = 8;

interface Job {
  pool: WorkerPool;
  request: WorkerRequest & { id: number };
  /** The worker that has the job; undefined: the job waits for its turn. */
  worker?: number;
  done: (result: unknown) => void;
  failed: (error: unknown) => void;
}

/** Jobs of all loads that wait for their turn, and how many are under way. */
let queue: Job[] = [];
let running = 0;
let turns = 0;
function postWaitingJobs(): void {
  while (queue.length > 0 && running < mostAtOnce) {
    // A preview is enlarged when nothing better waits: what comes meanwhile needs none. But its texture shows
    // nothing of that before the first piece has been made, so every fourth turn belongs to whoever waits
    // longest.
    const next = ++turns % 4 === 0 ? 0
      : Math.max(0, queue.findIndex(({ request }) => request.op !== 'enlarge'));
    const [job] = queue.splice(next, 1);
    job.pool.post(job);
  }
}

/** A value whose byte arrays have their own buffers: posting takes a whole buffer, maybe the package. */
function inBuffersOfItsOwn(value: unknown): unknown {
  if (Array.isArray(value)) return value.map(inBuffersOfItsOwn);
  return value instanceof Uint8Array && value.length < value.buffer.byteLength ? value.slice() : value;
}

/** Does the work of workers on the page's own thread: `handle` of texmesh/worker. */
export type DecodeHere = (request: WorkerRequest) => Promise<[unknown, Transferable[]]>;
/** See LoadOptions. */
export interface PoolOptions {
  workers?: number;
  workerUrl?: string | URL;
  /** Decodes instead of workers. */
  decode?: DecodeHere;
  /** Workers that other pools use, too, instead of workers of one's own. */
  shared?: SharedWorkers;
}

/** Workers that decode documents, images and vertex splits. */
export class WorkerPool {
  /** Nothing can be decoded: there are no workers, and no `decode`. `onUnavailable` hears of that, once. */
  isUnavailable = false;
  onUnavailable?: (error: Error) => void;
  private readonly helpers_: Helper[] = [];
  private readonly jobs_ = new Map<number, Job>();
  private readonly brokeOnce_ = new Set<number>(); // indices of helpers
  private readonly onThisThread_: boolean;
  private hasAnswered_ = false; // a worker has answered
  private lastId_ = 0;
  private ended_ = false;
  private readonly firstShared_: number;

  constructor(private readonly options_: PoolOptions = {}) {
    this.firstShared_ = options_.shared?.nextPool() ?? 0;
    this.onThisThread_ = options_.decode !== undefined || typeof Worker === 'undefined';
    this.grow(options_.workers);
  }

  /** Grows the pool to so many workers; left out: 2 to 4, by the number of cores. */
  grow(count = Math.min(4, Math.max(2, (globalThis.navigator?.hardwareConcurrency ?? 2) - 1))): void {
    const { helpers_: helpers } = this;
    for (let i = helpers.length; i < 1 || (!this.onThisThread_ && i < count); ++i)
      helpers.push(this.onThisThread_ ? this.startHere_() : this.startWorker_(i));
  }
  /** Finds out early whether there is anything that decodes. */
  start(): void {
    this.closeSplits(0);
  }

  // ---- requests

  /** See PackageReader.decodeDocument. */
  readonly decodeDocument = ((name, ...args) => this.ask_({ op: 'document', name, args })) as DocumentDecoder;

  decode(request: Omit<DecodeRequest, 'op'>): Promise<Levels> {
    return this.ask_({ op: 'decode', ...request });
  }
  enlarge(request: Omit<EnlargeRequest, 'op'>): Promise<Levels> {
    return this.ask_({ op: 'enlarge', ...request });
  }
  /** Blocks of a picture that is no file. */
  blocksOf(request: Omit<PixelsRequest, 'op'>): Promise<Levels> {
    return this.ask_({ op: 'blocks', ...request });
  }
  openSplits(key: number, head: Uint8Array): Promise<SplitInfo> {
    return this.ask_({ op: 'split-open', key, head });
  }
  /** FormatError where whole blocks, from a place of the stream on, have other digests than the head says. */
  checkSplits(key: number, from: number, blocks: Uint8Array): Promise<void> {
    return this.ask_({ op: 'split-check', key, from, blocks });
  }
  addSplits(key: number, blocks: Uint8Array, tangents: number[] = []): Promise<SplitUpdate> {
    return this.ask_({ op: 'split-add', key, blocks, tangents });
  }
  closeSplits(key: number): void {
    this.ask_({ op: 'split-close', key }).catch(() => undefined);
  }
  /** Requests under way or waiting. */
  pending(): number {
    return this.jobs_.size;
  }
  dispose(): void {
    // or the worker keeps the stream
    if (this.options_.shared) for (const job of queue)
      if (job.pool === this && job.request.op === 'split-close') this.post(job);
    this.ended_ = true;
    this.helpers_.forEach((h) => h.terminate());
    queue = queue.filter((job) => job.pool !== this);
    for (const { worker, failed } of this.jobs_.values()) {
      if (worker !== undefined) --running;
      failed(abortError());
    }
    this.jobs_.clear();
    postWaitingJobs();
  }

  private ask_<T>(asked: WorkerRequest): Promise<T> {
    const copied =
      Object.fromEntries(Object.entries(asked).map(([name, value]) => [name, inBuffersOfItsOwn(value)]));
    return new Promise((done, failed) => {
      if (this.ended_) return failed(abortError());
      const request = { ...copied, id: ++this.lastId_ } as Job['request'];
      const job = { pool: this, request, done: done as Job['done'], failed };
      this.jobs_.set(this.lastId_, job);
      if (request.op === 'document') return this.post(job); // everything waits for documents
      queue.push(job);
      postWaitingJobs();
    });
  }
  /** Gives a job to the worker that has least to do; splits go where their stream was opened. */
  post(job: Job): void {
    const busy = this.helpers_.map(() => 0);
    for (const { worker = -1 } of this.jobs_.values()) if (worker >= 0) ++busy[worker];
    job.worker = job.request.op.startsWith('split') ? 0 : busy.indexOf(Math.min(...busy));
    ++running;
    try {
      // copied, not handed over: a worker that breaks gives its requests back
      this.helpers_[job.worker].postMessage(job.request);
    } catch (failed) {
      this.answered_({ id: job.request.id, failed }); // a request that cannot be copied takes nobody's turn
    }
  }
  private answered_({ id, result, failed, error }: WorkerAnswer): void {
    const job = this.jobs_.get(id);
    if (!job) {
      // nobody waits for them any more
      if (Array.isArray(result)) for (const b of result as Partial<ImageBitmap>[]) b.close?.();
      return;
    }
    this.hasAnswered_ ||= !failed;
    this.jobs_.delete(id);
    --running;
    if (failed) job.failed(failed);
    else if (!error) job.done(result);
    else job.failed(error.parts ? new FormatError(...error.parts)
      : Object.assign(new Error(error.message), { name: error.name }));
    postWaitingJobs();
  }

  // ---- workers

  private startWorker_(index: number): Helper {
    const { shared, workerUrl } = this.options_;
    const events: WorkerEvents = { answered: (answer) => this.answered_(answer),
      broke: () => this.replace_(index) };
    try {
      return shared?.helper(this.firstShared_ + index, events) ?? startWorker(workerUrl, events);
    } catch {
      return this.startHere_(); // a page whose policy forbids workers
    }
  }
  private startHere_(): Helper {
    const decode = this.options_.decode ?? (() => this.missing_());
    return {
      postMessage: async ({ id, ...request }) => {
        try {
          await null; // as later as a worker would
          this.answered_({ id, result: (await decode(request as WorkerRequest))[0] });
        } catch (failed) {
          this.answered_({ id, failed });
        }
      },
      terminate: () => undefined,
    };
  }
  private missing_(): never {
    const error = new Error('workers cannot be had here: give `workerUrl`, the address of dist/worker.js, ' +
      'or `decode`, the `handle` of texmesh/worker');
    if (!this.isUnavailable) this.onUnavailable?.(error);
    this.isUnavailable = true;
    throw error;
  }
  /**
   * Gives the jobs of a worker that broke to another one. Where that one breaks, too, the jobs fail, or there
   * are no workers here at all.
   */
  private replace_(index: number): void {
    if (this.ended_) return;
    const again = this.brokeOnce_.has(index);
    this.brokeOnce_.add(index);
    this.helpers_[index].terminate();
    this.helpers_[index] = again && !this.hasAnswered_ ? this.startHere_() : this.startWorker_(index);
    // The jobs of now: each that fails gives another one its turn.
    for (const { request } of [...this.jobs_.values()].filter((job) => job.worker === index)) {
      if (again && this.hasAnswered_) this.answered_({ id: request.id, failed: new Error('a worker broke') });
      else this.helpers_[index].postMessage(request);
    }
  }
}
