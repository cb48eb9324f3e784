import type { WorkerAnswer, WorkerRequest } from './protocol';

/** What a pool hears of a worker. */
export interface WorkerEvents {
  answered(answer: WorkerAnswer): void;
  /** The worker is there no more; requests to it that have no answer will get none. */
  broke(): void;
}
/** A worker as a pool has it. */
export interface Helper {
  postMessage(request: WorkerRequest & { id: number }): void;
  terminate(): void;
}
/** A worker and those who use it. */
interface Shared {
  worker: Worker;
  users: Set<WorkerEvents>;
}

/** Starts a worker that tells `events`. Throws where a page may have none. */
export function startWorker(workerUrl: string | URL | undefined, events: WorkerEvents): Worker {
  // Bundlers see a worker that is written so.
  const worker = workerUrl ? new Worker(workerUrl, { type: 'module' })
    : new Worker(new URL('./worker.js', import.meta.url), { type: 'module' });
  worker.onmessage = (event: MessageEvent<WorkerAnswer>) => events.answered(event.data);
  worker.onerror = (event) => {
    event.preventDefault();
    events.broke();
  };
  return worker;
}

/** Workers that several pools use: a page with twenty models has no twenty workers for each of them. */
export class SharedWorkers {
  private readonly workers_: (Shared | undefined)[];
  private readonly asked_ = new Map<number, { id: number; user: WorkerEvents }>();
  private lastId_ = 0;
  private pools_ = 0;

  /** `count` >= 1; workers start when a pool first asks for them. */
  constructor(count: number, private readonly workerUrl_?: string | URL) {
    this.workers_ = new Array<undefined>(Math.max(1, Math.floor(count))).fill(undefined);
  }

  /** Called once by each pool: its first worker, so that not all pools begin with the same one. */
  nextPool(): number {
    return this.pools_++;
  }
  /** Worker `index`, counted round, for one pool. Throws where a page may have none. */
  helper(index: number, user: WorkerEvents): Helper {
    const at = index % this.workers_.length;
    const shared = (this.workers_[at] ??= this.start_(at));
    shared.users.add(user);
    return {
      postMessage: (request) => {
        this.asked_.set(++this.lastId_, { id: request.id, user });
        shared.worker.postMessage({ ...request, id: this.lastId_ });
      },
      terminate: () => void shared.users.delete(user), // what the worker still answers is closed by the pool
    };
  }
  /** Ends all workers. */
  dispose(): void {
    for (const shared of this.workers_) shared?.worker.terminate();
    this.workers_.fill(undefined);
    this.asked_.clear();
  }

  private start_(at: number): Shared {
    const users = new Set<WorkerEvents>();
    const worker = startWorker(this.workerUrl_, {
      answered: (answer) => {
        const asked = this.asked_.get(answer.id);
        this.asked_.delete(answer.id);
        asked?.user.answered({ ...answer, id: asked.id });
      },
      broke: () => {
        this.workers_[at]?.worker.terminate();
        this.workers_[at] = undefined;
        for (const user of [...users]) user.broke();
      },
    });
    return { worker, users };
  }
}
