import type { EntryRef, Manifest } from './manifest';
import type { QualityTable } from './quality_table';
import type { TextureInfo } from './textures';

/**
 * Tables of one texture plane (format/SPEC.md, section 8). F = columns * rows fragments, R rungs of rising
 * quality, N rows of feature scales: those of the manifest, in its order.
 */
export interface PlaneTables {
  columns: number;
  rows: number;
  /** A rung's streams continue those of the rungs below. */
  incremental: boolean;
  /** [R] IJG quality, strictly rising. */
  rungQuality: Uint8Array;
  /** [R] bytes of the rung's table stream. */
  tableBytes: Uint32Array;
  /** [R * F] bytes of streams, index rung * F + fragment; 0 where the fragment is not stored. */
  sizeBytes: Uint32Array;
  /** [R * F * 8] first 8 bytes of each stream's SHA-256. */
  digest: Uint8Array;
  /** [R * F] mean squared error of luma, 8-bit scale. */
  mse: Float32Array;
  /** [R * F] 1 - SSIM. */
  dssim: Float32Array;
  /** [F] texels that the object uses. */
  coveredTexels: Uint32Array;
  /** [F] share of the object's surface. */
  surfaceFraction: Float32Array;
  /** Every stored fragment once, by falling importance. What is not stored has zeros at every rung. */
  order: Uint16Array;
  /** [F] 1 - SSIM when the preview stands for the fragment. */
  skipDssim: Float32Array;
  /** Qualities between rungs, rising, and for each the share of the way in bytes from rung to rung. */
  knotQuality: Uint8Array;
  knotPosition: Float32Array;
  /** [N * F] feature points f_i, index row * F + fragment. */
  features: Uint32Array;
  /** [N] quality Q_i. */
  quality: Float32Array;
  /** 0 thesis (3.2), 1 log-quantiser, 2 rate-distortion within the bytes of 1, 3 thesis with VQP as eta. */
  allocation: number;
  /** [F] VQP (8.4) at S_0 where the allocation is 3, else empty; and what part of it is eta. */
  vqp: Float32Array;
  densityWeight: number;
  qualityWidth: number;
  logWidth: number;
  qualityMin: number;
  qualityMax: number;
}

/** F: fragments of the plane. */
export const fragmentCount = (t: PlaneTables): number => t.columns * t.rows;
/** R: rungs of the plane. */
export const rungCount = (t: PlaneTables): number => t.rungQuality.length;

/** Bytes that a client must have to show a fragment at a rung; 0 when the fragment is not stored there. */
export function bytesToShow(t: PlaneTables, rung: number, fragment: number): number {
  const streamBytes = (r: number): number => t.sizeBytes[r * fragmentCount(t) + fragment];
  let bytes = streamBytes(rung);
  if (t.incremental && bytes > 0) for (let r = 0; r < rung; ++r) bytes += streamBytes(r);
  return bytes;
}

/** Where a plane's section stands within tables.bin, and its digest. */
export type TablesSection = Omit<EntryRef, 'path' | 'rule'>;
/** Places and digests of the sections. */
export interface TablesHead {
  minor: number;
  bytes: number;
  planes: TablesSection[];
}

/** Data that decisions about textures are made from. Tables may lack planes that nobody asks about. */
export interface PackageData {
  manifest: Manifest;
  textures: readonly TextureInfo[];
  tables: readonly (PlaneTables | undefined)[];
  quality: QualityTable;
}
