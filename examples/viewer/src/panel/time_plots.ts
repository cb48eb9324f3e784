import type { Live, Turn } from '../live';
import type { PlotData } from './plot';
import type { SectionPlots } from './section';

/** Bytes per second. A faster fragment came in one piece with something else and says nothing of the link. */
const kMostRate = 1.25e9;

const secondsTicks = (v: number): string =>
  (Math.abs(v) < 1 ? `${(v * 1000).toFixed(0)} ms` : `${v.toFixed(1)} s`);
const mbit = (bytesPerSecond: number): number => (bytesPerSecond * 8) / 1e6;

/** The plan's time line: times of fragments, then the plan's credit and the link's bandwidth. */
export function timePlots(live: () => Live): SectionPlots {
  const x = { label: 'seconds since the start', name: 'at', value: (v: number) => `${v.toFixed(2)} s`,
    ticks: (v: number) => v.toFixed(2) };
  return {
    title: 'Time',
    note:
      'Each fragment as it came: the time the plan gave it and the time it took, then credit and bandwidth.',
    open: false,
    plots: [{
      options: {
        x, y: [{ label: 'per fragment', ticks: secondsTicks, min: 0 }],
        curves: [
          { label: 'planned', colour: 'k3', kind: 'line', value: secondsTicks },
          { label: 'took', colour: 'k1', kind: 'points', value: secondsTicks },
        ],
      },
      data: () => turnData(live().turns, (t) => [t.plannedS, t.actualS]),
    }, {
      options: {
        x, y: [{ label: 'credit', ticks: secondsTicks },
          { label: 'Mbit/s', ticks: (v) => v.toFixed(v < 10 ? 1 : 0), min: 0 }],
        curves: [
          { label: 'credit', colour: 'k4', value: secondsTicks, fill: true },
          { label: 'bandwidth', colour: 'k2', side: 1, value: (v) => `${v.toFixed(2)} Mbit/s` },
        ],
      },
      data: () => turnData(live().turns,
        (t) => [t.creditS, t.bytesPerSecond < kMostRate ? mbit(t.bytesPerSecond) : null]),
    }],
  };
}

/**
 * Over the time at which each fragment came, what `of` says of its turn; null: fewer than two fragments came.
 */
export function turnData(turns: readonly Turn[], of: (t: Turn) => (number | null)[]): PlotData | null {
  const came = turns.filter((t) => !t.skipped).sort((a, b) => a.at - b.at);
  if (came.length < 2) return null;
  const rows: PlotData = [came.map((t) => t.at)];
  came.forEach((t, i) => of(t).forEach((v, k) => ((rows[k + 1] ??= [])[i] = v)));
  return rows;
}
