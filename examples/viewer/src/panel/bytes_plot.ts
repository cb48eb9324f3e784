import * as format from '../format';
import { bytesByKind, kKinds } from '../live';
import type { Live } from '../live';
import type { SectionPlots } from './section';

/** Bytes received, by what they were for. */
export function bytesPlot(live: () => Live): SectionPlots {
  const kinds = kKinds.map((_, i) => i);
  const name = (kind: number): string => kKinds[kind] ?? '';
  return {
    title: 'Bytes',
    note: 'What has come over the line, by what it was for.',
    open: false,
    plots: [{
      options: {
        x: { label: '', name: 'for', value: name, ticks: name, splits: kinds,
          range: [-0.6, kinds.length - 0.4] },
        y: [{ label: 'bytes', ticks: format.bytes, min: 0 }],
        curves: [{ label: 'received', colour: 'k1', kind: 'bars', value: format.bytes }],
      },
      data: () => {
        const { transfers } = live();
        return transfers.length ? [kinds, bytesByKind(transfers)] : null;
      },
    }],
  };
}
