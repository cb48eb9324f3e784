import { type Camera, NeutralToneMapping, type Scene, Vector2, WebGLRenderer } from 'three';
import { bootstrapBytes, startBytes } from './format/layout';
import { nowS } from './http/requests';
import { type TexmeshPackage, open } from './open';
import { nextStep } from './page/model_queue';
import { type Host, type OpenHow, PageModel, type PageModelOptions } from './page/page_model';
import { defaultMemoryBytes, leastS, linkBytesS, shareOf, turnS } from './page/schedule';
import { Visibility } from './page/on_screen';
import type { GltfLoaderLike, Turn } from './scene/api';
import { Emitter } from './scene/events';
import { GpuRoom } from './scene/gpu';
import { SharedWorkers } from './worker/shared_workers';

/** The renderer of all models of a page, as browsers give few contexts. It copies pictures to canvases. */
class Painter {
  private own_?: WebGLRenderer;

  /** `given` is the application's; left out: one of the page's own, which the page disposes of. */
  constructor(private readonly given_?: WebGLRenderer) {}
  /** Made when it is first asked for. Throws where the browser has no WebGL. */
  get renderer(): WebGLRenderer {
    if (this.given_ ?? this.own_) return (this.given_ ?? this.own_)!;
    const renderer =
      (this.own_ = new WebGLRenderer({ antialias: true, alpha: true, powerPreference: 'high-performance' }));
    // each question waits for the compiler, and the programs are three.js's own
    renderer.debug.checkShaderErrors = false;
    renderer.toneMapping = NeutralToneMapping;
    renderer.setClearAlpha(0);
    return renderer;
  }

  /** What the GPU has shown to hold, bytes; Infinity: nothing has been refused. */
  get limitBytes(): number {
    const renderer = this.given_ ?? this.own_;
    return renderer ? GpuRoom.of(renderer).limitBytes : Infinity;
  }
  /** Draws a scene as large as the canvas has pixels. False: the context is lost. */
  draw(scene: Scene, camera: Camera, canvas: HTMLCanvasElement): boolean {
    const { renderer } = this;
    const { width, height } = canvas;
    const to = canvas.getContext('2d');
    if (!to || width < 1 || height < 1 || renderer.getContext().isContextLost()) return false;
    const size = renderer.getDrawingBufferSize(new Vector2());
    // The buffer grows to the largest picture: to make it anew for each would take longer than to draw.
    if (size.x < width || size.y < height)
      renderer.setDrawingBufferSize(Math.max(size.x, width), Math.max(size.y, height), 1);
    renderer.setViewport(0, 0, width, height);
    renderer.setScissor(0, 0, width, height);
    renderer.setScissorTest(true);
    renderer.render(scene, camera);
    to.globalCompositeOperation = 'copy';
    to.drawImage(renderer.domElement, 0, renderer.domElement.height - height, width, height, 0, 0, width,
      height);
    return true;
  }
  dispose(): void {
    this.own_?.dispose();
    this.own_?.forceContextLoss();
  }
}

export type * from './page/page_model';
export type { Orbit } from './page/framing';

/** So many packages share the link without harm: a round trip costs what the first pictures' bytes cost. */
const fewModels = 2;
/** Share of the time behind the last bytes: they are decoded, go to the GPU, and are drawn. */
const drawingShare = 0.01;

/** Options of a TexmeshPage. */
export interface PageOptions {
  /** See LoadOptions. */
  gltfLoader: () => GltfLoaderLike;
  /** Draws all models; left out: a renderer of the page's own. */
  renderer?: WebGLRenderer;
  /** Seconds from the first new model until all that is seen is as good as the time allows. Default 5. */
  time?: number;
  /** Bytes that all models may take on the GPU. Default: by the device. */
  memoryBytes?: number;
  /** Packages whose first pictures come at once. Default 6: a browser's connections for a server. */
  openAtOnce?: number;
  /** Workers of all models. Default: 2 to 4 by the number of cores. */
  workers?: number;
  /** Address of worker.js, where that file does not stand beside the library. */
  workerUrl?: string | URL;
}
/** Events of a page. */
export interface PageEvents {
  /** All models that are seen have their first pictures: seconds since the page became busy. */
  'first-pictures': { at: number; seconds: number; models: number };
  /** Every model that is seen has had its turn: the limit and the actual time. */
  deadline: { at: number; limit: number; actual: number };
  /** All had their turn, or the GPU holds less than thought: bytes on the GPU, and the limit from now on. */
  memory: { at: number; gpuBytes: number; limitBytes: number };
}

/**
 * Any number of packages on one page: one time limit, one link, one limit of memory and one graphics context
 * for all. What is seen comes first, then what is close by; models far from the screen are released and keep
 * their last picture.
 */
export class TexmeshPage {
  private readonly mostBytes_: number;
  private readonly models_ = new Map<Element, PageModel>();
  private readonly painter_: Painter;
  private readonly workers_: SharedWorkers;
  private readonly visibility_: Visibility;
  private readonly events_ = new Emitter<PageEvents>();
  private readonly turns_ = new Map<PageModel, { bytes: number; given: (turn: Turn) => void }>();
  private readonly dirty_ = new Set<PageModel>();
  private refining_?: PageModel;
  private startS_ = 0;
  private said_ = { pictures: true, deadline: true };
  private frame_ = 0;
  private advancing_ = false;
  private preparing_?: ReturnType<typeof setTimeout>;
  private disposed_ = false;

  /** InputError of a load where an option has a value that it cannot have. */
  constructor(private readonly options_: PageOptions) {
    const { hardwareConcurrency: cores = 2 } = globalThis.navigator ?? {};
    this.mostBytes_ = options_.memoryBytes ?? deviceMemoryBytes();
    this.painter_ = new Painter(options_.renderer);
    this.workers_ = new SharedWorkers(options_.workers ?? Math.min(4, Math.max(2, cores - 1)),
      options_.workerUrl);
    this.visibility_ = new Visibility((canvas, resized) => this.placeChanged_(canvas, resized));
    globalThis.addEventListener?.('online', this.online_);
  }

  /** Shows a package on a canvas, as soon as it is seen. It replaces the model that the canvas had. */
  add(canvas: HTMLCanvasElement, url: string, options: PageModelOptions = {}): PageModel {
    this.models_.get(canvas)?.remove();
    const model = new PageModel(this.host_, canvas, url, options);
    this.models_.set(canvas, model);
    model.on('memory', () => this.tellMemory_());
    this.visibility_.follow(canvas, model.place);
    this.advance_();
    return model;
  }
  /** Draws all models. */
  get renderer(): WebGLRenderer {
    return this.painter_.renderer;
  }
  /** All models, in the order in which they were added. */
  get models(): PageModel[] {
    return [...this.models_.values()];
  }
  /** Most bytes on the GPU: what the page was given, or less where the GPU has shown that it holds less. */
  get memoryBytes(): number {
    return Math.min(this.mostBytes_, this.painter_.limitBytes);
  }
  /** Bytes on the GPU now. */
  get gpuBytes(): number {
    return this.models.reduce((sum, m) => sum + m.gpuBytes, 0);
  }
  /** Calls the listener at every such event; gives a function that ends the calls. */
  on<K extends keyof PageEvents>(name: K, listener: (event: PageEvents[K]) => void): () => void {
    return this.events_.on(name, listener);
  }
  /** The user looks at this model (or at none): it comes first from now on. */
  regard(model?: PageModel): void {
    for (const m of this.models) m.place.regarded = m === model;
    this.advance_();
  }
  /** Removes all models and frees the graphics context and the workers. */
  dispose(): void {
    this.disposed_ = true;
    globalThis.removeEventListener?.('online', this.online_);
    for (const model of this.models) model.remove();
    cancelAnimationFrame(this.frame_);
    this.visibility_.dispose();
    this.workers_.dispose();
    this.painter_.dispose();
    this.events_.clear();
  }

  private readonly online_ = (): void => this.models.forEach((m) => m.cameOnline());

  // ---- what models ask for

  private readonly host_: Host = {
    open: (url: string, options: OpenHow): Promise<TexmeshPackage> =>
      open(url, { startBytes: this.startBytes_, ...options, shared: this.workers_,
        workerUrl: this.options_.workerUrl }),
    loadOptions: () => ({ renderer: this.painter_.renderer, gltfLoader: this.options_.gltfLoader,
      workers: 2 }),
    memoryBytes: (model) => this.memoryOf_(model),
    turn: (model, bytes) =>
      new Promise((given) => {
        this.turns_.set(model, { bytes, given });
        this.advance_();
      }),
    changed: () => this.advance_(),
    redraw: (model) => this.redraw_(model),
    forget: (model) => {
      this.models_.delete(model.canvas);
      this.visibility_.forget(model.canvas);
      this.dropped_(model);
      this.advance_();
    },
  };
  /** Each of several packages asks for its manifest and little more, so that none keeps others waiting. */
  private get startBytes_(): number {
    return this.waiting_.length > fewModels ? bootstrapBytes : startBytes;
  }
  /** What is seen has nearly all memory. Some models take more than their share: later ones have less. */
  private memoryOf_(model: PageModel): number {
    const areas = this.models.filter((m) => m.place.visible || m === model).map((m) => m.place.areaPx);
    const free = this.memoryBytes - (this.gpuBytes - model.gpuBytes);
    return Math.max(0, Math.min(this.memoryBytes * shareOf(model.place.areaPx, areas), free));
  }
  private dropped_(model: PageModel): void {
    this.turns_.delete(model);
    this.dirty_.delete(model);
    if (this.refining_ === model) this.refining_ = undefined;
  }

  // ---- one step after the other

  private advance_(): void {
    if (this.advancing_ || this.disposed_) return;
    this.advancing_ = true;
    // In a turn of its own: what is added or comes into view together is decided together.
    queueMicrotask(() => {
      this.advancing_ = false;
      if (this.disposed_) return;
      this.visibility_.glance();
      this.beginPeriod_();
      for (let step = this.nextStep_(); step; step = this.nextStep_()) this.take_(step);
      this.tell_();
    });
  }
  /** Makes the graphics context while the first bytes come, as nothing is asked for while it is made. */
  private prepare_(): void {
    this.preparing_ ??= setTimeout(() => {
      try {
        if (!this.disposed_) void this.renderer;
      } catch { /* each model says it */ }
    });
  }
  private nextStep_(): ReturnType<typeof nextStep> {
    return nextStep({
      models: this.models, openAtOnce: this.options_.openAtOnce ?? 6,
      askedForTurn: new Set(this.turns_.keys()), refining: this.refining_,
      memoryShare: this.gpuBytes / this.memoryBytes, isNear: ({ canvas }) => this.visibility_.isNear(canvas),
    });
  }
  private take_(step: NonNullable<ReturnType<typeof nextStep>>): void {
    const { model } = step;
    if (step.what === 'open') {
      void model.begin();
      this.prepare_();
    } else if (step.what === 'release') {
      this.dropped_(model);
      model.release();
    } else if (step.what === 'turn') this.giveTurn_(model, step.among);
    else {
      this.refining_ = model;
      void model.refine().then(() => {
        if (this.refining_ === model) this.refining_ = undefined;
        this.advance_();
      });
    }
  }
  private giveTurn_(model: PageModel, among: readonly PageModel[]): void {
    const { bytes, given } = this.turns_.get(model)!;
    this.turns_.delete(model);
    const leftS = this.startS_ + (1 - drawingShare) * this.limitS_ - nowS();
    const areas = among.map((m) => m.place.areaPx);
    const records = this.models.flatMap((m) => m.package?.requests ?? []);
    const bytesS = linkBytesS(records, nowS());
    model.phase = 'turn'; // at once: nobody else has it
    const least = leastS(bytes, bytesS, model.package?.client.latencyS ?? 0);
    given({ seconds: turnS(leftS, model.place.areaPx, areas, least), bytesS: bytesS || undefined });
  }
  private get limitS_(): number {
    return this.options_.time ?? 5;
  }
  private get waiting_(): PageModel[] {
    return this.models.filter((m) => m.place.visible &&
      ['waiting', 'released', 'opening', 'first-picture', 'turn'].includes(m.phase));
  }
  /** Time counts from the first model that comes to a page where nothing is under way. */
  private beginPeriod_(): void {
    if (this.waiting_.length === 0 || !this.said_.deadline) return;
    this.startS_ = nowS();
    this.said_ = { pictures: false, deadline: false };
  }
  private tell_(): void {
    const { waiting_: waiting, said_: said } = this;
    const seconds = nowS() - this.startS_;
    const seen = this.models.filter((m) => m.place.visible);
    if (!said.pictures && !seen.some((m) => ['waiting', 'released', 'opening'].includes(m.phase))) {
      said.pictures = true;
      this.events_.emit('first-pictures', { seconds, models: seen.length });
    }
    if (said.deadline || waiting.length > 0) return;
    said.deadline = true;
    this.events_.emit('deadline', { limit: this.limitS_, actual: seconds });
    this.tellMemory_();
  }
  private tellMemory_(): void {
    this.events_.emit('memory', { gpuBytes: this.gpuBytes, limitBytes: this.memoryBytes });
  }

  // ---- pictures

  private placeChanged_(canvas: Element, resized: boolean): void {
    const model = this.models_.get(canvas);
    if (!model) return;
    if (resized) {
      model.camera.aspect = model.canvas.width / model.canvas.height;
      model.camera.updateProjectionMatrix();
      model.moved();
    } else this.redraw_(model);
    this.advance_();
  }
  private redraw_(model: PageModel): void {
    this.dirty_.add(model);
    this.frame_ ||= requestAnimationFrame(() => {
      this.frame_ = 0;
      this.paint_();
    });
  }
  private paint_(): void {
    for (const model of this.dirty_) {
      if (!model.load || model.phase === 'opening') continue; // begin() asks again
      if (!model.place.visible) continue; // coming into view asks again
      model.look();
      if (this.painter_.draw(model.scene, model.camera, model.canvas)) model.painted();
    }
    this.dirty_.clear();
  }
}

function deviceMemoryBytes(): number {
  const { deviceMemory, maxTouchPoints = 0 } = (globalThis.navigator ?? {}) as Partial<Navigator>
    & { deviceMemory?: number };
  const { width = 1920, height = 1080 } = globalThis.screen ?? {};
  return defaultMemoryBytes({ deviceMemoryGb: deviceMemory, screenPx: width * height,
    touch: maxTouchPoints > 0 });
}
