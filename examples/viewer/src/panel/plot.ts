import uPlot from 'uplot';
import 'uplot/dist/uPlot.min.css';
import { colour, onTheme } from '../theme';

/** One curve: its colour is a variable of style.css. */
export interface Curve {
  label: string;
  colour: string;
  /** `band`: steps so broad that other curves can be seen on them. */
  kind?: 'line' | 'band' | 'points' | 'bars' | 'dashes';
  value: (v: number) => string;
  /** Index of the y axis: 0 left, 1 right. */
  side?: 0 | 1;
  fill?: boolean;
}

interface Mark {
  x: number;
  y?: number | undefined;
  label: string;
}

export interface PlotOptions {
  height?: number;
  x: {
    label: string;
    /** Name of the value under the pointer, where the label is too long. */
    name?: string;
    value: (v: number) => string;
    log?: boolean;
    ticks?: (v: number) => string;
    splits?: number[];
    range?: [number, number];
  };
  /** `close`: the axis begins near the least value, not at 0. */
  y: { label: string; ticks: (v: number) => string; log?: boolean; min?: number; max?: number;
    close?: boolean }[];
  curves: Curve[];
  /** Where the load stands now: a vertical line, and a dot on the first y axis. */
  mark?: () => Mark | null;
  legend?: boolean;
}

/** The row of x, then one row for each curve; null = no point. */
export type PlotData = (number | null)[][];

/** A plot of uPlot that follows its box's width and the theme. */
export class Plot {
  private plot: uPlot | null = null;
  private data: uPlot.AlignedData = [[]];
  private mark: Mark | null | undefined;
  private width = 0;

  constructor(private readonly box: HTMLElement, private readonly options: PlotOptions) {
    box.classList.add('plot');
    new ResizeObserver(() => this.fit()).observe(box);
    onTheme(() => this.rebuild());
  }

  /** Draws the data, unless the plot shows them already. */
  set(data: PlotData): void {
    const mark = this.options.mark?.();
    const moved = mark?.x !== this.mark?.x || mark?.y !== this.mark?.y || mark?.label !== this.mark?.label;
    const same = equal(data, this.data as PlotData);
    this.mark = mark;
    if (same && this.plot) {
      if (moved) this.plot.redraw(false, false);
      return;
    }
    this.data = data as uPlot.AlignedData;
    if (this.plot) this.plot.setData(this.data);
    else this.rebuild();
  }

  private fit(): void {
    const width = Math.floor(this.box.clientWidth);
    if (width === this.width) return;
    this.width = width;
    if (this.plot && width > 0) this.plot.setSize({ width, height: this.options.height ?? 150 });
    else this.rebuild();
  }

  private rebuild(): void {
    this.plot?.destroy();
    this.plot = null;
    // Nothing is built for a closed section, or before there are data.
    if (this.width <= 0 || (this.data[0] as unknown[]).length === 0) return;
    this.plot = new uPlot(uplotOptions(this.options, this.width), this.data, this.box);
  }
}

function equal(a: readonly (readonly (number | null)[])[],
    b: readonly (readonly (number | null)[])[]): boolean {
  return a.length === b.length &&
    a.every((row, i) => row.length === b[i]?.length && row.every((v, k) => v === b[i]?.[k]));
}

function uplotOptions(o: PlotOptions, width: number): uPlot.Options {
  const font = '11px system-ui, sans-serif';
  const [ink, line] = [colour('muted'), colour('line')];
  const axis = { stroke: ink, font, labelFont: font, ticks: { stroke: line, width: 1, size: 4 },
    grid: { stroke: line, width: 1 } };
  const scales: uPlot.Scales = { x: { time: false, distr: o.x.log ? 3 : 1 } };
  if (o.x.range) scales['x']!.range = o.x.range;
  else if (o.x.log) scales['x']!.range = (_u, low, high) => [low, high];
  const axes: uPlot.Axis[] = [
    {
      ...axis, label: o.x.label, labelSize: 18, size: 26, grid: { show: false }, space: 56,
      ...(o.x.splits ? { splits: o.x.splits } : o.x.log ? { splits: decades } : {}),
      values: (_u, splits) => splits.map((v) => (v == null ? '' : (o.x.ticks ?? o.x.value)(v))),
    },
  ];
  o.y.forEach((y, i) => {
    scales[`y${i}`] = {
      distr: y.log ? 3 : 1,
      range: (_u, low, high) => {
        if (y.log) return [Math.max(low, 1e-9) / 1.3, Math.max(high, 1e-9) * 1.3];
        const bottom = y.min ??
          (y.close ? (low ?? 0) - 0.1 * Math.max((high ?? 1) - (low ?? 0), 1e-3) : Math.min(low ?? 0, 0));
        const top = y.max ?? (high ?? 1) + 0.06 * Math.max((high ?? 1) - bottom, 1e-9);
        return [bottom, top > bottom ? top : bottom + 1];
      },
    };
    axes.push({
      ...axis, scale: `y${i}`, side: i === 0 ? 3 : 1, label: y.label, labelSize: 16, space: 26,
      ...(y.log ? { splits: decades } : {}),
      size: (_u, values) => Math.max(34, 12 + 6.5 * Math.max(0, ...(values ?? []).map((v) => v.length))),
      grid: { show: i === 0, stroke: line, width: 1 },
      values: (_u, splits) => splits.map((v) => (v == null ? '' : y.ticks(v))),
    });
  });
  return {
    width,
    height: o.height ?? 150,
    padding: [8, o.y.length > 1 ? 0 : 12, 0, 0],
    scales,
    axes,
    legend: { show: o.legend ?? true, live: true },
    cursor: { y: false, points: { size: 6 }, drag: { x: false, y: false } },
    series: [{ label: o.x.name ?? o.x.label, value: (_u, v) => (v == null ? '' : o.x.value(v)) },
      ...o.curves.map(series)],
    hooks: { draw: [(u) => drawMark(u, o)] },
  };
}

/** Ticks of a logarithmic axis: whole powers of ten. */
function decades(_u: uPlot, _axis: number, low: number, high: number): number[] {
  const ticks: number[] = [];
  for (let e = Math.ceil(Math.log10(low) - 1e-9); e <= Math.log10(high) + 1e-9; e++) ticks.push(10 ** e);
  return ticks;
}

function series(c: Curve): uPlot.Series {
  const stroke = colour(c.colour);
  const paths = uPlot.paths;
  return {
    label: c.label,
    scale: `y${c.side ?? 0}`,
    stroke: c.kind === 'band' ? `${stroke}55` : stroke,
    width: c.kind === 'points' ? 0 : c.kind === 'band' ? 6 : 1.75,
    points: { show: c.kind === 'points', size: 5, fill: stroke, stroke },
    ...(c.kind === 'dashes' ? { dash: [4, 4] } : {}),
    ...(c.kind === 'band' && paths.stepped ? { paths: paths.stepped({ align: -1 }) } : {}),
    ...(c.kind === 'bars' && paths.bars ? { paths: paths.bars({ size: [0.7, 60] }), fill: stroke } : {}),
    ...(c.fill ? { fill: `${stroke}22` } : {}),
    value: (_u, v) => (v == null ? '' : c.value(v)),
  };
}

function drawMark(u: uPlot, o: PlotOptions): void {
  const mark = o.mark?.();
  if (!mark || !Number.isFinite(mark.x)) return;
  const { ctx, bbox } = u;
  const x = Math.min(Math.max(u.valToPos(mark.x, 'x', true), bbox.left), bbox.left + bbox.width);
  ctx.save();
  ctx.strokeStyle = ctx.fillStyle = colour('warm');
  ctx.lineWidth = 1.5 * devicePixelRatio;
  ctx.setLineDash([3 * devicePixelRatio, 3 * devicePixelRatio]);
  ctx.beginPath();
  ctx.moveTo(x, bbox.top);
  ctx.lineTo(x, bbox.top + bbox.height);
  ctx.stroke();
  if (mark.y !== undefined) {
    ctx.setLineDash([]);
    ctx.beginPath();
    ctx.arc(x, u.valToPos(mark.y, 'y0', true), 4 * devicePixelRatio, 0, 2 * Math.PI);
    ctx.fill();
  }
  ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
  const right = x > bbox.left + bbox.width * 0.6;
  ctx.textAlign = right ? 'right' : 'left';
  ctx.fillText(mark.label, x + (right ? -5 : 5) * devicePixelRatio, bbox.top + 11 * devicePixelRatio);
  ctx.restore();
}
