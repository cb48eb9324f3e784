import { equivalentQuality, predictedSsim, surfaceWeights } from 'texmesh';
import type { ComposedPlane, LoadState, PackageData, PlaneTables, QualityTable } from 'texmesh';

type ShownPlane = Pick<ComposedPlane, 'plane' | 'role' | 'rungs'>;

/** 1 - SSIM of the colour textures, each fragment weighted by its surface; NaN: no colour texture is shown. */
export function meanColourDssim(planes: readonly ShownPlane[], tables: readonly (PlaneTables | undefined)[]): number {
  let [loss, weight] = [0, 0];
  for (const { plane, role, rungs } of planes) {
    const t = tables[plane];
    if (!t || !/base-colour|emissive|colour/.test(role)) continue;
    const weights = surfaceWeights(t);
    const fragments = t.columns * t.rows;
    for (const f of t.order) {
      const rung = rungs[f] ?? -1;
      const dssim = rung >= 0 ? t.dssim[rung * fragments + f] : t.skipDssim[f];
      loss += (weights[f] ?? 0) * (dssim ?? 1);
      weight += weights[f] ?? 0;
    }
  }
  return weight > 0 ? loss / weight : NaN;
}

/** SSIM that the package's measured table gives a picture of this scale and these textures. */
export function pictureSsim(data: PackageData, table: QualityTable, { scale, planes }: Pick<LoadState, 'scale' | 'planes'>): number {
  const dssim = meanColourDssim(planes, data.tables);
  const quality = Number.isNaN(dssim) ? 100 : equivalentQuality(data, planes, dssim);
  return predictedSsim(table, scale, quality);
}
