import type { NotesLayer } from './layer';
import { type Picked, pick } from './pick';

/** A press that moves farther is a drag. */
const clickPx = 5;

/**
 * Hands on each point of the object that somebody clicks on, or takes from the middle of the picture by Enter
 * while the canvas has the focus. Gives a function that ends it.
 */
export function onPlaces(layer: NotesLayer, use: (picked: Picked) => void): () => void {
  const { canvas, camera } = layer.stage;
  const ended = new AbortController(), { signal } = ended;
  const cross = layer.root.appendChild(document.createElement('span'));
  cross.className = 'cross';
  const at = (x: number, y: number): void => {
    const object = layer.stage.load()?.object;
    const picked = object && pick(object, camera, x, y);
    if (picked) use(picked);
  };
  let down: { x: number; y: number } | undefined;
  canvas.addEventListener('pointerdown', ({ clientX: x, clientY: y }) => (down = { x, y }), { signal });
  canvas.addEventListener('pointerup', ({ clientX, clientY }) => {
    if (!down || Math.hypot(clientX - down.x, clientY - down.y) > clickPx) return;
    const { left, top, width, height } = canvas.getBoundingClientRect();
    at((2 * (clientX - left)) / width - 1, 1 - (2 * (clientY - top)) / height);
  }, { signal });
  canvas.addEventListener('keydown', (e) => {
    if (e.key !== 'Enter') return;
    e.preventDefault();
    at(0, 0);
  }, { signal });
  return () => {
    ended.abort();
    cross.remove();
  };
}
