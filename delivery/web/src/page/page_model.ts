import { type Object3D, PerspectiveCamera, Scene } from 'three';
import { FormatError, InputError, isAbort } from '../format/errors';
import { firstPicture } from '../format/manifest';
import type { OpenOptions, PackageReader } from '../http/package_reader';
import { isForGood } from '../http/requests';
import type { LoadEvents, LoadOptions, LoadedModel, Turn } from '../scene/api';
import { displayOf } from '../scene/camera';
import { Emitter } from '../scene/events';
import { daylight } from './daylight';
import { firstLookFovDegrees } from '../format/shared_numbers';
import { type Orbit, defaultOrbit, frame } from './framing';
import type { PagePlace } from './schedule';

/** A package that can be shown: TexmeshPackage. */
export interface ShowablePackage extends PackageReader {
  /** See TexmeshPackage. */
  load(scene: Object3D, options: LoadOptions): LoadedModel;
}
/**
 * What a model of a page is doing: it waits to be opened, for its first picture, for its turn; has its turn;
 * is shown; was released because nobody sees it.
 */
export type ModelPhase = 'waiting' | 'opening' | 'first-picture' | 'turn' | 'shown' | 'released' | 'failed'
  | 'removed';

/** Events of a model of a page. */
export interface PageModelEvents {
  /** Another phase. */
  phase: { at: number; phase: ModelPhase };
  /** The package is open: its manifest can be read. */
  open: { at: number; package: ShowablePackage };
  /** The first picture is on the canvas. */
  'first-picture': { at: number; bytes: number };
  /** More bytes. */
  progress: LoadEvents['progress'];
  /** The model's turn is over: what the time allowed is there. */
  loaded: { at: number };
  /** The graphics context of the page was lost, or is there again; the canvas keeps its picture. */
  context: LoadEvents['context'];
  /** The GPU holds less than it was thought to: a coarser picture is shown. */
  memory: LoadEvents['memory'];
  /** Something went wrong; fatal: nothing more comes of this model until retry(). */
  error: { at: number; fatal: boolean; message: string; error: unknown };
}
/** How a package is opened. */
export type OpenHow = OpenOptions & { decode?: LoadOptions['decode'] };
/** Options of one model of a page. */
export interface PageModelOptions {
  /** Camera; left out: one that sees the whole object. */
  camera?: PerspectiveCamera;
  /** Where the camera of one's own stands when the package is open. */
  orbit?: Orbit;
  /** Options of the package's opening: mirrors, mode and so on. */
  open?: OpenHow;
  /** Options of the load that the page does not see to itself. */
  load?: Pick<LoadOptions, 'policy' | 'rule' | 'meshes' | 'refineTo' | 'fullSize' | 'decode'>;
  /** Changes the scene of the model once its first picture is there, e.g. its light. */
  dress?: (scene: Scene, load: LoadedModel) => void;
}
/** What a model asks of its page. */
export interface Host {
  /** Opens a package with the page's workers. */
  open(url: string, options: OpenHow): Promise<ShowablePackage>;
  /** What all loads have in common. */
  loadOptions(): Pick<LoadOptions, 'renderer' | 'gltfLoader' | 'workers' | 'workerUrl'>;
  /** Bytes that the model may take on the GPU. */
  memoryBytes(model: PageModel): number;
  /** Resolves when it is the model's turn, which fetches so many bytes however short it is. */
  turn(model: PageModel, bytes: number): Promise<Turn>;
  /** Something has changed that the page may act upon. */
  changed(model: PageModel): void;
  /** The picture is to be drawn anew. */
  redraw(model: PageModel): void;
  /** The model was removed. */
  forget(model: PageModel): void;
}

/** What did not come is asked for again after so long, and twice as long each time; so often at most. */
const askAgain = { firstS: 4, times: 6 };
/** What another view shows is fetched so many seconds after the view has changed. */
const lookS = 0.4;
/** A package that was replaced while it came is opened anew so often. */
const mostReplaced = 2;

/** One package on one canvas of a page. */
export class PageModel {
  readonly scene = new Scene();
  readonly camera: PerspectiveCamera;
  readonly place: PagePlace = { visible: false, regarded: false, areaPx: 0, distancePx: 0 };
  phase: ModelPhase = 'waiting';
  package?: ShowablePackage;
  load?: LoadedModel;
  /** Bytes of the first picture are on their way. */
  coming = false;
  /** All that the display can show is there. */
  complete = false;
  /** Resolves when the first picture is on the canvas; rejects when it fails or is removed before. */
  readonly firstPicture: Promise<void>;
  private readonly events_ = new Emitter<PageModelEvents>();
  /** Something did not come, and is asked for again later. */
  lacking = false;
  private asked_ = 0; // how often it was asked for again
  private later_?: ReturnType<typeof setTimeout>;
  private looking_?: ReturnType<typeof setTimeout>; // another view is to be refined
  private views_ = 0;
  private replaced_ = 0;
  private unpainted_ = false; // the first picture waits for a frame
  private abort_ = new AbortController();
  private settle_!: { shown: () => void; failed: (error: unknown) => void };

  constructor(private readonly host_: Host, readonly canvas: HTMLCanvasElement, readonly url: string,
      private readonly options_: PageModelOptions) {
    this.camera = options_.camera ?? new PerspectiveCamera(firstLookFovDegrees, 1, 0.01, 100);
    const lamp = daylight(this.scene);
    this.camera.add(lamp, lamp.target);
    this.scene.add(this.camera);
    this.firstPicture = new Promise((shown, failed) => (this.settle_ = { shown, failed }));
    this.firstPicture.catch(() => undefined);
  }

  /** Calls the listener at every such event; gives a function that ends the calls. */
  on<K extends keyof PageModelEvents>(name: K, listener: (event: PageModelEvents[K]) => void): () => void {
    return this.events_.on(name, listener);
  }
  /** Bytes on the GPU. */
  get gpuBytes(): number {
    return this.load?.state.gpuBytes ?? 0;
  }
  /** To be called when the camera has moved. */
  moved(): void {
    this.look();
    this.host_.redraw(this);
    this.host_.changed(this);
  }
  /** The load follows the camera. Soon, what another view shows is fetched; not while a host fails. */
  look(): void {
    if (this.load?.update(this.camera) && !this.lacking)
      this.looking_ ??= setTimeout(() => {
        ++this.views_;
        this.askForRest_();
      }, 1000 * lookS);
  }
  /** The camera sees the whole object, as its canvas is now. */
  frame(orbit: Orbit = this.options_.orbit ?? defaultOrbit): void {
    if (!this.package) return;
    const { manifest } = this.package;
    this.camera.aspect = this.canvas.width / Math.max(1, this.canvas.height);
    frame(this.camera, manifest.boundsMin, manifest.boundsMax, orbit);
    this.moved();
  }
  /** After a failure: waits to be opened once more. */
  retry(): void {
    if (this.phase === 'failed') this.reopen_();
  }
  /** The network is there again: what did not come is asked for. */
  cameOnline(): void {
    this.retry();
    this.asked_ = 0;
    if (this.lacking) this.askForRest_();
  }
  /** Takes the model from the page and frees all that it has. */
  remove(): void {
    if (this.phase === 'removed') return;
    this.end_();
    this.package?.dispose();
    this.package = undefined;
    this.enter_('removed');
    this.settle_.failed(new DOMException('The model was removed', 'AbortError'));
    this.events_.clear();
    this.host_.forget(this);
  }

  // ---- for the page

  /** Opens the package and shows its first picture. Errors are told, not thrown. */
  async begin(): Promise<void> {
    this.coming = true;
    this.enter_('opening');
    const { signal } = (this.abort_ = new AbortController());
    try {
      if (!this.package) {
        const opened = await this.host_.open(this.url, { ...this.options_.open, signal });
        if (signal.aborted) return opened.dispose();
        this.package = opened;
        if (!this.options_.camera) this.frame();
        this.events_.emit('open', { package: opened });
      }
      this.awaitBytes_(this.package, signal);
      this.startLoad_(this.package, signal);
      await this.load!.firstPicture;
      if (signal.aborted) return;
      this.options_.dress?.(this.scene, this.load!);
      this.unpainted_ = true;
      this.enter_('first-picture');
      this.host_.redraw(this);
    } catch (error) {
      if (!signal.aborted) this.fail_(error);
    }
  }
  /** Fetches what the display can show beyond the model's turn. */
  async refine(): Promise<void> {
    const { load, views_: view } = this;
    this.lacking = false;
    try {
      await load?.refine();
    } catch (error) {
      if (!isAbort(error)) this.say_(error, false);
    }
    if (this.load !== load) return;
    this.complete = view === this.views_;
    if (this.lacking) this.askLater_();
    else this.asked_ = 0;
  }
  private askLater_(): void {
    if (this.asked_ < askAgain.times)
      this.later_ ??= setTimeout(() => this.askForRest_(), 1000 * askAgain.firstS * 2 ** this.asked_++);
  }
  /** Frees everything but the package's documents and the picture on the canvas. */
  release(): void {
    this.end_();
    this.enter_('released');
  }
  /** The first picture is on the canvas. */
  painted(): void {
    if (!this.unpainted_ || !this.load) return;
    this.unpainted_ = false;
    this.events_.emit('first-picture', { bytes: this.package?.client.received ?? 0 });
    this.settle_.shown();
  }

  /** While the picture is decoded, the link is the next model's. */
  private awaitBytes_(pkg: ShowablePackage, signal: AbortSignal): void {
    const { offset, bytes } = firstPicture(pkg.manifest);
    const came = (): void => {
      this.coming = false;
      this.host_.changed(this);
    };
    if (pkg.requests.some((r) => r.ok && r.offset <= offset && r.offset + r.received >= offset + bytes))
      return came();
    const end = pkg.onRequest(({ kind }) => {
      if (kind !== 'mesh') return;
      end();
      came();
    });
    signal.addEventListener('abort', end, { once: true });
  }
  private startLoad_(pkg: ShowablePackage, signal: AbortSignal): void {
    const { host_: host, camera } = this;
    const load = pkg.load(this.scene, {
      meshes: 'auto', ...this.options_.load, ...host.loadOptions(), camera, signal, time: Infinity,
      autoRefine: false,
      display: () => this.display_(pkg),
      memoryBytes: () => host.memoryBytes(this),
      turn: async (bytes) => {
        const turn = await host.turn(this, bytes);
        this.enter_('turn');
        return turn;
      },
    });
    this.load = load;
    this.complete = this.lacking = false;
    const redraw = (): void => host.redraw(this);
    for (const name of ['proxy', 'scale', 'plane', 'fragment', 'context'] as const) load.on(name, redraw);
    load.on('context', (event) => {
      this.complete = false; // refining waits for what the load makes anew
      this.events_.emit('context', event);
      host.changed(this);
    });
    load.on('memory', (event) => {
      // the coarser planes have a first rung of all fragments, not yet what the display can show
      this.complete = false;
      this.events_.emit('memory', event);
      host.changed(this);
    });
    load.on('progress', (event) => this.events_.emit('progress', event));
    load.on('error', ({ fatal, error }) => {
      if (fatal) return; // it ends `done`, too
      if (wasReplaced(error)) return this.fail_(error);
      if (error instanceof InputError && !isForGood(error)) {
        this.lacking = true;
        if (this.complete) this.askLater_(); // else refining does
      }
      this.say_(error, false);
    });
    load.done.then(
      () => {
        if (this.load !== load) return;
        this.enter_('shown');
        this.events_.emit('loaded', {});
      },
      (error: unknown) => this.load === load && !isAbort(error) && this.fail_(error),
    );
  }
  private display_(pkg: ShowablePackage): ReturnType<typeof displayOf> | number {
    const { canvas, load } = this;
    return load ? displayOf(pkg.manifest, load.object, this.camera, { x: canvas.width, y: canvas.height })
      : Math.max(1, canvas.height);
  }
  private enter_(phase: ModelPhase): void {
    this.phase = phase;
    this.events_.emit('phase', { phase });
    this.host_.changed(this);
  }
  private say_(error: unknown, fatal: boolean): void {
    this.events_.emit('error',
      { fatal, error, message: error instanceof Error ? error.message : String(error) });
  }
  private fail_(error: unknown): void {
    if (this.phase === 'failed' || this.phase === 'removed') return;
    this.end_();
    if (wasReplaced(error) && this.replaced_++ < mostReplaced) return this.reopen_();
    this.say_(error, true);
    this.settle_.failed(error);
    this.enter_('failed');
  }
  private reopen_(): void {
    this.package?.dispose();
    this.package = undefined;
    this.enter_('waiting');
  }
  private askForRest_(): void {
    this.forgetLater_();
    this.complete = false;
    this.host_.changed(this);
  }
  private forgetLater_(): void {
    clearTimeout(this.later_);
    clearTimeout(this.looking_);
    this.later_ = this.looking_ = undefined;
  }
  private end_(): void {
    this.forgetLater_();
    this.abort_.abort();
    const { load } = this;
    this.load = undefined;
    load?.dispose();
  }
}

/** Whether the file is no more the one that reading began with (SPEC.md, V11). */
function wasReplaced(error: unknown): boolean {
  return error instanceof FormatError && /it was replaced/.test(error.found);
}
