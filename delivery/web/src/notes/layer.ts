// Numbers over the picture, a card of one note, the list of all, and the tour.

import type { Object3D, PerspectiveCamera } from 'three';
import type { Annotation, Point } from '../format/annotations';
import type { Manifest } from '../format/manifest';
import type { LoadedModel } from '../scene/api';
import { DepthPicture } from './depth';
import { apply, placeOf, unit } from './pick';
import { textFor } from './texts';
import { noteWordsFor, type NoteWords } from './words';

/** A view: a place, what it looks at, and the vertical field of view. */
export interface View {
  position: Point;
  target: Point;
  fovDegrees: number;
}
/** What shows the object, as far as notes need it. */
export interface NotesStage {
  /** Over it the numbers stand. */
  readonly canvas: HTMLElement;
  readonly camera: PerspectiveCamera;
  readonly manifest: Manifest;
  /** Undefined before there is a picture. */
  load(): LoadedModel | undefined;
  /** Takes this place for the camera and draws; in the coordinates of the package's meshes. */
  look(position: Point, target: Point): void;
}

/** Looks of the layer; the custom properties of the element give the colours. */
export const notesStyle = `
.tm-notes { position: absolute; inset: 0; overflow: hidden; pointer-events: none;
  font: 14px/1.4 system-ui, sans-serif;
  color: var(--texmesh-text, #1c1c1c); }
.tm-notes :is(button, input, textarea) { font: inherit; color: inherit; }
.tm-notes button { min-width: 2rem; min-height: 2rem; border: 1px solid; border-radius: .4rem;
  padding: 0 .6rem;  background: var(--texmesh-panel, #fffffff0); cursor: pointer; pointer-events: auto; }
.tm-notes button:focus-visible { outline: 3px solid #fff; box-shadow: 0 0 0 5px #0b57a4; }
.tm-notes .pin { position: absolute; left: 0; top: 0; margin: -1rem 0 0 -1rem; padding: 0;
  width: 2rem; height: 2rem;
  border: 2px solid #fff; border-radius: 1rem; background: #0b57a4; color: #fff; font-weight: 600; }
.tm-notes .pin[aria-expanded=true] { background: #a43d00; }
.tm-notes .pin:not(.behind) { z-index: 1; }
.tm-notes .pin.behind { opacity: .3; }
.tm-notes :is(.card, .list, .line) { z-index: 2; }
.tm-notes .card { position: absolute; left: .5rem; bottom: 2rem; width: min(22rem, calc(100% - 1rem));
  max-height: 55%;
  overflow: auto; box-sizing: border-box; padding: .6rem .8rem; border-radius: .5rem; pointer-events: auto;
  background: var(--texmesh-panel, #fffffff0); overflow-wrap: anywhere; }
.tm-notes .card h3 { margin: 0 0 .3rem; font-size: 1rem; }
.tm-notes .card p { margin: .3rem 0; }
.tm-notes .card :is(input, textarea) { display: block; width: 100%; box-sizing: border-box;
  background: transparent;  border: 1px solid; border-radius: .3rem; padding: .3rem; }
.tm-notes .list { position: absolute; right: .5rem; top: .5rem; max-width: calc(100% - 1rem); max-height: 80%;
  overflow: auto;
  pointer-events: auto; text-align: right; }
.tm-notes .list ol { list-style: none; margin: .3rem 0; padding: .3rem; border-radius: .4rem;
  text-align: left;
  background: var(--texmesh-panel, #fffffff0); }
.tm-notes .list li button { display: block; width: 100%; text-align: left; border: 0; background: none; }
.tm-notes svg { position: absolute; inset: 0; width: 100%; height: 100%; overflow: visible; }
.tm-notes .line { position: absolute; left: 50%; bottom: .5rem; transform: translateX(-50%);
  max-width: 96%; padding: .2rem .7rem;
  border-radius: .4rem; background: var(--texmesh-panel, #fffffff0); }
.tm-notes .cross { position: absolute; left: 50%; top: 50%; width: 15px; height: 15px; margin: -8px;
  border-radius: 9px;
  border: 1px solid #fff; outline: 1px solid #000; }
.tm-notes .live { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%); }
.tm-notes [hidden] { display: none; }
`;

/** An element with attributes, a text and what happens on a click. */
export function make<K extends keyof HTMLElementTagNameMap>(name: K, attributes: Record<string, string> = {},
    text = '', click?: () => void): HTMLElementTagNameMap[K] {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.textContent = text; // never markup: texts are strangers'
  if (click) element.addEventListener('click', click);
  return element;
}

/** Seconds that a tour stays at a stop. */
export const tourStopS = 8;

/** A layer over a canvas. Several parts may show things in it; all follow the camera. */
export class NotesLayer {
  readonly root = make('div', { class: 'tm-notes', part: 'notes' });
  readonly words: NoteWords;
  readonly live = make('p', { class: 'live', 'aria-live': 'polite' });
  readonly card = make('section', { class: 'card', role: 'dialog', hidden: '' });
  private readonly pins_ = make('div', { role: 'group' });
  private readonly list_ = make('div', { class: 'list' });
  private readonly all_ = make('ol', { hidden: '' });
  private frame_ = 0;
  private seen_ = '';
  private hidesAnew_ = false; // the camera has moved since it was told which points are hidden
  private hidesAfter_ = 0; // ms; a look at all triangles takes no more than a twentieth of the time
  private open_ = -1;
  private tour_ = 0; // 0: there is none; else its number
  private readonly followers_ = new Set<() => void>();
  /** What an editor adds to the card of a note. */
  edit?: (note: Annotation, card: HTMLElement) => void;

  constructor(readonly stage: NotesStage, public notes: Annotation[], readonly languages: readonly string[]) {
    this.words = noteWordsFor(languages[0]);
    const style = make('style', {}, notesStyle);
    this.root.append(style, this.pins_, this.list_, this.card, this.live);
    this.root.addEventListener('keydown', (e) => this.key_(e));
    stage.canvas.addEventListener('keydown', this.escape_);
    this.show();
    const step = (): void => {
      this.frame_ = requestAnimationFrame(step);
      const { camera, canvas } = this.stage;
      const now = `${camera.matrixWorld.elements}${camera.projectionMatrix.elements}${canvas.clientWidth}x${
        canvas.clientHeight}S${this.stage.load()?.state.scale}`;
      if (now !== this.seen_) {
        this.seen_ = now;
        this.place_();
        this.hidesAnew_ = true;
      }
      if (this.hidesAnew_ && performance.now() >= this.hidesAfter_) this.hide_();
    };
    this.frame_ = requestAnimationFrame(step);
  }
  dispose(): void {
    cancelAnimationFrame(this.frame_);
    this.stage.canvas.removeEventListener('keydown', this.escape_);
    this.tour_ = 0;
    this.root.remove();
  }
  /** Calls when the camera has moved; gives a function that ends the calls. */
  follow(moved: () => void): () => void {
    this.followers_.add(moved);
    moved();
    return () => this.followers_.delete(moved);
  }
  /** Where a point of the package stands over the canvas, CSS px; undefined behind the camera. */
  pxOf(point: Point): { x: number; y: number } | undefined {
    const { camera, canvas } = this.stage, object = this.object_;
    const at = object && placeOf(object, camera, point);
    return at && { x: ((at[0] + 1) / 2) * canvas.clientWidth, y: ((1 - at[1]) / 2) * canvas.clientHeight };
  }
  /** The notes anew: numbers and list. */
  show(): void {
    const { notes, words } = this;
    const titles = notes.map((note) => textFor(note, this.languages));
    this.pins_.setAttribute('aria-label', words.notes);
    this.pins_.replaceChildren(...notes.map((_, i) => make('button', { class: 'pin', 'aria-expanded': 'false',
      'aria-label': `${i + 1}: ${titles[i].title}`, lang: titles[i].language }, `${i + 1}`,
    () => this.open(i))));
    const all = this.all_;
    all.replaceChildren(...notes.map((_, i) => {
      const item = make('li');
      item.append(make('button', { lang: titles[i].language }, `${i + 1} ${titles[i].title}`,
        () => this.open(i)));
      return item;
    }));
    const names = make('button', { 'aria-expanded': String(!all.hidden) }, `${words.notes} (${notes.length})`,
      () => {
        all.hidden = !all.hidden;
        names.setAttribute('aria-expanded', String(!all.hidden));
      });
    const tour = make('button', {}, words.tour, () => void this.tour());
    tour.hidden = notes.length < 2;
    this.list_.hidden = notes.length === 0;
    this.list_.replaceChildren(names, ' ', tour, all);
    this.seen_ = '';
  }
  /** Opens the card of a note, and goes where its camera stands. */
  open(i: number, looks = true): void {
    const { card, words, notes } = this;
    const note = notes[i];
    if (!note) return;
    if (this.tour_ && looks) this.tour_ = 0;
    this.mark_(i);
    const { language, title, text = '' } = textFor(note, this.languages);
    card.hidden = false;
    card.lang = language;
    card.setAttribute('aria-label', title);
    const images = (note.images ?? []).map(({ url }, k) => make('a', { href: url, target: '_blank',
      rel: 'noopener noreferrer' }, `${words.image} ${k + 1}`));
    const buttons = [make('button', {}, words.before, () => this.open((i + notes.length - 1) % notes.length)),
      make('button', {}, words.next, () => this.open((i + 1) % notes.length)),
      make('button', {}, words.close, () => this.close())];
    const held = [...card.children].indexOf((this.root.getRootNode() as Document).activeElement!);
    card.replaceChildren(make('h3', {}, `${i + 1}. ${title}`), ...(text ? [make('p', {}, text)] : []),
      ...images.flatMap((image) => [image, ' ']), ...buttons.flatMap((button) => [button, ' ']));
    if (held >= 0) buttons[1].focus(); // what had the focus is gone
    this.edit?.(note, card);
    this.live.textContent = `${i + 1}: ${title}. ${text}`;
    if (looks) this.lookAt_(this.viewOf(note));
  }
  close(): void {
    this.tour_ = 0;
    const before = this.pins_.children[this.open_] as HTMLElement | undefined;
    this.mark_(-1);
    this.card.hidden = true;
    before?.focus();
  }
  /** A note's own camera, else one before it. */
  viewOf(note: Annotation): View {
    const { camera, manifest } = this.stage;
    if (note.camera) return note.camera;
    const away = (manifest.objectHeight || 1) * 0.6 / Math.tan((camera.fov * Math.PI) / 360);
    const [x, y, z] = this.outwards_(note);
    const [px, py, pz] = note.position;
    return { position: [px + x * away, py + y * away, pz + z * away], target: note.position,
      fovDegrees: camera.fov };
  }
  /**
   * From stop to stop. A stop's detail has until the next one to come, and when it is there, the next
   * stop's is fetched. Resolves when the tour is over or has been ended.
   */
  async tour(stopS = tourStopS): Promise<void> {
    if (this.tour_) return this.close();
    const mine = (this.tour_ = performance.now());
    for (let i = 0; i < this.notes.length && this.tour_ === mine; ++i) {
      const view = this.viewOf(this.notes[i]);
      this.open(i, false);
      this.lookAt_(view);
      const over = new Promise((resolve) => setTimeout(resolve, stopS * 1000));
      const load = this.stage.load();
      const fetched = load?.refine().catch(() => undefined).then(async () => {
        const next = this.notes[i + 1];
        if (this.tour_ !== mine || !next || load !== this.stage.load()) return;
        // Not farther away than now: the scale shown must not become coarser.
        load?.update(this.cameraOf_(this.viewOf(next), view));
        await load?.refine().catch(() => undefined);
        if (this.tour_ === mine) load?.update(this.stage.camera);
      });
      await Promise.race([over, fetched?.then(() => over) ?? over]);
    }
    if (this.tour_ === mine) this.close();
  }

  private get object_(): Object3D | undefined {
    return this.stage.load()?.object;
  }
  /** Where a note looks to; away from the middle of the object where nobody has said. */
  private outwards_({ normal, position }: Annotation): Point {
    if (normal) return normal;
    const { boundsMin, boundsMax } = this.stage.manifest;
    return unit(position.map((p, k) => p - (boundsMin[k] + boundsMax[k]) / 2) as Point) ?? [0, 0, 1];
  }
  /** The camera stays at its field of view: it comes as near as shows the same height. */
  private placeOfView_({ position, target, fovDegrees }: View): Point {
    const half = (degrees: number): number => Math.tan((degrees * Math.PI) / 360);
    const nearer = half(fovDegrees) / half(this.stage.camera.fov);
    return position.map((p, k) => target[k] + (p - target[k]) * nearer) as Point;
  }
  private lookAt_(view: View): void {
    this.stage.look(this.placeOfView_(view), view.target);
  }
  private cameraOf_(view: View, now: View): PerspectiveCamera {
    const camera = this.stage.camera.clone();
    const away = (v: View): number => Math.hypot(...this.placeOfView_(v).map((p, k) => p - v.target[k]));
    const nearer = Math.min(1, away(now) / Math.max(away(view), 1e-12));
    const place = this.placeOfView_(view).map((p, k) => view.target[k] + (p - view.target[k]) * nearer);
    const world = this.object_?.matrixWorld;
    const [from, to] = [place as Point, view.target].map((p) => (world ? apply(world, p) : p));
    camera.position.set(...from);
    camera.lookAt(...to);
    camera.updateMatrixWorld();
    return camera;
  }
  private mark_(i: number): void {
    this.open_ = i;
    [...this.pins_.children].forEach((pin, k) => pin.setAttribute('aria-expanded', String(k === i)));
  }
  private place_(): void {
    const object = this.object_;
    this.pins_.hidden = !object;
    if (!object) {
      this.seen_ = '';
      return;
    }
    this.notes.forEach((note, i) => {
      const pin = this.pins_.children[i] as HTMLElement;
      const at = this.pxOf(note.position);
      pin.hidden = !at;
      if (!at) return;
      pin.style.transform = `translate(${at.x.toFixed(1)}px, ${at.y.toFixed(1)}px)`;
    });
    for (const moved of this.followers_) moved();
  }
  /** Points behind something of the object are pale; the scale shown may lie a little off the surface. */
  private hide_(): void {
    const begin = performance.now(), { camera, manifest } = this.stage, object = this.object_;
    if (!object) return;
    this.hidesAnew_ = false;
    const depth = new DepthPicture(object, camera), off = 0.02 * manifest.objectHeight;
    this.notes.forEach(({ position }, i) =>
      this.pins_.children[i].classList.toggle('behind', depth.hides(position, off)));
    this.hidesAfter_ = performance.now() + 20 * (performance.now() - begin);
  }
  private readonly escape_ = (e: KeyboardEvent): void => {
    if (e.key === 'Escape' && !this.card.hidden) this.close();
  };
  private key_(e: KeyboardEvent): void {
    this.escape_(e);
    const pins = [...this.pins_.children] as HTMLElement[];
    const from = pins.indexOf(e.target as HTMLElement);
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[e.key];
    if (!step || from < 0) return;
    e.preventDefault();
    pins[(from + step + pins.length) % pins.length].focus();
  }
}
