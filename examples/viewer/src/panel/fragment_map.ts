import { etaOf } from 'texmesh';
import type { PlaneTables, TextureInfo } from 'texmesh';
import * as format from '../format';
import type { Live } from '../live';
import { make } from '../dom';
import { colour, onTheme } from '../theme';

export type ColourBy = 'eta' | 'rung' | 'bytes' | 'skipped';

/**
 * Five stops of a ramp that is even to the eye and to colour-blind people (viridis, Smith and van der Walt).
 */
const kRamp: [number, number, number][] = [
  [68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37],
];

export function rampColour(t: number): string {
  const x = Math.min(Math.max(t, 0), 1) * (kRamp.length - 1);
  const i = Math.min(Math.floor(x), kRamp.length - 2);
  const [a, b] = [kRamp[i]!, kRamp[i + 1]!];
  const mix = (k: 0 | 1 | 2): number => Math.round(a[k] + (b[k] - a[k]) * (x - i));
  return `rgb(${mix(0)} ${mix(1)} ${mix(2)})`;
}

/**
 * A picture of a texture's fragments, each in the colour of its rung, importance, bytes, or of being skipped.
 */
export class FragmentMap {
  readonly box = make('div', { class: 'map' });
  private readonly canvas = make('canvas', { role: 'img', 'aria-label': 'Fragments of the texture' });
  private readonly legend = make('div', { class: 'legend' });
  private readonly hint = make('div', { class: 'hint' });
  private by: ColourBy = 'rung';
  private plane = 0;
  private live: Live | null = null;
  private frameAsked = false;
  private legendText = '';

  constructor() {
    this.box.append(this.canvas, this.legend, this.hint);
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    this.canvas.addEventListener('pointermove', (e) => this.describe(e));
    this.canvas.addEventListener('pointerdown', (e) => this.describe(e));
    this.canvas.addEventListener('pointerleave', (e) => {
      if (e.pointerType === 'mouse') this.hint.textContent = ''; // after a touch the words stay, to be read
    });
    onTheme(() => this.draw());
  }

  show(live: Live, plane: number, by: ColourBy): void {
    this.live = live;
    this.plane = plane;
    this.by = by;
    this.draw();
  }

  draw(): void {
    if (this.frameAsked) return;
    this.frameAsked = true;
    requestAnimationFrame(() => {
      this.frameAsked = false;
      this.paint();
    });
  }

  private parts(): { info: TextureInfo; tables: PlaneTables } | null {
    const info = this.live?.textures[this.plane];
    const tables = this.live?.tables[this.plane];
    return info && tables ? { info, tables } : null;
  }

  /** The row of the shown scale in tables; S_0's before there is one. */
  private row(): number {
    const rows = this.live?.manifest?.scales.map((s) => s.scale) ?? [];
    return Math.max(rows.indexOf(this.live?.scale ?? 0), 0);
  }

  private paint(): void {
    const width = this.canvas.clientWidth;
    const parts = this.parts();
    if (!parts || width === 0) return;
    const { info, tables } = parts;
    const height = Math.round(Math.min(width * (info.heightPx / info.widthPx), width * 1.4));
    this.canvas.style.height = `${height}px`;
    const dense = devicePixelRatio;
    if (this.canvas.width !== Math.round(width * dense) ||
          this.canvas.height !== Math.round(height * dense)) {
      this.canvas.width = Math.round(width * dense);
      this.canvas.height = Math.round(height * dense);
    }
    // a few hundred rectangles: not worth the GPU's time
    const c = this.canvas.getContext('2d', { willReadFrequently: true });
    if (!c) return;
    c.clearRect(0, 0, this.canvas.width, this.canvas.height);
    const fill = this.colours(tables);
    const sx = this.canvas.width / info.widthPx;
    const sy = this.canvas.height / info.heightPx;
    const gap = Math.min(1, dense * 0.5);
    for (let f = 0; f < info.columns * info.rows; f++) {
      const column = f % info.columns;
      const row = Math.floor(f / info.columns);
      const x = column * info.fragmentWidthPx * sx;
      const y = row * info.fragmentHeightPx * sy;
      const w = Math.min(info.fragmentWidthPx, info.widthPx - column * info.fragmentWidthPx) * sx;
      const h = Math.min(info.fragmentHeightPx, info.heightPx - row * info.fragmentHeightPx) * sy;
      const style = fill(f);
      if (!style) continue; // nothing of the object has texels here
      c.fillStyle = style;
      c.fillRect(x + gap, y + gap, w - 2 * gap, h - 2 * gap);
    }
  }

  /** The colour of each fragment; null where nothing is stored. Sets the legend on the way. */
  private colours(t: PlaneTables): (f: number) => string | null {
    const fragments = t.columns * t.rows;
    const rungs = this.live?.rungs.get(this.plane);
    const skippedSet = this.live?.skipped.get(this.plane);
    const stored = new Uint8Array(fragments);
    for (const f of t.order) stored[f] = 1;
    const [skipped, here, left] = [colour('skipped'), colour('k1'), colour('warm')];
    const top = t.rungQuality.length - 1;
    const bytesOf = (f: number): number => this.bytesOf(t, f);
    switch (this.by) {
      case 'eta': {
        const eta = etaOf(t, this.row());
        this.ramp('even', 'full of features', false);
        return (f) => (stored[f] ? rampColour(eta[f] ?? 0) : null);
      }
      case 'rung':
        this.ramp(`quality ${t.rungQuality[0] ?? 0}`, `${t.rungQuality[top] ?? 0}`, true);
        return (f) => (!stored[f] ? null
          : (rungs?.[f] ?? -1) < 0 ? skipped : rampColour(top === 0 ? 1 : (rungs![f] ?? 0) / top));
      case 'bytes': {
        let most = 1;
        for (let f = 0; f < fragments; f++) most = Math.max(most, bytesOf(f));
        this.ramp('0', format.bytes(most), true);
        return (f) => (!stored[f] ? null
          : bytesOf(f) === 0 ? skipped : rampColour(Math.sqrt(bytesOf(f) / most)));
      }
      case 'skipped':
        this.nameColours([['k1', 'here'], ['warm', 'skipped by the plan'], ['skipped', 'not yet']]);
        return (f) => (!stored[f] ? null
          : (rungs?.[f] ?? -1) >= 0 ? here : skippedSet?.has(f) ? left : skipped);
    }
  }

  private bytesOf(t: PlaneTables, f: number): number {
    const rung = this.live?.rungs.get(this.plane)?.[f] ?? -1;
    const fragments = t.columns * t.rows;
    let sum = 0;
    for (let r = t.incremental ? 0 : rung; r >= 0 && r <= rung; r++)
      sum += t.sizeBytes[r * fragments + f] ?? 0;
    return sum;
  }

  private ramp(low: string, high: string, skip: boolean): void {
    if (this.legendHas(`ramp ${low} ${high} ${skip}`)) return;
    const stops = [0, 0.25, 0.5, 0.75, 1].map(rampColour).join(', ');
    const bar = make('span', { class: 'ramp', style: `background: linear-gradient(to right, ${stops})` });
    this.legend.replaceChildren(low, bar, high,
      ...(skip ? [make('span', { class: 'skip' }), 'preview'] : []));
  }

  private nameColours(names: [string, string][]): void {
    if (this.legendHas(`words ${names}`)) return;
    this.legend.replaceChildren(
      ...names.flatMap(([c, text]) =>
        [make('span', { class: 'skip', style: `background: var(--${c})` }), text]));
  }

  /** Whether the legend has this text already; notes the text. */
  private legendHas(text: string): boolean {
    const has = this.legendText === text;
    this.legendText = text;
    return has;
  }

  private describe(e: PointerEvent): void {
    const parts = this.parts();
    if (!parts) return;
    const { info, tables } = parts;
    const box = this.canvas.getBoundingClientRect();
    const column = Math.floor((((e.clientX - box.left) / box.width) * info.widthPx) / info.fragmentWidthPx);
    const row = Math.floor((((e.clientY - box.top) / box.height) * info.heightPx) / info.fragmentHeightPx);
    if (column < 0 || row < 0 || column >= info.columns || row >= info.rows) return;
    const f = row * info.columns + column;
    const rung = this.live?.rungs.get(this.plane)?.[f] ?? -1;
    const eta = etaOf(tables, this.row())[f] ?? 0;
    const now = rung < 0 ? 'preview'
      : `quality ${tables.rungQuality[rung]}, ${format.bytes(this.bytesOf(tables, f))}`;
    this.hint.textContent = (tables.coveredTexels[f] ?? 0) === 0 ? `fragment ${f}: nothing of the object` :
      `fragment ${f}: η ${eta.toFixed(2)}, ${now}`;
  }
}
