import { FormatError } from './errors';
import { abortError } from './http';
import type {
  DecodeRequest, DocumentDecoder, EnlargeRequest, Levels, SplitInfo, SplitUpdate, WorkerAnswer, WorkerRequest,
} from './worker_protocol';

/** Images decoded at once, over all workers and loads of a page. */
const mostAtOnce = 8;

interface Job {
  request: WorkerRequest;
  /** Only this worker may take it: splits are decoded where their stream was opened. */
  worker?: number;
  done: (result: unknown) => void;
  failed: (error: unknown) => void;
}

/** What waits for its turn, of all loads, and how many are under way. */
let queue: { pool: WorkerPool; job: Job }[] = [];
let running = 0;
function pump(): void {
  while (queue.length > 0 && running < mostAtOnce) {
    const { pool, job } = queue.shift()!;
    pool.post(job);
  }
}

/** What is posted takes all of its buffer along, be it the whole package: so in one of its own. */
const alone = (b: Uint8Array): Uint8Array => (b.length < b.buffer.byteLength ? b.slice() : b);

function closeBitmaps(result: unknown): void {
  if (Array.isArray(result)) for (const b of result) (b as Partial<ImageBitmap>).close?.();
}

/** Answers requests; a Worker, or the main thread where there is none. */
interface Helper {
  post(id: number, request: WorkerRequest): void;
  end(): void;
}
type OnAnswer = (answer: WorkerAnswer) => void;
/** What workers do, on the page's own thread: `handle` of texmesh/worker. */
export type DecodeHere = (request: WorkerRequest) => Promise<[unknown, Transferable[]]>;

function startWorker(url: string | URL | undefined, onAnswer: OnAnswer, onBroken: () => void): Helper {
  // Written so that bundlers see it.
  const worker = url
    ? new Worker(url, { type: 'module' })
    : new Worker(new URL('./worker.js', import.meta.url), { type: 'module' });
  worker.onmessage = (event: MessageEvent<WorkerAnswer>) => onAnswer(event.data);
  worker.onerror = (event) => {
    event.preventDefault();
    onBroken();
  };
  return {
    post: (id, request) => worker.postMessage({ ...request, id }),
    end: () => worker.terminate(),
  };
}

function startHere(handle: DecodeHere, onAnswer: OnAnswer): Helper {
  return {
    post: (id, request) => {
      Promise.resolve(request)
        .then(handle)
        .then(
          ([result]) => onAnswer({ id, result }),
          (error: unknown) => onAnswer({ id, failed: error }),
        );
    },
    end: () => undefined,
  };
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
  private readonly running_ = new Map<number, { job: Job; worker: number }>();
  private readonly broken_ = new Set<number>(); // whose workers broke once
  private works_ = false; // a worker has answered
  private nextId_ = 1;
  private ended_ = false;
  /** Nothing can be decoded: there are no workers, and no `decode`. `onNone` hears of it, once. */
  none = false;
  onNone?: (error: Error) => void;

  constructor(private readonly options_: PoolOptions = {}) {
    const cores = globalThis.navigator?.hardwareConcurrency ?? 2;
    const count = Math.max(1, options_.workers ?? Math.min(4, Math.max(2, cores - 1)));
    const here = options_.decode !== undefined || typeof Worker === 'undefined';
    for (let i = 0; i < (here ? 1 : count); ++i) this.helpers_.push(here ? this.startMain_() : this.start_(i));
  }

  private start_(index: number): Helper {
    try {
      return startWorker(this.options_.workerUrl, (a) => this.answered_(a), () => this.replace_(index));
    } catch {
      return this.startMain_(); // a page whose policy forbids workers
    }
  }
  private startMain_(): Helper {
    return startHere(this.options_.decode ?? (() => this.missing_()), (a) => this.answered_(a));
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
    this.helpers_[index].end();
    this.helpers_[index] = again && !this.works_ ? this.startMain_() : this.start_(index);
    this.broken_.add(index);
    for (const [id, r] of this.running_) {
      if (r.worker !== index) continue;
      if (again && this.works_) this.answered_({ id, failed: new Error('a worker broke') });
      else this.helpers_[index].post(id, r.job.request);
    }
  }

  private answered_(answer: WorkerAnswer): void {
    const entry = this.running_.get(answer.id);
    if (!entry) return closeBitmaps(answer.result); // nobody waits for it any more
    this.works_ ||= !answer.failed;
    this.running_.delete(answer.id);
    --running;
    const { error } = answer;
    if (answer.failed !== undefined) entry.job.failed(answer.failed);
    else if (!error) entry.job.done(answer.result);
    else if (error.parts) entry.job.failed(new FormatError(...error.parts));
    else entry.job.failed(Object.assign(new Error(error.message), { name: error.name }));
    pump();
  }

  /** Gives a job whose turn it is to the worker that has least to do. */
  post(job: Job): void {
    const busy = this.helpers_.map(() => 0);
    for (const r of this.running_.values()) ++busy[r.worker];
    const worker = job.worker ?? busy.indexOf(Math.min(...busy));
    const id = this.nextId_++;
    this.running_.set(id, { job, worker });
    ++running;
    try {
      // Copied, not handed over: a worker that breaks gives its requests back.
      this.helpers_[worker].post(id, job.request);
    } catch (failed) {
      this.answered_({ id, failed }); // what cannot be copied takes nobody's turn
    }
  }

  private ask_(request: WorkerRequest, worker?: number): Promise<unknown> {
    return new Promise((done, failed) => {
      if (this.ended_) return failed(abortError());
      const job = { request, worker, done, failed };
      if (request.op === 'document') return this.post(job); // everything waits for it
      queue.push({ pool: this, job });
      pump();
    });
  }

  /** See PackageReader.decodeDocument. */
  readonly decodeDocument: DocumentDecoder = (name, ...args) => {
    const own = (args as unknown[]).map((a) => (a instanceof Uint8Array ? alone(a) : a));
    return this.ask_({ op: 'document', name, args: own }) as ReturnType<typeof this.decodeDocument<typeof name>>;
  };
  decode({ streams, tables, ...request }: Omit<DecodeRequest, 'op'>): Promise<Levels> {
    return this.ask_({ op: 'decode', ...request, tables: alone(tables), streams: streams.map(alone) }) as Promise<Levels>;
  }
  enlarge(request: Omit<EnlargeRequest, 'op'>): Promise<Levels> {
    return this.ask_({ op: 'enlarge', ...request }) as Promise<Levels>;
  }
  openSplits(key: number, head: Uint8Array): Promise<SplitInfo> {
    return this.ask_({ op: 'split-open', key, head: alone(head) }, 0) as Promise<SplitInfo>;
  }
  /** FormatError where whole blocks from a place of the stream on are not those of its head. */
  checkSplits(key: number, from: number, blocks: Uint8Array): Promise<void> {
    return this.ask_({ op: 'split-check', key, from, blocks: alone(blocks) }, 0) as Promise<void>;
  }
  addSplits(key: number, blocks: Uint8Array): Promise<SplitUpdate> {
    return this.ask_({ op: 'split-add', key, blocks: alone(blocks) }, 0) as Promise<SplitUpdate>;
  }
  closeSplits(key: number): void {
    if (!this.ended_) this.ask_({ op: 'split-close', key }, 0).catch(() => undefined);
  }
  private get waiting_(): Job[] {
    return queue.filter(({ pool }) => pool === this).map(({ job }) => job);
  }
  /** Requests under way or waiting. */
  get pending(): number {
    return this.waiting_.length + this.running_.size;
  }
  dispose(): void {
    this.ended_ = true;
    for (const h of this.helpers_) h.end();
    const error = abortError();
    for (const { job } of this.running_.values()) job.failed(error);
    for (const job of this.waiting_) job.failed(error);
    queue = queue.filter(({ pool }) => pool !== this);
    running -= this.running_.size;
    this.running_.clear();
    pump();
  }
}
