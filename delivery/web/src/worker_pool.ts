import { FormatError } from './errors';
import { abortError } from './http';
import type {
  DecodeRequest, DocumentDecoder, EnlargeRequest, Levels, SplitInfo, SplitUpdate, WorkerAnswer, WorkerRequest,
} from './worker_protocol';

/** Images decoded at once, over all workers and loads of a page. */
const mostAtOnce = 8;

interface Job {
  pool: WorkerPool;
  id: number;
  request: WorkerRequest;
  /** Splits are decoded where their stream was opened: by the first worker. */
  pinned: boolean;
  /** Whose it is; -1: it waits for its turn. */
  worker: number;
  done: (result: unknown) => void;
  failed: (error: unknown) => void;
}

/** What waits for its turn, of all loads, and how many are under way. */
let queue: Job[] = [];
let running = 0;
function pump(): void {
  while (queue.length > 0 && running < mostAtOnce) {
    const job = queue.shift()!;
    job.pool.post(job);
  }
}

/** What is posted takes all of its buffer along, be it the whole package: so in one of its own. */
function alone(value: unknown): unknown {
  if (Array.isArray(value)) return value.map(alone);
  return value instanceof Uint8Array && value.length < value.buffer.byteLength ? value.slice() : value;
}

/** What workers do, on the page's own thread: `handle` of texmesh/worker. */
export type DecodeHere = (request: WorkerRequest) => Promise<[unknown, Transferable[]]>;
/** A worker, or the main thread where there is none. */
interface Helper {
  postMessage(request: WorkerRequest & { id: number }): void;
  terminate(): void;
}

/** See LoadOptions. */
export interface PoolOptions {
  workers?: number;
  workerUrl?: string | URL;
  /** Instead of workers. */
  decode?: DecodeHere;
}

/** Workers that decode documents, images and vertex splits. */
export class WorkerPool {
  private readonly helpers_: Helper[] = [];
  private readonly jobs_ = new Map<number, Job>();
  private readonly broken_ = new Set<number>(); // whose workers broke once
  private works_ = false; // a worker has answered
  private lastId_ = 0;
  private ended_ = false;
  /** Nothing can be decoded: there are no workers, and no `decode`. `onNone` hears of it, once. */
  none = false;
  onNone?: (error: Error) => void;

  constructor(private readonly options_: PoolOptions = {}) {
    this.grow(options_.workers);
  }
  /** To so many workers; left out: 2 to 4, by the number of cores. */
  grow(workers = Math.min(4, Math.max(2, (globalThis.navigator?.hardwareConcurrency ?? 2) - 1))): this {
    const here = this.options_.decode !== undefined || typeof Worker === 'undefined';
    for (let i = this.helpers_.length; i < 1 || (!here && i < workers); ++i) this.helpers_.push(here ? this.startHere_() : this.start_(i));
    return this;
  }

  private start_(index: number): Helper {
    const { workerUrl: url } = this.options_;
    try {
      // Written so that bundlers see it.
      const worker = url ? new Worker(url, { type: 'module' }) : new Worker(new URL('./worker.js', import.meta.url), { type: 'module' });
      worker.onmessage = (event: MessageEvent<WorkerAnswer>) => this.answered_(event.data);
      worker.onerror = (event) => {
        event.preventDefault();
        this.replace_(index);
      };
      return worker;
    } catch {
      return this.startHere_(); // a page whose policy forbids workers
    }
  }
  private startHere_(): Helper {
    const handle = this.options_.decode ?? (() => this.missing_());
    const postMessage: Helper['postMessage'] = async ({ id, ...request }) => {
      try {
        await undefined; // as later as a worker would
        this.answered_({ id, result: (await handle(request as WorkerRequest))[0] });
      } catch (failed) {
        this.answered_({ id, failed });
      }
    };
    return { postMessage, terminate: () => undefined };
  }
  private missing_(): never {
    const error = new Error('workers cannot be had here: give `workerUrl`, the address of dist/worker.js, or `decode`, the `handle` of texmesh/worker');
    if (!this.none) this.onNone?.(error);
    this.none = true;
    throw error;
  }
  /** Finds out early whether there is anything that decodes. */
  start(): void {
    this.closeSplits(0);
  }
  /** A worker that breaks gives its jobs to another one; where that breaks, too, they fail, or there are no workers here at all. */
  private replace_(index: number): void {
    if (this.ended_) return;
    const again = this.broken_.has(index);
    this.helpers_[index].terminate();
    this.helpers_[index] = again && !this.works_ ? this.startHere_() : this.start_(index);
    this.broken_.add(index);
    for (const job of this.jobs_.values()) {
      if (job.worker !== index) continue;
      if (again && this.works_) this.answered_({ id: job.id, failed: new Error('a worker broke') });
      else this.send_(job);
    }
  }

  private answered_({ id, result, failed, error }: WorkerAnswer): void {
    const job = this.jobs_.get(id);
    if (!job) {
      if (Array.isArray(result)) for (const b of result as Partial<ImageBitmap>[]) b.close?.(); // nobody waits for them any more
      return;
    }
    this.works_ ||= !failed;
    this.jobs_.delete(id);
    --running;
    if (failed) job.failed(failed);
    else if (!error) job.done(result);
    else job.failed(error.parts ? new FormatError(...error.parts) : Object.assign(new Error(error.message), { name: error.name }));
    pump();
  }

  /** Gives a job whose turn it is to the worker that has least to do. */
  post(job: Job): void {
    const busy = this.helpers_.map(() => 0);
    for (const { worker } of this.jobs_.values()) if (worker >= 0) ++busy[worker];
    job.worker = job.pinned ? 0 : busy.indexOf(Math.min(...busy));
    ++running;
    try {
      this.send_(job);
    } catch (failed) {
      this.answered_({ id: job.id, failed }); // what cannot be copied takes nobody's turn
    }
  }
  /** Copied, not handed over: a worker that breaks gives its requests back. */
  private send_({ worker, request, id }: Job): void {
    this.helpers_[worker].postMessage({ ...request, id });
  }

  private ask_(asked: WorkerRequest): Promise<unknown> {
    const request = Object.fromEntries(Object.entries(asked).map(([name, value]) => [name, alone(value)])) as unknown as WorkerRequest;
    return new Promise((done, failed) => {
      if (this.ended_) return failed(abortError());
      const job = { pool: this, id: ++this.lastId_, request, pinned: request.op.startsWith('split'), worker: -1, done, failed };
      this.jobs_.set(job.id, job);
      if (request.op === 'document') return this.post(job); // everything waits for it
      queue.push(job);
      pump();
    });
  }

  /** See PackageReader.decodeDocument. */
  readonly decodeDocument: DocumentDecoder = (name, ...args) =>
    this.ask_({ op: 'document', name, args }) as ReturnType<typeof this.decodeDocument<typeof name>>;
  decode(request: Omit<DecodeRequest, 'op'>): Promise<Levels> {
    return this.ask_({ op: 'decode', ...request }) as Promise<Levels>;
  }
  enlarge(request: Omit<EnlargeRequest, 'op'>): Promise<Levels> {
    return this.ask_({ op: 'enlarge', ...request }) as Promise<Levels>;
  }
  openSplits(key: number, head: Uint8Array): Promise<SplitInfo> {
    return this.ask_({ op: 'split-open', key, head }) as Promise<SplitInfo>;
  }
  /** FormatError where whole blocks from a place of the stream on are not those of its head. */
  checkSplits(key: number, from: number, blocks: Uint8Array): Promise<void> {
    return this.ask_({ op: 'split-check', key, from, blocks }) as Promise<void>;
  }
  addSplits(key: number, blocks: Uint8Array): Promise<SplitUpdate> {
    return this.ask_({ op: 'split-add', key, blocks }) as Promise<SplitUpdate>;
  }
  closeSplits(key: number): void {
    this.ask_({ op: 'split-close', key }).catch(() => undefined);
  }
  /** Requests under way or waiting. */
  get pending(): number {
    return this.jobs_.size;
  }
  dispose(): void {
    this.ended_ = true;
    for (const h of this.helpers_) h.terminate();
    queue = queue.filter(({ pool }) => pool !== this);
    for (const { worker, failed } of this.jobs_.values()) {
      if (worker >= 0) --running;
      failed(abortError());
    }
    this.jobs_.clear();
    pump();
  }
}
