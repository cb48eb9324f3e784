import type { Manifest } from 'texmesh';
import type { Choices } from '../choices';
import type { Live } from '../live';
import { bytesPlot } from './bytes_plot';
import { Controls } from './controls';
import type { ControlActions } from './controls';
import { Figures } from './figures';
import { FragmentSection } from './fragment_section';
import { ladderPlot } from './ladder_plot';
import { scalePlot } from './scale_plot';
import { ProxySection } from './proxy_section';
import { PlotSection } from './section';
import { timePlots } from './time_plots';

const kRefreshMs = 150;

/**
 * The panel: figures, controls, plots. `update` may be called at any rate; the panel draws open sections a
 * few times a second.
 */
export class Panel {
  private readonly figures = new Figures();
  private readonly controls: Controls;
  private readonly proxies: ProxySection;
  private readonly fragments: FragmentSection;
  private readonly plots: readonly PlotSection[];
  private offeredPackage: Manifest | null = null;
  private timer = 0;
  private stale = false;

  constructor(root: HTMLElement, choices: Choices, actions: ControlActions, private live: Live) {
    const now = (): Live => this.live;
    const redraw = (): void => this.update(this.live);
    this.controls = new Controls(choices, actions);
    this.proxies = new ProxySection(now);
    this.fragments = new FragmentSection(now, redraw);
    const scales = new PlotSection(scalePlot(now));
    const below = [ladderPlot(() => this.live.tables[this.fragments.plane]), timePlots(now),
      bytesPlot(now)].map((p) => new PlotSection(p));
    this.plots = [scales, ...below];
    const sections = [scales, this.proxies, this.fragments, ...below].map(({ box }) => box);
    for (const section of sections) section.addEventListener('toggle', redraw);
    root.replaceChildren(this.figures.box, this.controls.box, ...sections, this.controls.experts);
  }

  update(live: Live): void {
    this.live = live;
    this.stale = true;
    if (this.timer) return;
    this.timer = window.setTimeout(() => void this.refresh().finally(() => {
      this.timer = 0;
      if (this.stale) this.update(this.live);
    }), kRefreshMs);
  }

  /** One part after the other, with turns of the page between them: frames and fragments go first. */
  private async refresh(): Promise<void> {
    const turn = (): Promise<void> => new Promise((go) => setTimeout(go, 0));
    this.stale = false;
    this.offer(this.live);
    this.fragments.followScene();
    this.figures.show(this.live);
    this.proxies.draw();
    for (const section of this.plots) await section.draw(turn);
    await turn();
    this.fragments.draw();
  }

  /** Fills the lists of choices once the package has said what there is. */
  private offer({ manifest, tables, textures }: Live): void {
    if (manifest && manifest !== this.offeredPackage) {
      this.offeredPackage = manifest;
      this.controls.offerScales(manifest);
    }
    if (tables.length && this.fragments.textureCount !== tables.length) {
      this.fragments.offer(textures);
      this.controls.offerRungs(textures);
    }
  }
}
