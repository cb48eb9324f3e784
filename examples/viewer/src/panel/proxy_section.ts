import { proxyLoss, servingProxy } from 'texmesh';
import type { Manifest } from 'texmesh';
import { make } from '../dom';
import * as format from '../format';
import type { Live } from '../live';
import { foldingSection } from './section';

/** The package's proxies: what they weigh, how they look at the displayed height, and which one is shown. */
export class ProxySection {
  readonly box: HTMLDetailsElement;
  private readonly rows = make('tbody');
  private shown = '';

  constructor(private readonly live: () => Live) {
    const heads = ['proxy', 'bytes', 'triangles', 'texture', 'FLIP here'].map((text) =>
      make('th', { scope: 'col' }, text));
    this.box = foldingSection('Proxies', 'The whole object in one small file each, with an atlas of its ' +
      'own. The smallest is the first picture; a larger one comes on slow links, and one that cannot be ' +
      'told from the source is all that is fetched.', false,
      make('table', { id: 'proxies' }, make('thead', {}, make('tr', {}, ...heads)), this.rows));
    this.box.hidden = true;
  }

  draw(): void {
    const { manifest, displayedPx, proxy } = this.live();
    this.box.hidden = !manifest?.proxies.length;
    if (!manifest || this.box.hidden || !this.box.open) return;
    const rows = proxyRows(manifest, displayedPx, proxy);
    const text = JSON.stringify(rows);
    if (text === this.shown) return;
    this.shown = text;
    this.rows.replaceChildren(...rows.map((cells, k) => {
      const row = make('tr', {}, ...cells.map((cell) => make('td', {}, cell)));
      if (k === proxy) row.setAttribute('aria-current', 'true');
      return row;
    }));
  }
}

/** The cells of each proxy. */
export function proxyRows(m: Manifest, displayedPx: number, shown: number): string[][] {
  const serving = displayedPx > 0 ? servingProxy(m, displayedPx) : -1;
  return m.proxies.map((p, k) => [
    `${k}${k === shown ? ' · shown' : ''}`, format.bytes(p.glb.bytes), format.short(p.triangles),
    p.texturePx > 0 ? format.px(p.texturePx) : '–',
    displayedPx > 0 ? `${proxyLoss(m, k, displayedPx).flip.toFixed(3)}${k === serving ? ' · enough' : ''}`
      : '–',
  ]);
}
