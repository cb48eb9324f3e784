import { stepFunction } from 'texmesh';
import type { Manifest, PlaneTables } from 'texmesh';
import { capsWith, kPolicies, kTimes } from '../choices';
import type { Choices } from '../choices';
import { make } from '../dom';
import { FragmentMap } from './fragment_map';
import type { ColourBy } from './fragment_map';
import * as format from '../format';
import { bytesByKind, kKinds } from '../live';
import type { Live } from '../live';
import { Plot } from './plot';

export interface PanelActions {
  choose: (choices: Choices) => void;
  reload: () => void;
  refine: () => void;
}

/** The panel: figures, controls, plots. `update` may be called at any rate; it draws what is open, a few times a second. */
export class Panel {
  readonly choices: Choices;
  private live: Live;
  private readonly figures = new Map<string, HTMLElement>();
  private readonly scaleSelect = make('select', { id: 'scale' });
  private readonly rungSelect = make('select', { id: 'rung' });
  private readonly planeSelect = make('select', { 'aria-label': 'Texture' });
  private readonly map = new FragmentMap();
  private readonly plots: { box: HTMLDetailsElement; plot: Plot; data: () => (number | null)[][] | null }[] = [];
  private mapBox!: HTMLDetailsElement;
  private colourBy: ColourBy = 'rung';
  private planeChosen = false;
  private packageShown: Manifest | null = null;
  private timer = 0;
  private stale = false;

  constructor(
    private readonly root: HTMLElement,
    choices: Choices,
    private readonly actions: PanelActions,
    live: Live,
  ) {
    this.choices = choices;
    this.live = live;
    root.replaceChildren(this.figuresSection(), this.controlsSection());
    this.stepSection();
    this.mapSection();
    this.ladderSection();
    this.timeSection();
    this.bytesSection();
  }

  update(live: Live): void {
    this.live = live;
    this.stale = true;
    if (this.timer) return;
    this.timer = window.setTimeout(() => void this.refresh().finally(() => {
      this.timer = 0;
      if (this.stale) this.update(this.live);
    }), 150);
  }

  /** One thing after the other, with turns of the page between them: frames and fragments go first. */
  private async refresh(): Promise<void> {
    const turn = (): Promise<void> => new Promise((go) => setTimeout(go, 0));
    this.stale = false;
    const l = this.live;
    if (l.manifest && l.manifest !== this.packageShown) this.newPackage(l.manifest);
    if (l.tables.length && this.planeSelect.options.length !== l.tables.length) this.newTables();
    if (!this.planeChosen) this.followPlane();
    this.writeFigures(l);
    for (const p of this.plots) {
      if (!p.box.open) continue;
      await turn();
      const data = p.data();
      if (data) p.plot.set(data);
    }
    await turn();
    if (this.mapBox.open) this.map.show(this.live, this.plane(), this.colourBy);
  }

  private writeFigures(l: Live): void {
    const set = (name: string, text: string, more = ''): void => {
      const e = this.figures.get(name);
      e?.replaceChildren(text, ...(more ? [make('small', {}, ` ${more}`)] : []));
    };
    const m = l.manifest?.scales.find((s) => s.scale === l.scale);
    set('scale', l.scale === null ? '–' : `S${l.scale}`, m ? `${short(m.triangles)} tri` : '');
    set('size', l.displayedPx > 0 ? format.px(l.displayedPx) : '–');
    const got = l.bytes;
    set('bytes', got > 0 ? format.bytes(got) : '–', l.packageBytes > 0 ? `of ${format.bytes(l.packageBytes)}` : '');
    set('first', secondsOrDash(l.firstPictureS));
    set('time', secondsOrDash(l.doneS), Number.isFinite(l.limitS) && Number.isFinite(l.doneS) ? `of ${format.seconds(l.limitS)}` : '');
    set('ssim', Number.isFinite(l.predictedSsim) ? l.predictedSsim.toFixed(3) : '–');
  }

  private plane(): number {
    return Number(this.planeSelect.value) || 0;
  }

  private followPlane(): void {
    // What people call the texture, where there is one.
    const shown = [...this.live.shownPlane].sort(([a], [b]) => a - b);
    const [, plane] = shown.find(([base]) => this.live.textures[base]?.role === 'base-colour') ?? shown[0] ?? [];
    if (plane !== undefined && this.planeSelect.options.length > plane) this.planeSelect.value = String(plane);
  }

  private newPackage(m: Manifest): void {
    this.packageShown = m;
    const options = m.scales.map((s) => make('option', { value: String(s.scale) }, `S${s.scale} · ${format.count(s.triangles)} triangles`));
    this.scaleSelect.replaceChildren(make('option', { value: '' }, 'by displayed size'), ...options);
    this.scaleSelect.value = this.choices.scale === null ? '' : String(this.choices.scale);
    if (this.scaleSelect.selectedIndex < 0) this.scaleSelect.value = String(m.scales.at(-1)?.scale ?? '');
  }

  private newTables(): void {
    const names = this.live.textures.map((t, p) => {
      const image = t.mip > 0 ? this.live.textures[t.base] : t;
      const size = `${t.widthPx} × ${t.heightPx}`;
      return make('option', { value: String(p) }, `${image?.role ?? t.role} ${t.image}, ${size}${t.mip ? ` (1/${2 ** t.mip})` : ''}`);
    });
    this.planeSelect.replaceChildren(...names);
    // Of the longest ladder: planes with fewer rungs take their highest.
    const qualities = this.live.textures.map((t) => t.rungQuality).reduce((a, b) => (b.length > a.length ? b : a), []);
    this.rungSelect.replaceChildren(make('option', { value: '' }, 'by time and importance'),
      ...qualities.map((q, r) => make('option', { value: String(r) }, `rung ${r} · quality ${q}`)));
    this.rungSelect.value = this.choices.rung === null ? '' : String(Math.min(this.choices.rung, qualities.length - 1));
  }

  private figuresSection(): HTMLElement {
    const list = make('dl', { class: 'figures' });
    for (const [key, name] of [['scale', 'scale shown'], ['size', 'displayed height'], ['bytes', 'received'], ['first', 'first picture'],
      ['time', 'complete after'], ['ssim', 'predicted SSIM']] as const) {
      const value = make('dd', { id: `figure-${key}` }, '–');
      this.figures.set(key, value);
      list.append(make('div', {}, make('dt', {}, name), value));
    }
    return make('section', {}, list);
  }

  private controlsSection(): HTMLElement {
    const c = this.choices;
    const changed = (): void => this.actions.choose({ ...c });
    const out = make('output', { for: 'time' }, format.seconds(c.timeS));
    const nearest = kTimes.findIndex((t) => t >= c.timeS);
    const range = make('input', {
      type: 'range', id: 'time', min: '0', max: String(kTimes.length - 1), step: '1', value: String(nearest < 0 ? kTimes.length - 1 : nearest), 'aria-valuetext': format.seconds(c.timeS),
      oninput: () => {
        c.timeS = kTimes[Number(range.value)] ?? Infinity;
        out.textContent = format.seconds(c.timeS);
        range.setAttribute('aria-valuetext', format.seconds(c.timeS));
      },
      onchange: changed,
    });
    const choose = (id: string, options: [string, string][], value: string, set: (v: string) => void): HTMLSelectElement => {
      const e = make('select', { id, onchange: () => { set(e.value); changed(); } },
        ...options.map(([v, text]) => make('option', { value: v }, text)));
      e.value = value;
      return e;
    };
    const cap = choose('cap', capsWith(c.capBytesPerSecond).map(([text, v]) => [String(v), text]), String(c.capBytesPerSecond), (v) => { c.capBytesPerSecond = Number(v); });
    const policy = choose('policy', kPolicies, c.policy, (v) => { c.policy = v as Choices['policy']; });
    this.scaleSelect.append(make('option', { value: '' }, 'by displayed size'));
    this.rungSelect.append(make('option', { value: '' }, 'by time and importance'));
    this.scaleSelect.addEventListener('change', () => { c.scale = this.scaleSelect.value === '' ? null : Number(this.scaleSelect.value); changed(); });
    this.rungSelect.addEventListener('change', () => { c.rung = this.rungSelect.value === '' ? null : Number(this.rungSelect.value); changed(); });
    return make('section', {}, make('h2', {}, 'Delivery'), make('div', { class: 'controls' },
      make('label', { for: 'time' }, 'Time limit'), make('div', { class: 'row' }, range, out),
      make('label', { for: 'cap' }, 'Bandwidth'), cap,
      make('label', { for: 'policy' }, 'Policy'), policy,
      make('p', { class: 'note' }, 'These three count from the next load on.'),
      make('label', { for: 'scale' }, 'Mesh scale'), this.scaleSelect,
      make('label', { for: 'rung' }, 'Texture'), this.rungSelect,
      make('div', { class: 'buttons' },
        make('button', { type: 'button', class: 'primary', id: 'reload', onclick: () => this.actions.reload() }, 'Load again'),
        make('button', { type: 'button', id: 'refine', onclick: () => this.actions.refine() }, 'Refine')),
    ));
  }

  private details(title: string, note: string, open: boolean, ...children: Node[]): HTMLDetailsElement {
    const box = make('details', { open }, make('summary', {}, title), make('p', { class: 'note' }, note), ...children);
    box.addEventListener('toggle', () => this.update(this.live));
    this.root.append(box);
    return box;
  }

  private addPlot(box: HTMLDetailsElement, holder: HTMLElement, options: ConstructorParameters<typeof Plot>[1], data: () => (number | null)[][] | null): void {
    this.plots.push({ box, plot: new Plot(holder, options), data });
  }

  private stepSection(): void {
    const holder = make('div');
    const box = this.details('Scales', 'Triangles that are enough at a displayed height: nobody can tell them from the original, and no error is beyond a pixel. The dot is what is shown.', true, holder);
    const triangles = (v: number): string => `${short(v)}`;
    this.addPlot(box, holder, {
      height: 170,
      x: { label: 'displayed height, px', name: 'height', value: format.px, log: true, ticks: (v) => short(v) },
      y: [{ label: 'triangles', ticks: short, log: true }],
      curves: [
        { label: 'enough', colour: 'k1', kind: 'band', value: triangles },
        { label: 'just noticeable', colour: 'k3', kind: 'dashes', value: triangles },
        { label: 'one pixel', colour: 'k4', kind: 'dashes', value: triangles },
      ],
      mark: () => {
        const { displayedPx: x, scale, manifest } = this.live;
        if (!(x > 0)) return null;
        return { x, y: manifest?.scales.find((s) => s.scale === scale)?.triangles, label: scale === null ? 'now' : `S${scale}` };
      },
    }, () => (this.live.manifest ? stepData(this.live.manifest) : null));
  }

  private mapSection(): void {
    const segments = make('div', { class: 'segments', role: 'group', 'aria-label': 'Colour by' });
    const names: [ColourBy, string][] = [['rung', 'rung'], ['eta', 'η'], ['bytes', 'bytes'], ['skipped', 'skipped']];
    for (const [by, text] of names) {
      segments.append(make('button', {
        type: 'button', 'aria-pressed': String(by === this.colourBy),
        onclick: (e) => {
          this.colourBy = by;
          for (const b of segments.children) b.setAttribute('aria-pressed', String(b === e.currentTarget));
          this.map.show(this.live, this.plane(), by);
        },
      }, text));
    }
    this.planeSelect.addEventListener('change', () => {
      this.planeChosen = true;
      this.update(this.live);
    });
    this.mapBox = this.details('Fragments', 'The texture as it is cut; each fragment in the colour of its quality, importance, bytes, or of being left out.', true,
      this.planeSelect, segments, this.map.box);
  }

  private ladderSection(): void {
    const holder = make('div');
    const box = this.details('Ladder', 'What each quality of this texture costs, and how near to the source it comes.', false, holder);
    this.addPlot(box, holder, {
      x: { label: 'quality', value: (v) => v.toFixed(0) },
      y: [{ label: 'bytes', ticks: format.bytes, min: 0 }, { label: 'SSIM', ticks: (v) => v.toFixed(2), max: 1.002, close: true }],
      curves: [
        { label: 'bytes', colour: 'k1', value: format.bytes, fill: true },
        { label: 'SSIM', colour: 'k3', side: 1, value: (v) => v.toFixed(4) },
      ],
    }, () => {
      const t = this.live.tables[this.plane()];
      return t ? ladderData(t) : null;
    });
  }

  private timeSection(): void {
    const [first, second] = [make('div'), make('div')];
    const box = this.details('Time', 'Each fragment as it came: the time the plan gave it and the time it took, then credit and bandwidth.', false, first, second);
    const secondsTicks = (v: number): string => (Math.abs(v) < 1 ? `${(v * 1000).toFixed(0)} ms` : `${v.toFixed(1)} s`);
    const x = { label: 'seconds since the start', name: 'at', value: (v: number) => `${v.toFixed(2)} s`, ticks: (v: number) => v.toFixed(2) };
    this.addPlot(box, first, {
      x, y: [{ label: 'per fragment', ticks: secondsTicks, min: 0 }],
      curves: [
        { label: 'planned', colour: 'k3', kind: 'line', value: secondsTicks },
        { label: 'took', colour: 'k1', kind: 'points', value: secondsTicks },
      ],
    }, () => turnData(this.live, (t) => [t.plannedS, t.actualS]));
    this.addPlot(box, second, {
      x, y: [{ label: 'credit', ticks: secondsTicks }, { label: 'Mbit/s', ticks: (v) => v.toFixed(v < 10 ? 1 : 0), min: 0 }],
      curves: [
        { label: 'credit', colour: 'k4', value: secondsTicks, fill: true },
        { label: 'bandwidth', colour: 'k2', side: 1, value: (v) => `${v.toFixed(2)} Mbit/s` },
      ],
    }, () => turnData(this.live, (t) => [t.creditS, t.bytesPerSecond < kMostRate ? (t.bytesPerSecond * 8) / 1e6 : null]));
  }

  private bytesSection(): void {
    const holder = make('div');
    const box = this.details('Bytes', 'What has come over the line, by what it was for.', false, holder);
    this.addPlot(box, holder, {
      x: { label: '', name: 'for', value: (v) => kKinds[v] ?? '', ticks: (v) => kKinds[v] ?? '', splits: kKinds.map((_, i) => i), range: [-0.6, kKinds.length - 0.4] },
      y: [{ label: 'bytes', ticks: format.bytes, min: 0 }],
      curves: [{ label: 'received', colour: 'k1', kind: 'bars', value: format.bytes }],
    }, () => (this.live.transfers.length ? [kKinds.map((_, i) => i), bytesByKind(this.live.transfers)] : null));
  }
}

function secondsOrDash(s: number): string {
  return Number.isFinite(s) ? format.seconds(s) : '–';
}

/** 150000 -> 150k. */
function short(n: number): string {
  if (n >= 9.995e5) return `${Number((n / 1e6).toPrecision(3))}M`;
  if (n >= 1000) return `${Number((n / 1000).toPrecision(3))}k`;
  return String(Math.round(n));
}

const kLeastPx = 16;
const kMostRate = 1.25e9; // bytes per second: what came in one piece with something else says nothing of the link

/** Triangles over displayed height by the three rules, on the union of their steps. */
function stepData(m: Manifest): number[][] {
  const rules = (['default', 'jnd', 'error'] as const).map((rule) => stepFunction(m.scales, rule));
  const ends = rules.flat().map((s) => s.upToPx).filter((x) => x < 1e8);
  const most = Math.max(4096, ...ends.map((x) => x * 1.6));
  const x = [...new Set([kLeastPx, ...ends.filter((e) => e > kLeastPx), most])].sort((a, b) => a - b);
  // Dashed curves have no steps of their own: each step's end stands twice, a hair apart.
  const xs = x.flatMap((v, i) => (i === 0 || i === x.length - 1 ? [v] : [v, v * 1.0005]));
  const triangles = new Map(m.scales.map((s) => [s.scale, s.triangles]));
  const at = (steps: { upToPx: number; scale: number }[], h: number): number =>
    triangles.get((steps.find((s) => h <= s.upToPx) ?? steps[steps.length - 1]!).scale) ?? 1;
  return [xs, ...rules.map((steps) => xs.map((h) => at(steps, h)))];
}

/** Bytes and mean SSIM of a plane by rung, each fragment by its share of the surface. */
function ladderData(t: PlaneTables): number[][] {
  const fragments = t.columns * t.rows;
  const total = [...t.order].reduce((sum, f) => sum + (t.surfaceFraction[f] ?? 0), 0) || 1;
  const rows = Array.from(t.rungQuality, (_, r) => {
    let bytes = t.tableBytes[r] ?? 0;
    let loss = 0;
    for (const f of t.order) {
      bytes += t.sizeBytes[r * fragments + f] ?? 0;
      loss += ((t.dssim[r * fragments + f] ?? 0) * (t.surfaceFraction[f] ?? 0)) / total;
    }
    return [bytes, 1 - loss] as const;
  });
  let sum = 0;
  const bytes = rows.map(([b]) => (t.incremental ? (sum += b) : b));
  return [[...t.rungQuality], bytes, rows.map(([, s]) => s)];
}

function turnData(live: Live, of: (t: Live['turns'][number]) => (number | null)[]): (number | null)[][] | null {
  const turns = live.turns.filter((t) => !t.skipped).sort((a, b) => a.at - b.at);
  if (turns.length < 2) return null;
  const columns: (number | null)[][] = [turns.map((t) => t.at)];
  turns.forEach((t, i) => of(t).forEach((v, k) => ((columns[k + 1] ??= [])[i] = v)));
  return columns;
}
