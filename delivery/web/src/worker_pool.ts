import { FormatError } from './errors';
import type { SplitUpdate, WorkerAnswer, WorkerRequest } from './worker_protocol';

/** Images decoded at once, over all workers. */
const mostAtOnce = 8;

interface Job {
  request: WorkerRequest;
  transfer: Transferable[];
  /** Only this worker may take it: splits are decoded where their stream was opened. */
  worker?: number;
  done: (result: unknown) => void;
  failed: (error: unknown) => void;
}

/** Answers requests; a Worker, or the main thread where there is none. */
interface Helper {
  post(id: number, request: WorkerRequest, transfer: Transferable[]): void;
  end(): void;
}
type OnAnswer = (answer: WorkerAnswer) => void;
type Handle = (request: WorkerRequest) => Promise<[unknown, Transferable[]]>;

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
    post: (id, request, transfer) => worker.postMessage({ ...request, id }, transfer),
    end: () => worker.terminate(),
  };
}

function startHere(handle: Promise<Handle>, onAnswer: OnAnswer): Helper {
  return {
    post: (id, request) => {
      handle
        .then((answer) => answer(request))
        .then(
          ([result]) => onAnswer({ id, result }),
          (error: unknown) => onAnswer({ id, error: { name: 'Error', message: String((error as Error).message) } }),
        );
    },
    end: () => undefined,
  };
}

export interface PoolOptions {
  workers?: number;
  /** '' = no workers. */
  workerUrl?: string | URL;
  /** Instead of workers, for tests. */
  handle?: Handle;
}

/** Workers that decode images and vertex splits. */
export class WorkerPool {
  private readonly helpers: Helper[] = [];
  private readonly queue: Job[] = [];
  private readonly running = new Map<number, { job: Job; worker: number }>();
  private readonly load: number[] = [];
  private nextId = 1;
  private ended = false;

  constructor(private readonly options: PoolOptions = {}) {
    const cores = globalThis.navigator?.hardwareConcurrency ?? 2;
    const count = Math.max(1, options.workers ?? Math.min(4, Math.max(2, cores - 1)));
    const here = options.handle !== undefined || options.workerUrl === '' || typeof Worker === 'undefined';
    for (let i = 0; i < (here ? 1 : count); ++i) {
      this.helpers.push(here ? this.startMain() : this.start(i));
      this.load.push(0);
    }
  }

  private start(index: number): Helper {
    const url = this.options.workerUrl;
    try {
      return startWorker(url === '' ? undefined : url, (a) => this.answered(a), () => this.replace(index));
    } catch {
      return this.startMain(); // a page whose policy forbids workers
    }
  }
  private startMain(): Helper {
    const url = this.options.workerUrl || new URL('./worker.js', import.meta.url).href;
    const handle = this.options.handle
      ? Promise.resolve(this.options.handle)
      : (import(/* @vite-ignore */ String(url)) as Promise<{ handle: Handle }>).then((m) => m.handle);
    return startHere(handle, (a) => this.answered(a));
  }
  /** A worker that cannot be loaded gives its jobs to the main thread. */
  private replace(index: number): void {
    if (this.ended) return;
    this.helpers[index].end();
    this.helpers[index] = this.startMain();
    for (const [id, r] of this.running)
      if (r.worker === index) this.helpers[index].post(id, r.job.request, []);
  }

  private answered(answer: WorkerAnswer): void {
    const entry = this.running.get(answer.id);
    if (!entry) return;
    this.running.delete(answer.id);
    --this.load[entry.worker];
    const { error } = answer;
    if (!error) entry.job.done(answer.result);
    else if (error.parts) entry.job.failed(new FormatError(...error.parts));
    else entry.job.failed(Object.assign(new Error(error.message), { name: error.name }));
    this.pump();
  }

  private pump(): void {
    while (this.queue.length > 0 && this.running.size < mostAtOnce) {
      const job = this.queue.shift()!;
      let worker = job.worker ?? 0;
      if (job.worker === undefined) this.load.forEach((n, i) => (worker = n < this.load[worker] ? i : worker));
      ++this.load[worker];
      this.running.set(this.nextId, { job, worker });
      // Copied, not handed over: a worker that breaks gives its requests back.
      this.helpers[worker].post(this.nextId++, job.request, job.transfer);
    }
  }

  private ask(request: WorkerRequest, worker?: number): Promise<unknown> {
    return new Promise((done, failed) => {
      if (this.ended) return failed(new DOMException('The load was cancelled', 'AbortError'));
      this.queue.push({ request, transfer: [], worker, done, failed });
      this.pump();
    });
  }

  decode(request: Omit<Extract<WorkerRequest, { op: 'decode' }>, 'op'>): Promise<ImageBitmap> {
    return this.ask({ op: 'decode', ...request }) as Promise<ImageBitmap>;
  }
  async openSplits(key: number, head: Uint8Array): Promise<void> {
    await this.ask({ op: 'split-open', key, head }, 0);
  }
  addSplits(key: number, blocks: Uint8Array): Promise<SplitUpdate> {
    return this.ask({ op: 'split-add', key, blocks }, 0) as Promise<SplitUpdate>;
  }
  /** Requests under way or waiting. */
  get pending(): number {
    return this.queue.length + this.running.size;
  }
  dispose(): void {
    this.ended = true;
    for (const h of this.helpers) h.end();
    const error = new DOMException('The load was cancelled', 'AbortError');
    for (const { job } of this.running.values()) job.failed(error);
    for (const job of this.queue) job.failed(error);
    this.running.clear();
    this.queue.length = 0;
  }
}
