import { stepFunction } from 'texmesh';
import type { Manifest } from 'texmesh';
import * as format from '../format';
import type { Live } from '../live';
import { shownName } from './figures';
import type { SectionPlots } from './section';

/** The step function: which scale is enough at which displayed height. */
export function scalePlot(live: () => Live): SectionPlots {
  return {
    title: 'Scales',
    note: 'Triangles that are enough at a height on the screen. Up to that height, the mesh looked like ' +
      'the finest one (S_0) in all pictures that the build compared. The dot is what is shown.',
    open: true,
    plots: [{
      options: {
        height: 170,
        x: { label: 'displayed height, px', name: 'height', value: format.px, log: true,
          ticks: format.short },
        y: [{ label: 'triangles', ticks: format.short, log: true }],
        curves: [
          { label: 'enough', colour: 'k1', kind: 'band', value: format.short },
          { label: 'just noticeable', colour: 'k3', kind: 'dashes', value: format.short },
          { label: 'one pixel', colour: 'k4', kind: 'dashes', value: format.short },
        ],
        mark: () => {
          const { displayedPx: x, scale, proxy, manifest } = live();
          if (!(x > 0)) return null;
          const shown = proxy >= 0 ? manifest?.proxies[proxy]
            : manifest?.scales.find((s) => s.scale === scale);
          return { x, y: shown?.triangles, label: scale === null ? 'now' : shownName({ scale, proxy }) };
        },
      },
      data: () => {
        const { manifest } = live();
        return manifest ? stepData(manifest) : null;
      },
    }],
  };
}

const kLeastPx = 16;

/** Triangles over displayed height by the three rules, on the union of their steps. */
export function stepData(m: Manifest): number[][] {
  const rules = (['flip', 'jnd', 'error'] as const).map((rule) => stepFunction(m.scales, rule));
  const ends = rules.flat().map((s) => s.upToPx).filter((x) => x < 1e8);
  const most = Math.max(4096, ...ends.map((x) => x * 1.6));
  const heights = [...new Set([kLeastPx, ...ends.filter((e) => e > kLeastPx), most])].sort((a, b) => a - b);
  // Dashed curves have no steps of their own: each step's end stands twice, a hair apart.
  const x = heights.flatMap((h, i) => (i === 0 || i === heights.length - 1 ? [h] : [h, h * 1.0005]));
  const triangles = new Map(m.scales.map((s) => [s.scale, s.triangles]));
  const at = (steps: { upToPx: number; scale: number }[], h: number): number =>
    triangles.get((steps.find((s) => h <= s.upToPx) ?? steps[steps.length - 1]!).scale) ?? 1;
  return [x, ...rules.map((steps) => x.map((h) => at(steps, h)))];
}
