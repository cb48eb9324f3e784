import { startBytes } from '../format/layout';
import { frame } from '../page/framing';
import type { PageModel, ShowablePackage } from '../page/page_model';
import { OrbitInput } from './orbit_input';
import { forbidden, trusted } from './page_policy';
import {
  bytesAt, degreesOf, linkBytesS, mostBytes, numberOf, offerInWords, orbitOf, savesData,
  sentenceOf, words, wordsFor,
} from './wording';

/** Looks of the element; applications change them by parts, slots and the custom properties. */
const style = `
:host { display: block; position: relative; width: 300px; height: 300px; contain: content;
  color-scheme: light dark; --texmesh-text: light-dark(#1c1c1c, #f2f2f2);
  --texmesh-panel: light-dark(rgb(255 255 255 / .88), rgb(24 24 24 / .88));
  --texmesh-accent: light-dark(#0b57a4, #8ec5ff); }
:host([hidden]) { display: none; }
canvas, .poster { position: absolute; inset: 0; width: 100%; height: 100%; }
canvas { outline-offset: -3px; cursor: grab; touch-action: pan-y; }
canvas:active { cursor: grabbing; }
:host(:not([camera-controls])) canvas { cursor: default; touch-action: auto; }
:focus-visible { outline: 3px solid var(--texmesh-accent); }
.poster { pointer-events: none; }
.poster.fades { transition: opacity .15s; }
.poster img, ::slotted([slot=poster]) { width: 100%; height: 100%; object-fit: contain; }
.poster.gone { opacity: 0; }
.bar { position: absolute; left: 0; top: 0; height: 3px; min-width: 10%; background: var(--texmesh-accent); }
.box, .note, .rights { unicode-bidi: plaintext; }
.box { position: absolute; left: 0; right: 0; margin: 0 auto; top: 50%; transform: translateY(-50%);
  width: fit-content; max-width: 94%; max-height: 100%; overflow: auto; box-sizing: border-box;
  padding: .6em 1em; border: 1px solid transparent; border-radius: .5em; font: inherit; text-align: center;
  color: var(--texmesh-text); background: var(--texmesh-panel); overflow-wrap: anywhere; }
.box small { display: block; }
.box[hidden] { display: none; }
button { cursor: pointer; min-height: 44px; }
.box button { font: inherit; color: var(--texmesh-accent); background: none; border: 1px solid;
  border-radius: .4em; margin-top: .5em; padding: 0 1em; }
.rights, .note { position: absolute; max-width: 100%; box-sizing: border-box; padding: .15em .5em;
  font-size: 12px; color: var(--texmesh-text); background: var(--texmesh-panel); }
.rights { right: 0; bottom: 0; }
.note { left: 0; top: 3px; }
.note[hidden] { display: none; }
.rights:empty { display: none; }
.rights a { color: inherit; }
.help { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%); }
:host([disable-zoom]) .help span { display: none; }
@media (prefers-reduced-motion: reduce) { .poster.fades { transition: none; } }
`;

/** The page that all elements share, as far as an element uses it. */
export interface ElementPage {
  add(canvas: HTMLCanvasElement, url: string,
    options: { dress?: (scene: import('three').Scene) => void }): PageModel;
  regard(model?: PageModel): void;
}
/** What an element needs of the script that defines it. */
export interface ElementHost {
  /** Throws where the browser has no WebGL. */
  page(): ElementPage;
  dress(scene: import('three').Scene): void;
}

/** Degrees per second. */
const rotationDegreesS = 12;
const noteMs = 8000;
/** Percent by which the bar grows. */
const barStep = 20;

const template = `<canvas part="canvas" role="img"></canvas>
<div class="poster" part="poster"><slot name="poster"></slot></div>
<slot name="progress-bar"><div class="bar" part="progress" role="progressbar" aria-label="loading"
  aria-valuemin="0" aria-valuemax="100" hidden></div></slot>
<button class="box" part="reveal" hidden><span></span><small></small></button>
<div class="box" part="error" role="alert" hidden></div>
<div class="note" part="note" role="status" hidden></div>
<div class="rights" part="rights"></div>
<p class="help" id="help">Drag or use the arrow keys to turn the object<span>, plus and minus to come nearer
  or go away</span>, Home to see it as at first.</p>
<slot></slot>`;

let sheet: CSSStyleSheet | undefined;

/** <texmesh-viewer>; `host` is to be set before the element is defined. */
export class TexmeshViewer extends HTMLElement {
  static host: ElementHost;
  /** What the element says, by language; the page's `lang` chooses. */
  static readonly words = words;
  static readonly observedAttributes = ['src', 'alt', 'poster', 'camera-controls', 'camera-orbit',
    'auto-rotate', 'rotation-per-second', 'disable-zoom', 'reveal', 'bytes', 'touch-action'];
  private readonly root_ = this.attachShadow({ mode: 'open' });
  private readonly parts_: Record<'canvas' | 'poster' | 'bar' | 'reveal' | 'error' | 'note' | 'rights',
    HTMLElement>;
  private model_?: PageModel;
  private input_?: OrbitInput;
  private revealed_ = false;
  private served_ = { src: '', bytes: 0 }; // what the server has said of the package
  private rotating_ = 0;
  private ends_?: () => void; // takes away what more_() has added

  constructor() {
    super();
    // A page whose policy forbids styles in its text (CSP) allows this one.
    (sheet ??= new CSSStyleSheet()).replaceSync(style);
    this.root_.adoptedStyleSheets = [sheet];
    this.root_.innerHTML = trusted('createHTML', template);
    const part = (selector: string): HTMLElement => this.root_.querySelector(selector)!;
    this.parts_ = { canvas: part('canvas'), poster: part('.poster'), bar: part('.bar'),
      reveal: part('button.box'), error: part('div.box'), note: part('.note'), rights: part('.rights') };
    this.parts_.reveal.onclick = () => this.dismissPoster();
    const { canvas } = this.parts_;
    for (const name of ['pointerenter', 'focus'])
      canvas.addEventListener(name, () => this.model_ && TexmeshViewer.host.page().regard(this.model_));
    for (const name of ['pointerleave', 'blur'])
      canvas.addEventListener(name, () => this.model_ && TexmeshViewer.host.page().regard(undefined));
  }

  /** Whether what the time allowed is there. */
  get loaded(): boolean {
    return this.model_?.phase === 'shown';
  }
  /** The model on the page; undefined before it is revealed. */
  get model(): PageModel | undefined {
    return this.model_;
  }
  get src(): string {
    return this.getAttribute('src') ?? '';
  }
  set src(url: string) {
    this.setAttribute('src', url);
  }
  /** Begins to load what `reveal="manual"` or the browser's Save-Data has held back. */
  dismissPoster(): void {
    this.revealed_ = true;
    this.start_();
  }

  connectedCallback(): void {
    this.describe_();
    this.start_();
  }
  disconnectedCallback(): void {
    // An element that is moved is there again before the microtask.
    queueMicrotask(() => !this.isConnected && this.stop_());
  }
  attributeChangedCallback(name: string, before: string | null, now: string | null): void {
    if (before === now || !this.isConnected) return;
    this.describe_();
    if (name === 'src') {
      this.stop_();
      this.revealed_ = false;
      this.start_();
    } else if (name === 'reveal') this.start_();
    else if (name === 'camera-orbit') this.input_?.reset(orbitOf(now));
    else if (/rotat/.test(name)) this.rotate_();
    else if (name === 'camera-controls' || name === 'disable-zoom') this.controls_();
  }

  // ---- what stands there

  private describe_(): void {
    const { canvas, poster, reveal } = this.parts_;
    canvas.setAttribute('aria-label', this.getAttribute('alt') ?? '');
    canvas.style.touchAction = this.getAttribute('touch-action') ?? '';
    // Who can do nothing with a picture is not led there by keys.
    for (const [attribute, value] of [['tabindex', '0'], ['aria-describedby', 'help']])
      if (this.hasAttribute('camera-controls')) canvas.setAttribute(attribute, value);
      else canvas.removeAttribute(attribute);
    const url = this.getAttribute('poster');
    const slot = poster.firstElementChild!;
    if (url && !(slot.firstElementChild as HTMLImageElement | null)?.src.endsWith(url)) {
      const image = Object.assign(document.createElement('img'), { src: url, alt: '', loading: 'lazy' });
      slot.replaceChildren(image);
    } else if (!url) slot.replaceChildren();
    const said = numberOf(this.getAttribute('bytes'), 0, 0, mostBytes);
    const { src } = this;
    if (!said && src && this.waits_ && this.served_.src !== src) {
      const served = (this.served_ = { src, bytes: 0 });
      void bytesAt(src).then((bytes) => {
        served.bytes = bytes;
        if (this.isConnected) this.describe_();
      });
    }
    const allBytes = said || (this.served_.src === src ? this.served_.bytes : 0);
    reveal.querySelector('span')!.textContent = this.words_.show;
    reveal.querySelector('small')!.textContent = offerInWords(startBytes, allBytes, linkBytesS());
  }
  private get words_(): typeof words.en {
    return wordsFor((this.closest<HTMLElement>('[lang]') ?? document.documentElement).lang);
  }
  private get waits_(): boolean {
    return !this.revealed_ && (this.getAttribute('reveal') === 'manual' || savesData());
  }
  private start_(): void {
    const { reveal, canvas } = this.parts_;
    if (this.model_ || !this.isConnected || !this.src) return;
    reveal.hidden = !this.waits_;
    if (this.waits_) return;
    try {
      this.follow_(TexmeshViewer.host.page().add(canvas as HTMLCanvasElement,
        new URL(this.src, document.baseURI).href, { dress: (scene) => TexmeshViewer.host.dress(scene) }));
    } catch (error) {
      this.fail_(error, false);
    }
  }
  private stop_(): void {
    cancelAnimationFrame(this.rotating_);
    this.rotating_ = 0;
    this.input_?.dispose();
    this.model_?.remove();
    this.ends_?.();
    this.input_ = this.model_ = this.ends_ = undefined;
    const { poster, bar, error, note, rights } = this.parts_;
    poster.classList.remove('gone');
    bar.hidden = error.hidden = note.hidden = true;
    rights.replaceChildren();
  }

  // ---- the model's course

  private follow_(model: PageModel): void {
    const { bar, error, poster } = this.parts_;
    this.model_ = model;
    const tell = (name: string, detail: object = {}): void =>
      void this.dispatchEvent(new CustomEvent(name, { detail }));
    model.on('open', () => this.controls_());
    model.on('first-picture', () => {
      // A poster of nothing does not fade: each frame of that would draw the whole page.
      poster.classList.toggle('fades', this.hasPoster_);
      if (!this.hasPoster_) this.note_('');
      poster.classList.add('gone');
      tell('poster-dismissed');
      tell('model-visibility', { visible: true });
      this.rotate_();
      void this.more_(model);
    });
    model.on('progress', ({ bytes, bytesExpected }) => {
      const totalProgress = bytesExpected > 0 ? Math.min(1, bytes / bytesExpected) : 0;
      // In few steps: each is a frame, and twenty elements' bars would keep the browser drawing the page.
      const percent = `${barStep * Math.floor((100 * totalProgress) / barStep)}`;
      if (percent !== bar.getAttribute('aria-valuenow')) {
        bar.style.width = `${percent}%`;
        bar.setAttribute('aria-valuenow', percent);
      }
      tell('progress', { totalProgress });
    });
    model.on('phase', ({ phase }) => {
      bar.hidden = phase !== 'opening' && phase !== 'turn';
      if (phase === 'opening') error.hidden = true;
    });
    model.on('loaded', () => {
      const { form, client: { compressed } } = model.package!;
      if (form === 'whole' || compressed)
        void this.tellOwner_(({ slowHostNote }) => slowHostNote(form, compressed, model.url));
      void this.showRights_(model.package);
      tell('load', { url: model.url });
    });
    model.on('context',
      ({ lost }) => this.note_(lost ? 'The graphics memory was taken away; waiting for it.' : ''));
    model.on('memory',
      () => this.note_('There is little graphics memory: a coarser picture is shown.', noteMs));
    let told = false;
    model.on('error', ({ fatal, error: problem, message }) => {
      tell('error', { type: 'loadfailure', fatal, message });
      if (fatal) return this.fail_(problem, true);
      if (model.lacking) this.note_(this.words_.rest, noteMs);
      if (!told) console.info(`<texmesh-viewer src="${this.src}">: ${message}`);
      if (!told && forbidden.size > 0) this.tellCause_(problem);
      told = true;
    });
    this.note_(this.hasPoster_ ? '' : this.words_.loading);
  }
  private get hasPoster_(): boolean {
    const slot = this.parts_.poster.firstElementChild as HTMLSlotElement;
    return slot.assignedElements({ flatten: true }).length > 0;
  }
  /** A sentence and a way on for visitors; the rest for those who look after the page. */
  private fail_(problem: unknown, again: boolean): void {
    const { error, bar } = this.parts_;
    const said = this.words_;
    console.error(`<texmesh-viewer src="${this.src}">:`, problem);
    this.tellCause_(problem);
    // What fails before there is a model: the browser has no WebGL.
    const what = again ? sentenceOf(problem) : 'no3d';
    const button = Object.assign(document.createElement('button'),
      { textContent: said.again, hidden: what === 'no3d', onclick: () => this.model_?.retry() });
    error.replaceChildren(said[what], document.createElement('br'), button);
    error.hidden = false;
    bar.hidden = true;
    this.note_('');
  }
  private tellCause_(problem: unknown): void {
    const { src } = this;
    void this.tellOwner_(({ causeOf }) => causeOf(problem, src, document.baseURI, forbidden));
  }
  private async tellOwner_(text: (by: typeof import('./for_owners')) => string): Promise<void> {
    const by = await import('./for_owners').catch(() => undefined);
    const line = by ? text(by) : '';
    if (line) console.info(`<texmesh-viewer>: ${line}`);
  }
  /** A short line for a while, or until the next one. */
  private note_(text: string, ms = Infinity): void {
    const { note } = this.parts_;
    note.textContent = text;
    note.hidden = text === '';
    if (ms < Infinity) setTimeout(() => note.textContent === text && (note.hidden = true), ms);
  }
  /** Notes, measuring and AR, whose code comes where somebody can use them. */
  private async more_(model: PageModel): Promise<void> {
    if (this.ends_ || (!model.package?.manifest.annotations &&
        !this.matches('[ar],[annotate],[measure]'))) return;
    this.ends_ = () => undefined;
    const end = await (await import('../notes/attach')).attach(this, this.root_, model, (orbit) => {
      cancelAnimationFrame(this.rotating_);
      if (this.input_) this.input_.orbit = orbit;
    });
    if (model === this.model_) this.ends_ = end;
    else end();
  }
  private async showRights_(pkg?: ShowablePackage): Promise<void> {
    const about = await pkg?.about().catch(() => undefined);
    if (!about || !this.isConnected || pkg !== this.model_?.package) return;
    const { attribution, creator, licence, licenceUrl } = about;
    const link = licence && licenceUrl ? Object.assign(document.createElement('a'),
      { href: licenceUrl, textContent: licence, rel: 'license noopener' }) : (licence ?? '');
    const by = attribution ?? creator ?? '';
    this.parts_.rights.replaceChildren(...[by, by && licence ? ' · ' : '', link].filter((part) =>
      part !== ''));
  }

  // ---- the camera

  private controls_(): void {
    const { model_: model, parts_: { canvas } } = this;
    if (!model?.package) return;
    this.input_?.dispose();
    this.input_ = undefined;
    const orbit = orbitOf(this.getAttribute('camera-orbit'));
    model.frame(orbit);
    if (this.hasAttribute('camera-controls'))
      this.input_ = new OrbitInput(canvas, orbit, () => this.look_(this.input_!.orbit),
        !this.hasAttribute('disable-zoom'));
    if (this.rotating_) this.rotate_(); // by the new input
  }
  private look_(orbit: Parameters<typeof frame>[3]): void {
    const { model_: model } = this;
    if (!model?.package) return;
    const { boundsMin, boundsMax } = model.package.manifest;
    frame(model.camera, boundsMin, boundsMax, orbit);
    model.moved();
  }
  /** Turns the object while nobody holds it; not for people who want no motion. */
  private rotate_(): void {
    cancelAnimationFrame(this.rotating_);
    if (!this.model_ || !this.hasAttribute('auto-rotate') ||
        matchMedia('(prefers-reduced-motion: reduce)').matches) return;
    const degreesS = degreesOf(this.getAttribute('rotation-per-second'), rotationDegreesS);
    const own = this.input_ ?? { orbit: orbitOf(this.getAttribute('camera-orbit')), isHeld: false };
    let before = performance.now();
    const step = (now: number): void => {
      const { model_: model } = this;
      if (!model || model.phase === 'removed') return;
      if (!own.isHeld && model.place.visible) {
        own.orbit = { ...own.orbit,
          thetaDegrees: (own.orbit.thetaDegrees + (degreesS * Math.min(100, now - before)) / 1000) % 360 };
        this.look_(own.orbit);
      }
      before = now;
      this.rotating_ = requestAnimationFrame(step);
    };
    this.rotating_ = requestAnimationFrame(step);
  }
}
