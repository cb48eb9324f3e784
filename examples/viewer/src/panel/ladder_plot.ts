import type { PlaneTables } from 'texmesh';
import * as format from '../format';
import type { SectionPlots } from './section';

/** Bytes and SSIM of a texture by rung. `tables`: of the plane that the panel shows. */
export function ladderPlot(tables: () => PlaneTables | undefined): SectionPlots {
  return {
    title: 'Ladder',
    note: 'What each quality of this texture costs, and how near to the source it comes.',
    open: false,
    plots: [{
      options: {
        x: { label: 'quality', value: (v) => v.toFixed(0) },
        y: [{ label: 'bytes', ticks: format.bytes, min: 0 },
          { label: 'SSIM', ticks: (v) => v.toFixed(2), max: 1.002, close: true }],
        curves: [
          { label: 'bytes', colour: 'k1', value: format.bytes, fill: true },
          { label: 'SSIM', colour: 'k3', side: 1, value: (v) => v.toFixed(4) },
        ],
      },
      data: () => {
        const t = tables();
        return t ? ladderData(t) : null;
      },
    }],
  };
}

/** Bytes and mean SSIM of a plane by rung, each fragment by its share of the surface. */
export function ladderData(t: PlaneTables): number[][] {
  const fragments = t.columns * t.rows;
  const total = [...t.order].reduce((sum, f) => sum + (t.surfaceFraction[f] ?? 0), 0) || 1;
  const rungs = Array.from(t.rungQuality, (_, r) => {
    let bytes = t.tableBytes[r] ?? 0;
    let loss = 0;
    for (const f of t.order) {
      bytes += t.sizeBytes[r * fragments + f] ?? 0;
      loss += ((t.dssim[r * fragments + f] ?? 0) * (t.surfaceFraction[f] ?? 0)) / total;
    }
    return { bytes, ssim: 1 - loss };
  });
  let sum = 0;
  const bytes = rungs.map((r) => (t.incremental ? (sum += r.bytes) : r.bytes));
  return [[...t.rungQuality], bytes, rungs.map((r) => r.ssim)];
}
