import type { About, Manifest, PlaneTables, TextureInfo } from 'texmesh';

/** One fragment's turn in the plan, as the time line shows it. Times in seconds since the load began. */
export interface Turn {
  at: number;
  plannedS: number;
  actualS: number;
  creditS: number;
  bytesPerSecond: number;
  bytes: number;
  skipped: boolean;
}

/** A request that has ended. */
export interface Transfer {
  kind: string;
  bytes: number;
  start: number;
  end: number;
}

/** All that the panel shows of a load; NaN: not known yet. */
export interface Live {
  manifest: Manifest | null;
  textures: TextureInfo[];
  /** Of those planes that were read. */
  tables: (PlaneTables | undefined)[];
  packageBytes: number;
  title: string;
  /** Read when the first picture stands. */
  about: About | null;
  phase: string;
  /** null: none yet; -1: a proxy is shown. */
  scale: number | null;
  /** -1: a scale is shown. */
  proxy: number;
  displayedPx: number;
  startedAt: number;
  firstPictureS: number;
  doneS: number;
  limitS: number;
  predictedFlip: number;
  bytes: number;
  expected: number;
  requests: number;
  /** Plane that is being shown of each image, and per plane the rung in the texture: -1 preview. */
  shownPlane: Map<number, number>;
  rungs: Map<number, Int16Array>;
  skipped: Map<number, Set<number>>;
  turns: Turn[];
  transfers: Transfer[];
  /** The last error that left a picture on the screen. */
  problem: string;
  /** How many such errors there were. */
  problems: number;
}

export function emptyLive(): Live {
  return {
    manifest: null, textures: [], tables: [], packageBytes: 0, title: '', about: null, phase: 'opening',
    scale: null, proxy: -1, displayedPx: 0, startedAt: 0,
    firstPictureS: NaN, doneS: NaN, limitS: NaN, predictedFlip: NaN, bytes: 0, expected: 0, requests: 0,
    shownPlane: new Map(),
    rungs: new Map(), skipped: new Map(), turns: [], transfers: [], problem: '', problems: 0,
  };
}

export const kKinds = ['start', 'mesh', 'preview', 'tables', 'texture'] as const;

/** Which of kKinds a request of the library belongs to. */
export function kindOf(kind: string): (typeof kKinds)[number] {
  if (/mesh|stream|scale/.test(kind)) return 'mesh';
  if (/first|preview|picture/.test(kind)) return 'preview';
  if (/table|index|textures|quality/.test(kind)) return 'tables';
  if (/fragment|texture|rung/.test(kind)) return 'texture';
  return 'start';
}

/** Bytes received by kKinds. */
export function bytesByKind(transfers: readonly Transfer[]): number[] {
  const sums = kKinds.map(() => 0);
  for (const t of transfers) {
    const k = kKinds.indexOf(kindOf(t.kind));
    sums[k] = (sums[k] ?? 0) + t.bytes;
  }
  return sums;
}
