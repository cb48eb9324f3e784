import type { Camera, Group } from 'three';
import type { Display, LoadEvents, LoadOptions, LoadPhase } from './api';
import type { PackageReader } from '../http/package_reader';
import type { MaterialSet } from './scale_parts';
import type { ScaleLoad, ScaleSource } from './scale_source';
import type { WorkerPool } from '../worker/pool';

/** A change of scale or plane has to be wanted by this factor of displayed height. */
export const hysteresis = 1.1;

/** What the parts of one load share. */
export interface LoadContext {
  readonly reader: PackageReader;
  readonly options: LoadOptions;
  readonly pool: WorkerPool;
  readonly materials: MaterialSet;
  readonly scales: ScaleSource;
  readonly object: Group;
  readonly signal: AbortSignal;
  readonly limitS: number;
  override: { scale?: number; rung?: number };
  view: { display: Display; camera?: Camera };
  /** In the scene; -1: none yet. */
  shownScale: number;
  wantedScale: number;
  /** Throughput that the first transfers have shown. */
  beta0: number;
  expectedBytes: number;
  /** Since the load's start. */
  elapsedS(): number;
  emit<K extends keyof LoadEvents>(name: K, event: Omit<LoadEvents[K], 'at'>): void;
  fail(error: unknown, what: string): void;
  enter(phase: LoadPhase): void;
  /** A scale cannot be had for now. */
  lostScale(error: unknown, scale: number): void;
  /** Loads a scale and shows it. */
  showScale(scale: number): { arrived: ScaleLoad['arrived']; shown: Promise<void> };
}
