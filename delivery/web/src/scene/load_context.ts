import { type Camera, Group, Vector2 } from 'three';
import { clamp } from '../decide/numbers';
import { InputError, abortError, isAbort, throwIfAborted } from '../format/errors';
import { nowS } from '../http/requests';
import type { PackageReader } from '../http/package_reader';
import type { WorkerPool } from '../worker/pool';
import type { Display, LoadEvents, LoadOptions, LoadPhase } from './api';
import { displayOf } from './camera';
import { Emitter } from './events';
import { GpuRoom } from './gpu';
import { MaterialSet } from './scale_parts';

/** The displayed height must change by this factor before another scale or plane is wanted. */
export const hysteresis = 1.1;
/** A longer time limit counts as none: timers and plans end there. */
const longestS = 1e5;
/** What is later than this share of the limit is given up. */
export const mostLate = 0.01;
/** Displayed height where nobody says one, device px. */
const defaultHeightPx = 1000;

/** Scale and rung that were chosen by hand, whatever display and time ask for. */
export interface Override {
  scale?: number;
  rung?: number;
}

/** The shared parts of one load: options, state, and events. */
export class LoadContext {
  readonly materials = new MaterialSet();
  /** The object in the scene. */
  readonly object = new Group();
  readonly events = new Emitter<LoadEvents>();
  readonly room: GpuRoom;
  /** Seconds from the load's start to the end of its timed part. */
  limitS: number;
  phase: LoadPhase = 'first-picture';
  override: Override;
  view: { display: Display; camera?: Camera };
  /** Throughput that the first transfers have shown. */
  beta0 = 0;
  /** Throughput that whoever gave the load its turn expects; 0: nobody has said. */
  expectedBytesS = 0;
  expectedBytes = 0;
  private lastView_ = '';
  private readonly abort_ = new AbortController();
  private readonly disposed_ = new AbortController();

  constructor(readonly reader: PackageReader, readonly options: LoadOptions, readonly pool: WorkerPool,
      private readonly startS_: number) {
    const { time = 5, camera } = options;
    this.room = GpuRoom.of(options.renderer);
    this.object.name = reader.manifest.title || 'texmesh';
    this.limitS = time > longestS ? Infinity : time;
    this.override = this.snapped(options);
    this.view = { display: this.displayFrom_(camera), camera };
  }

  /** Aborted when the load is cancelled, fails, or is disposed of. */
  get signal(): AbortSignal {
    return this.abort_.signal;
  }
  /** Aborted when the load is disposed of. */
  get disposal(): AbortSignal {
    return this.disposed_.signal;
  }
  /** The timed part is over, and nothing is wrong. */
  get resting(): boolean {
    return this.phase === 'refining' || this.phase === 'done';
  }
  /** Seconds since the load's start. */
  elapsedS(): number {
    return nowS() - this.startS_;
  }

  /** Aborts what the timed part waits for a little behind the limit, and at the end of the load. */
  async untilLimit<T>(wait: (signal: AbortSignal) => Promise<T>): Promise<T> {
    const late = new AbortController();
    const end = (): void => late.abort();
    const leftS = this.limitS * (1 + mostLate) - this.elapsedS();
    const timer = setTimeout(end, 1000 * clamp(leftS, 0, longestS));
    this.signal.addEventListener('abort', end);
    try {
      throwIfAborted(this.signal);
      return await wait(late.signal);
    } finally {
      clearTimeout(timer);
      this.signal.removeEventListener('abort', end);
    }
  }
  /** The timed part begins when whoever gives turns says so; `bytes` of it are fetched however long it is. */
  async turn(bytes: number): Promise<void> {
    const { options: { turn }, signal } = this;
    if (!turn) return;
    const cancelled = new Promise<never>((_, end) =>
      signal.addEventListener('abort', () => end(abortError()), { once: true }));
    const { seconds, bytesS = 0 } = await Promise.race([turn(bytes), cancelled]);
    throwIfAborted(signal);
    this.limitS = this.elapsedS() + seconds;
    this.expectedBytesS = bytesS;
  }
  /** Bytes that the load may take on the GPU. */
  get memoryBytes(): number {
    const { memoryBytes = Infinity } = this.options;
    return Math.min(typeof memoryBytes === 'function' ? memoryBytes() : memoryBytes, this.room.limitBytes);
  }

  // ---- events

  emit<K extends keyof LoadEvents>(name: K, event: Omit<LoadEvents[K], 'at'>): void {
    this.events.emit(name, event);
  }
  fail(error: unknown, what: string, fatal = false): void {
    if (isAbort(error) || this.disposal.aborted) return;
    this.emit('error',
      { fatal, what, message: error instanceof Error ? error.message : String(error), error });
  }
  progress(): void {
    const { received } = this.reader.client;
    this.emit('progress',
      { phase: this.phase, bytes: received, bytesExpected: Math.max(received, this.expectedBytes) });
  }
  enter(next: LoadPhase): void {
    throwIfAborted(this.signal);
    this.phase = next;
    this.progress();
  }
  cancel(): void {
    this.abort_.abort();
  }
  dispose(): void {
    this.disposed_.abort();
  }

  // ---- what is wanted

  /** The override with the nearest scale of the package. InputError: no whole number from 0 on. */
  snapped({ scale, rung }: Override): Override {
    for (const [name, v] of Object.entries({ scale, rung }))
      if (v !== undefined && !(Number.isInteger(v) && v >= 0))
        throw new InputError('options', name, 'a whole number from 0 on', String(v));
    const away = (k: number): number => Math.abs(k - scale!);
    const near =
      this.reader.manifest.scales.map((s) => s.scale).reduce((best, k) => (away(k) < away(best) ? k : best));
    return { scale: scale === undefined ? scale : near, rung };
  }
  /** This camera's view counts from now on; false where the view has not changed. */
  lookFrom(camera?: Camera): boolean {
    camera?.updateMatrixWorld();
    this.object.updateWorldMatrix(true, false);
    const display = this.displayFrom_(camera);
    const { heightPx, part } = display;
    const seen = camera ? [camera.matrixWorld, camera.projectionMatrix, this.object.matrixWorld] : [];
    const numbers = [heightPx, part?.widthPx ?? 0, part?.heightPx ?? 0, ...seen.flatMap((m) => m.elements)];
    const view = numbers.map((v) => v.toPrecision(4)).join();
    if (view === this.lastView_) return false;
    this.lastView_ = view;
    this.view = { display, camera };
    return true;
  }
  private displayFrom_(camera?: Camera): Display {
    const { options: { display, renderer }, object } = this;
    const said = typeof display === 'function' ? display() : display;
    const shown = said ?? (camera ? displayOf(this.reader.manifest, object, camera,
      renderer.getDrawingBufferSize(new Vector2())) : defaultHeightPx);
    return typeof shown === 'number' ? { heightPx: shown } : shown;
  }
}
