import { make } from '../dom';
import * as format from '../format';
import type { Live } from '../live';

/** What a visitor sees first, what an expert asks for last. */
const kFigures = [
  ['first', 'first picture after'], ['time', 'complete after'], ['bytes', 'received'],
  ['flip', 'difference (FLIP)'],
  ['scale', 'mesh shown'], ['size', 'height on screen'],
] as const;
type Figure = (typeof kFigures)[number][0];

/** The numbers at the top of the panel. */
export class Figures {
  readonly box: HTMLElement;
  private readonly values = new Map<Figure, HTMLElement>();

  constructor() {
    const list = make('dl', { class: 'figures' });
    for (const [key, name] of kFigures) {
      const value = make('dd', { id: `figure-${key}` }, '–');
      this.values.set(key, value);
      list.append(make('div', {}, make('dt', {}, name), value));
    }
    this.box = make('section', {}, list);
  }

  show(l: Live): void {
    const shown = l.proxy >= 0 ? l.manifest?.proxies[l.proxy]
      : l.manifest?.scales.find((s) => s.scale === l.scale);
    this.set('scale', shownName(l), shown ? `${format.short(shown.triangles)} triangles` : '');
    this.set('size', l.displayedPx > 0 ? format.px(l.displayedPx) : '–');
    this.set('bytes', l.bytes > 0 ? format.bytes(l.bytes) : '–',
      l.packageBytes > 0 ? `of ${format.bytes(l.packageBytes)}` : '');
    this.set('first', secondsOrDash(l.firstPictureS));
    this.set('time', secondsOrDash(l.doneS),
      Number.isFinite(l.limitS) && Number.isFinite(l.doneS) ? `of ${format.seconds(l.limitS)}` : '');
    this.set('flip', Number.isFinite(l.predictedFlip) ? l.predictedFlip.toFixed(3) : '–');
  }

  private set(figure: Figure, text: string, more = ''): void {
    this.values.get(figure)?.replaceChildren(text, ...(more ? [make('small', {}, ` ${more}`)] : []));
  }
}

/** What is in the scene. */
export function shownName({ scale, proxy }: Pick<Live, 'scale' | 'proxy'>): string {
  return proxy >= 0 ? `proxy ${proxy}` : scale === null ? '–' : `S_${scale}`;
}

function secondsOrDash(s: number): string {
  return Number.isFinite(s) ? format.seconds(s) : '–';
}
