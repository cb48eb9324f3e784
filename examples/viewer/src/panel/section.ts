import { make } from '../dom';
import { Plot } from './plot';
import type { PlotData, PlotOptions } from './plot';

/** A section of the panel that can be folded. */
export function foldingSection(title: string, note: string, open: boolean,
    ...children: Node[]): HTMLDetailsElement {
  return make('details', { open }, make('summary', {}, title), make('p', { class: 'note' }, note),
    ...children);
}

/** What a section shows: its plots below each other. */
export interface SectionPlots {
  title: string;
  note: string;
  open: boolean;
  /** `data`: null while there is nothing to draw. */
  plots: { options: PlotOptions; data: () => PlotData | null }[];
}

/** A section with plots. */
export class PlotSection {
  readonly box: HTMLDetailsElement;
  private readonly plots: { plot: Plot; data: () => PlotData | null }[];

  constructor({ title, note, open, plots }: SectionPlots) {
    const holders = plots.map(() => make('div'));
    this.box = foldingSection(title, note, open, ...holders);
    this.plots = plots.map(({ options, data }, i) => ({ plot: new Plot(holders[i]!, options), data }));
  }

  /** Draws what is open; calls and awaits `before` ahead of each plot. */
  async draw(before: () => Promise<void>): Promise<void> {
    for (const { plot, data } of this.plots) {
      if (!this.box.open) continue;
      await before();
      const rows = data();
      if (rows) plot.set(rows);
    }
  }
}
