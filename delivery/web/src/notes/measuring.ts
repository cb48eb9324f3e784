import type { About } from '../format/about';
import type { Point } from '../format/annotations';
import type { PackageDocuments } from '../http/package_documents';
import { type NotesLayer, make } from './layer';
import { lengthInWords, lengthOf, positionBits } from './measure';
import { onPlaces } from './placing';

const svg = 'http://www.w3.org/2000/svg';

/**
 * Measures lines of points on the object until the function that it gives is called. The load is asked for
 * its finest scale, `documents` for the grid of positions.
 */
export function measure(layer: NotesLayer, documents: Pick<PackageDocuments, 'provenance'>,
    about: About): () => void {
  const { stage, words } = layer;
  const load = stage.load();
  load?.setOverride({ scale: 0 });
  const points: Point[] = [];
  let bits: number | undefined;
  const picture = document.createElementNS(svg, 'svg');
  const line = picture.appendChild(document.createElementNS(svg, 'polyline'));
  line.setAttribute('style', 'fill:none;stroke:#fff;stroke-width:3;filter:drop-shadow(0 0 1px #000)');
  const said = make('output', { 'aria-live': 'polite' }, words.measureHelp);
  const box = make('div', { class: 'line' });
  const draw = (): void => {
    const at = points.map((p) => layer.pxOf(p)).filter((p) => p !== undefined);
    line.setAttribute('points', at.map(({ x, y }) => `${x.toFixed(1)},${y.toFixed(1)}`).join(' '));
    picture.querySelectorAll('circle').forEach((circle) => circle.remove());
    for (const { x, y } of at) {
      const dot = picture.appendChild(document.createElementNS(svg, 'circle'));
      for (const [name, value] of Object.entries({ cx: x, cy: y, r: 5, fill: '#a43d00', stroke: '#fff' }))
        dot.setAttribute(name, `${value}`);
    }
  };
  const tell = (): void => {
    const scale = stage.load()?.state.scale ?? -1;
    said.textContent = points.length < 2 ? words.measureHelp
      : `${lengthInWords(lengthOf(points, stage.manifest, scale, bits), about.unit?.metres)}${
        scale >= 0 ? ` (S_${scale})` : ''}`;
  };
  void documents.provenance().then((provenance) => {
    bits = positionBits(provenance);
    tell();
  }, () => undefined); // the usual grid, then
  box.append(said, ' ', make('button', {}, words.clear, () => {
    points.length = 0;
    draw();
    tell();
  }));
  layer.root.append(picture, box);
  const ends = [onPlaces(layer, ({ position }) => {
    points.push(position);
    draw();
    tell();
  }), layer.follow(draw)];
  return () => {
    for (const end of ends) end();
    picture.remove();
    box.remove();
    load?.setOverride({});
  };
}
