import type { Object3D } from 'three';
import { InputError } from './format/errors';
import { nowS } from './http/requests';
import { OpenOptions, PackageReader } from './http/package_reader';
import type { LoadOptions, LoadedModel } from './scene/api';
import { loadModel } from './scene/load';
import { PoolOptions, WorkerPool } from './worker/pool';
import type { SharedWorkers } from './worker/shared_workers';

export { FormatError, InputError, TexmeshError } from './format/errors';
export type * from './reader';
export type * from './scene/api';

/** Names that options may have; the library chooses options that are left out. */
const names = {
  policy: ['guard', 'thesis'],
  rule: ['flip', 'jnd', 'error', 'edge', 'distance'],
  meshes: ['glb', 'stream', 'auto'],
} as const;

/** A package that can be shown in three.js scenes. */
export class TexmeshPackage extends PackageReader {
  private readonly loads_ = new Set<LoadedModel>();
  private loaded_ = false;
  /** Workers for documents, until a load has the pool. */
  pool?: WorkerPool;
  /** Workers that loads use together with those of other packages; left out: workers of their own. */
  shared?: SharedWorkers;

  /**
   * Shows the package in a scene: at once at its coarsest, then as well as time and display allow. The time
   * of the first load counts from the package's first request, that of others from this call. InputError: an
   * option has a value that it cannot have.
   */
  load(scene: Object3D, options: LoadOptions): LoadedModel {
    const { time = 0, display } = options;
    for (const [name, all] of Object.entries(names)) {
      const said = options[name as keyof typeof names];
      if (said !== undefined && !(all as readonly string[]).includes(said))
        throw new InputError('options', name, all.join(', '), String(said));
    }
    if (!(time >= -Infinity)) throw new InputError('options', 'time', 'seconds', String(time));
    if (typeof display === 'number' && !(display >= 0))
      throw new InputError('options', 'display', 'pixels', String(display));
    let { pool } = this;
    if (!pool || pool.isUnavailable || options.workerUrl || options.decode) {
      pool?.dispose();
      pool = new WorkerPool({ ...options, shared: this.shared });
    } else pool.grow(options.workers);
    this.pool = pool; // until a load has the pool: options may be refused
    this.decodeDocument = pool.decodeDocument;
    const forget = (): void => void this.loads_.delete(load);
    const { rule = options.policy === 'thesis' ? 'distance' : undefined } = options;
    const load = loadModel(this, scene, { ...options, rule }, pool, this.loaded_ ? nowS() : this.openedS,
      forget);
    this.pool = undefined;
    this.loaded_ = true;
    this.loads_.add(load);
    return load;
  }

  /** Disposes of all loads and forgets the documents that were read. */
  override dispose(): void {
    for (const load of this.loads_) load.dispose();
    this.loads_.clear();
    this.pool?.dispose();
    super.dispose();
  }
}

/**
 * Opens a package: one request of 44 KiB, which brings most first pictures along. `url` is that of a .texmesh
 * file, or of the folder that `texmesh unpack` made of one, ending in a slash. InputError when the server
 * does not deliver, FormatError when it is no package.
 */
export async function open(url: string,
    options: OpenOptions & Omit<PoolOptions, 'workers'> = {}): Promise<TexmeshPackage> {
  const pool = new WorkerPool({ ...options, workers: 1 }); // the worker starts while the manifest comes
  try {
    const opened = await TexmeshPackage.openUrl(url, options, pool.decodeDocument);
    opened.pool = pool;
    opened.shared = options.shared;
    return opened;
  } catch (error) {
    pool.dispose();
    throw error;
  }
}
