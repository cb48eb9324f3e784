import type { Manifest } from './manifest';
import type { QualityTable } from './quality_table';
import type { PlaneTables } from './tables';
import type { TextureInfo } from './textures';

/** Data that decisions about textures are made from. Tables may lack planes that nobody asks about. */
export interface PackageData {
  manifest: Manifest;
  textures: readonly TextureInfo[];
  tables: readonly (PlaneTables | undefined)[];
  quality: QualityTable;
}
