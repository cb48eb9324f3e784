import type { Object3D } from 'three';
import type { VisiblePart } from '../decide/viewing';
import { throwIfAborted } from '../format/errors';
import { readyToDraw } from './gpu';
import { type LoadContext, hysteresis } from './load_context';
import type { ScaleSource } from './scale_source';
import { ShownProxy } from './shown_proxy';

/** A scale that could not be had is asked for again after so long, and twice as long each time. */
const retryScaleS = { first: 2, most: 60 };
/** No scale: none is shown, or none is retried. */
const noScale = -1;

/** The scale in the scene, and how it follows the view. */
export class ShownScale {
  /** In the scene; -1: none yet. */
  shown = noScale;
  wanted = noScale;
  readonly proxy: ShownProxy;
  /** The scale that is enough at a displayed height, or the finest; set once the documents are there. */
  scaleFor?: (heightPx: number, part: VisiblePart | undefined, finest?: boolean) => number;
  /** Hears that a scale is there behind the proxy. */
  behind?: () => void;
  private retryScale_ = noScale;
  private retryTimer_: ReturnType<typeof setTimeout> | undefined;
  private retryS_ = retryScaleS.first;

  constructor(private readonly load_: LoadContext, private readonly scene_: Object3D,
      private readonly source_: ScaleSource) {
    this.proxy = new ShownProxy(load_, scene_);
  }
  /** Scales stay out of the scene: a proxy is there. */
  get held(): boolean {
    return this.proxy.shown >= 0;
  }

  /** Loads a scale and puts the scale into the scene; scales that are complete on the way are shown, too. */
  load(scale: number): { arrived: Promise<void>; shape: Promise<Object3D>; shown: Promise<void> } {
    this.wanted = scale;
    const show = (k: number): void => {
      // Another scale may be wanted by now. A scale on the way must not be coarser than the shown one.
      if (this.wanted === scale && (k === scale || k < this.shown)) this.show_(k);
    };
    const { arrived, shape } = this.source_.load(scale, show);
    const shown = shape.then(async (its) => {
      if (this.shown < 0) await readyToDraw(this.load_, this.scene_, its);
      show(scale);
    });
    return { arrived, shape, shown };
  }
  /** Loads the scale that the view asks for, if that is another one. */
  async follow(scale = this.scaleForView_()): Promise<void> {
    if (scale === this.wanted || scale === this.retryScale_) return;
    try {
      await this.load(scale).shown;
      this.retryS_ = retryScaleS.first;
    } catch (error) {
      this.lost(error, scale);
    }
  }
  /** The shown scale stays. Later, the lost one is asked for again, or what the view then asks for. */
  lost(error: unknown, scale: number): void {
    this.load_.fail(error, `scale ${scale}`);
    if (this.wanted === scale) this.wanted = this.shown;
    this.endRetry();
    if (this.load_.signal.aborted) return;
    this.retryScale_ = scale;
    this.retryTimer_ = setTimeout(() => {
      this.retryScale_ = noScale;
      void this.follow(this.load_.resting ? this.scaleForView_(scale) : scale);
    }, 1000 * this.retryS_);
    this.retryS_ = Math.min(2 * this.retryS_, retryScaleS.most);
  }
  endRetry(): void {
    clearTimeout(this.retryTimer_);
    this.retryScale_ = noScale;
  }

  /** Changes the scene in one turn of the page: the next frame has the new scale, whole. */
  private show_(scale: number): void {
    throwIfAborted(this.load_.signal);
    this.shown = scale;
    if (this.held) this.behind?.();
    else this.place_();
  }
  private place_(): void {
    const { shown, load_: { object, reader } } = this;
    const shape = this.source_.shape(shown)!;
    if (object.children[0] !== shape) object.clear().add(shape);
    if (!object.parent) this.scene_.add(object);
    this.load_.emit('scale',
      { scale: shown, triangles: reader.manifest.scales.find((s) => s.scale === shown)!.triangles });
  }
  /** The object, or the scale that is held back: a proxy says nothing of fragments. */
  surface(): Object3D {
    return (this.held && this.source_.all().at(-1)) || this.load_.object;
  }
  /** Scales that are there, and the proxy. */
  objects(): Object3D[] {
    return [...this.source_.all(), ...this.proxy.objects];
  }
  /** The scale takes the proxy's place in one turn of the page. */
  release(): void {
    this.place_();
    this.proxy.dispose();
  }
  /** The scale that the view asks for, by a little more than the last time. A finer one stays if it shows. */
  private scaleForView_(wanted = this.wanted): number {
    const { override, view: { display } } = this.load_;
    const at = (factor: number, finest = false): number =>
      override.scale ?? this.scaleFor!(display.heightPx * factor, display.part, finest);
    if (override.scale !== undefined || at(1 / hysteresis) < wanted) return at(1);
    return Math.max(wanted, Math.min(at(hysteresis), at(hysteresis, true)));
  }
}
