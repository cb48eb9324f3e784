import type { DocumentDecoder } from '../format/document_decoder';
import { FormatError, abortError } from '../format/errors';
import type { DecodeRequest, EnlargeRequest, Levels, SplitInfo, SplitUpdate, WorkerAnswer, WorkerRequest } from './protocol';

/** Images decoded at once, over all workers and loads of a page. */
const mostAtOnce = 8;

interface Job {
  pool: WorkerPool;
  request: WorkerRequest & { id: number };
  /** Whose it is; undefined: it waits for its turn. */
  worker?: number;
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

/** See workerPool. */
export type WorkerPool = ReturnType<typeof workerPool>;

/** Workers that decode documents, images and vertex splits. */
export function workerPool({ workerUrl, decode, workers }: PoolOptions = {}) {
  const helpers: Helper[] = [];
  const jobs = new Map<number, Job>();
  const broken = new Set<number>(); // whose workers broke once
  const here = decode !== undefined || typeof Worker === 'undefined';
  let works = false; // a worker has answered
  let lastId = 0;
  let ended = false;

  function start(index: number): Helper {
    try {
      // Written so that bundlers see it.
      const worker = workerUrl ? new Worker(workerUrl, { type: 'module' }) : new Worker(new URL('./worker.js', import.meta.url), { type: 'module' });
      worker.onmessage = (event: MessageEvent<WorkerAnswer>) => answered(event.data);
      worker.onerror = (event) => {
        event.preventDefault();
        replace(index);
      };
      return worker;
    } catch {
      return startHere(); // a page whose policy forbids workers
    }
  }
  function startHere(): Helper {
    return {
      postMessage: async ({ id, ...request }) => {
        try {
          await null; // as later as a worker would
          answered({ id, result: (await (decode ?? missing)(request as WorkerRequest))[0] });
        } catch (failed) {
          answered({ id, failed });
        }
      },
      terminate: () => undefined,
    };
  }
  function missing(): never {
    const error = new Error('workers cannot be had here: give `workerUrl`, the address of dist/worker.js, or `decode`, the `handle` of texmesh/worker');
    if (!pool.none) pool.onNone?.(error);
    pool.none = true;
    throw error;
  }
  /** A worker that breaks gives its jobs to another one; where that breaks, too, they fail, or there are no workers here at all. */
  function replace(index: number): void {
    if (ended) return;
    const again = broken.has(index);
    broken.add(index);
    helpers[index].terminate();
    helpers[index] = again && !works ? startHere() : start(index);
    // Those of now: each that fails gives another one its turn.
    for (const { request } of [...jobs.values()].filter((job) => job.worker === index)) {
      if (again && works) answered({ id: request.id, failed: new Error('a worker broke') });
      else helpers[index].postMessage(request);
    }
  }

  function answered({ id, result, failed, error }: WorkerAnswer): void {
    const job = jobs.get(id);
    if (!job) {
      if (Array.isArray(result)) for (const b of result as Partial<ImageBitmap>[]) b.close?.(); // nobody waits for them any more
      return;
    }
    works ||= !failed;
    jobs.delete(id);
    --running;
    if (failed) job.failed(failed);
    else if (!error) job.done(result);
    else job.failed(error.parts ? new FormatError(...error.parts) : Object.assign(new Error(error.message), { name: error.name }));
    pump();
  }

  function ask<T>(asked: WorkerRequest): Promise<T> {
    const own = Object.fromEntries(Object.entries(asked).map(([name, value]) => [name, alone(value)]));
    return new Promise((done, failed) => {
      if (ended) return failed(abortError());
      const request = { ...own, id: ++lastId } as Job['request'];
      const job = { pool, request, done: done as Job['done'], failed };
      jobs.set(lastId, job);
      if (request.op === 'document') return pool.post(job); // everything waits for it
      queue.push(job);
      pump();
    });
  }

  const pool = {
    /** Nothing can be decoded: there are no workers, and no `decode`. `onNone` hears of it, once. */
    none: false,
    onNone: undefined as ((error: Error) => void) | undefined,
    /** To so many workers; left out: 2 to 4, by the number of cores. */
    grow(count = Math.min(4, Math.max(2, (globalThis.navigator?.hardwareConcurrency ?? 2) - 1))): void {
      for (let i = helpers.length; i < 1 || (!here && i < count); ++i) helpers.push(here ? startHere() : start(i));
    },
    /** Finds out early whether there is anything that decodes. */
    start: () => pool.closeSplits(0),
    /** Gives a job whose turn it is to the worker that has least to do; splits are decoded where their stream was opened. */
    post(job: Job): void {
      const busy = helpers.map(() => 0);
      for (const { worker = -1 } of jobs.values()) if (worker >= 0) ++busy[worker];
      job.worker = job.request.op.startsWith('split') ? 0 : busy.indexOf(Math.min(...busy));
      ++running;
      try {
        helpers[job.worker].postMessage(job.request); // copied, not handed over: a worker that breaks gives its requests back
      } catch (failed) {
        answered({ id: job.request.id, failed }); // what cannot be copied takes nobody's turn
      }
    },

    /** See PackageReader.decodeDocument. */
    decodeDocument: ((name, ...args) => ask({ op: 'document', name, args })) as DocumentDecoder,
    decode: (request: Omit<DecodeRequest, 'op'>) => ask<Levels>({ op: 'decode', ...request }),
    enlarge: (request: Omit<EnlargeRequest, 'op'>) => ask<Levels>({ op: 'enlarge', ...request }),
    openSplits: (key: number, head: Uint8Array) => ask<SplitInfo>({ op: 'split-open', key, head }),
    /** FormatError where whole blocks from a place of the stream on are not those of its head. */
    checkSplits: (key: number, from: number, blocks: Uint8Array) => ask<void>({ op: 'split-check', key, from, blocks }),
    addSplits: (key: number, blocks: Uint8Array) => ask<SplitUpdate>({ op: 'split-add', key, blocks }),
    closeSplits: (key: number): void => void ask({ op: 'split-close', key }).catch(() => undefined),
    /** Requests under way or waiting. */
    pending: () => jobs.size,
    dispose(): void {
      ended = true;
      helpers.forEach((h) => h.terminate());
      queue = queue.filter((job) => job.pool !== pool);
      for (const { worker, failed } of jobs.values()) {
        if (worker !== undefined) --running;
        failed(abortError());
      }
      jobs.clear();
      pump();
    },
  };
  pool.grow(workers);
  return pool;
}
