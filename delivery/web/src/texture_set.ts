import { Texture, WebGLRenderer } from 'three';
import { Blitter, PlaneComposer } from './composer';
import type { Work } from './enlarge';
import type { PlaneChoice } from './fragment_list';
import { isSoftware } from './gpu';
import { MaterialSet, Slot, disposeTexture } from './scale_parts';
import type { TextureInfo } from './textures';
import type { WorkerPool } from './worker_pool';
import type { Levels } from './worker_protocol';

/** Milliseconds and pixels of uploads between two turns of the page. */
const sliceMs = 5;
const slicePx = 1 << 19;
/**
 * Pixels that the GPU may be behind: an upload beyond what it takes at a time would wait in the middle of a page's turn.
 * How many those are shows when one has waited. It is not waited for longer than longestFenceMs.
 */
const behindPx = { least: 1 << 20, most: 1 << 21, first: 1 << 21, more: 1 << 18 };
/** A turn that took so long has waited. */
const waitedMs = 20;
const longestFenceMs = 250;
/** The smallest mip levels follow this often while fragments come. */
const mipsEveryMs = 200;

/** The composed textures of a model, one per image (and one for its alpha), and the uploads to them. */
export class TextureSet {
  readonly planes = new Map<number, PlaneComposer>(); // by full-size plane
  private readonly blitter_: Blitter;
  private readonly queue_: Work[] = [];
  private readonly waiting_ = new Map<PlaneComposer, Work[]>(); // until their plane is filled
  private pumping_ = false;
  private mipsAt_ = 0;
  private idle_: (() => void)[] = [];
  private mayBeBehindPx_ = behindPx.first;
  private fences_: { sync: WebGLSync; pixels: number; at: number }[] = [];
  private disposed_ = false;

  constructor(
    private readonly renderer_: WebGLRenderer,
    private readonly textures_: readonly TextureInfo[],
    private readonly materials_: MaterialSet,
    private readonly pool_: WorkerPool,
  ) {
    this.blitter_ = new Blitter(renderer_);
  }

  /**
   * Shows a texture by this plane from now on: filled with what was shown so far (or the preview) in small steps, then
   * the materials are changed at once. Resolves when they have been.
   */
  async show(choice: PlaneChoice, preview?: ImageBitmap): Promise<void> {
    const { base } = choice;
    const before = this.planes.get(base);
    const next = new PlaneComposer(this.blitter_, this.textures_[choice.plane], base, choice.plane);
    const slots = this.slotsOf_(base);
    const old = slots.map((slot) => this.oldTexture_(slot, base));
    const views = old.map((texture) => texture && next.view(texture));
    if (slots.length === 0) next.view(new Texture()); // a finer scale may bring the material that wants it
    this.planes.set(base, next);
    try {
      await this.fill_(next, before, preview, old);
    } catch (error) {
      for (const work of this.waiting_.get(next) ?? []) work.drop?.();
      this.waiting_.delete(next);
      if (before) this.planes.set(base, before);
      else this.planes.delete(base);
      next.dispose();
      throw error;
    }
    if (this.disposed_) return;
    next.updateMips();
    if (this.planes.get(base) !== next) return; // another has taken its place meanwhile
    views.forEach((view, i) => view && this.put_(slots[i], base, view));
    if (before) before.dispose();
    else if (this.textures_[base].role !== 'alpha') new Set(old).forEach((texture) => texture && disposeTexture(texture));
    for (const work of this.waiting_.get(next) ?? []) this.enqueue_(work);
    this.waiting_.delete(next);
  }
  private async fill_(
    next: PlaneComposer,
    before: PlaneComposer | undefined,
    preview: ImageBitmap | undefined,
    old: readonly (Texture | null)[],
  ): Promise<void> {
    if (before?.filled) return next.fillFrom(before);
    const shown = old.find((texture) => pictureOf(texture));
    const image = preview ?? pictureOf(shown);
    if (!image) return void (next.filled = true);
    // A preview of its own is that of coverage, beside which the colours are shown.
    if (!preview && shown && !(await isSoftware(this.renderer_))) return next.fillFromTexture(shown, image.width, image.height);
    try {
      await this.enlarge_(next, image);
    } catch (error) {
      // A browser whose workers cannot draw leaves it to the GPU.
      if (!shown || this.disposed_) throw error;
      next.fillFromTexture(shown, image.width, image.height);
    }
  }
  private async enlarge_(next: PlaneComposer, image: ImageBitmap | HTMLImageElement): Promise<void> {
    const { enlarge } = await import('./enlarge');
    await enlarge(next, image, {
      pool: this.pool_,
      come: () => new Set(this.waiting_.get(next)?.map((work) => work.fragment)),
      enqueue: (work) => this.enqueue_(work),
      ended: () => this.disposed_,
    });
  }
  /** Whether a material that is there shows this plane. */
  isUsed(base: number): boolean {
    return this.slotsOf_(base).length > 0;
  }
  private slotsOf_(base: number): Slot[] {
    const { image, role } = this.textures_[base];
    if (role !== 'alpha') return this.materials_.slots.filter((s) => s.image === image);
    // Coverage stands beside the colours that it belongs to, where the material asks for it.
    return this.materials_.slots.filter(
      (s) => s.image === image && s.name === 'map' && (s.material.transparent || s.material.alphaTest > 0),
    );
  }
  private oldTexture_(slot: Slot, base: number): Texture | null {
    const alpha = this.textures_[base].role === 'alpha' ? { ...slot, name: 'alphaMap' } : slot;
    return this.materials_.textureAt(alpha) ?? this.materials_.textureAt(slot);
  }
  private put_(slot: Slot, base: number, view: Texture): void {
    this.materials_.setTexture(this.textures_[base].role === 'alpha' ? { ...slot, name: 'alphaMap' } : slot, view);
  }
  /** A material that came with a later scale gets the textures that there are. */
  adopt(slot: Slot): void {
    for (const [base, plane] of this.planes) {
      if (!this.slotsOf_(base).includes(slot)) continue;
      const old = this.materials_.textureAt(slot);
      if (old) this.put_(slot, base, plane.view(old));
    }
  }

  /** Queues a fragment; `done` when it is in its texture, or was not better than the rung there by then. */
  upload(
    plane: PlaneComposer,
    levels: Levels,
    { fragment, rung }: { fragment: number; rung: number },
    better: (there: number) => boolean,
    done: (uploaded: boolean) => void,
  ): void {
    const end = (uploaded: boolean): void => {
      levels.forEach((b) => b.close());
      done(uploaded);
    };
    const work: Work = {
      pixels: levels[0].width * levels[0].height,
      fragment,
      run: () => {
        const wanted = this.planes.get(plane.base) === plane && better(plane.rungs[fragment]);
        if (wanted) plane.uploadFragment(levels, fragment, rung);
        end(wanted);
      },
      drop: () => end(false),
    };
    if (plane.filled && !this.waiting_.has(plane)) return this.enqueue_(work);
    this.waiting_.set(plane, [...(this.waiting_.get(plane) ?? []), work]);
  }

  private enqueue_(work: Work): void {
    if (this.disposed_) return work.drop?.();
    this.queue_.push(work);
    if (this.pumping_) return;
    this.pumping_ = true;
    setTimeout(() => this.pump_(), 0);
  }
  private pump_(): void {
    if (this.disposed_) return;
    const start = performance.now();
    if (this.gpuIsBusy_(start)) return void setTimeout(() => this.pump_(), 4);
    let pixels = 0;
    while (this.queue_.length > 0 && pixels < slicePx && performance.now() - start < sliceMs) {
      const work = this.queue_.shift()!;
      pixels += work.pixels;
      work.run();
    }
    const waited = performance.now() - start > waitedMs;
    this.mayBeBehindPx_ = waited
      ? Math.max(behindPx.least, this.mayBeBehindPx_ / 2)
      : Math.min(behindPx.most, this.mayBeBehindPx_ + behindPx.more);
    if (start - this.mipsAt_ > mipsEveryMs || this.queue_.length === 0) this.finish();
    if (pixels > 0) this.putFence_(pixels);
    if (this.queue_.length > 0) setTimeout(() => this.pump_(), 0);
    else {
      this.pumping_ = false;
      this.idle_.splice(0).forEach((done) => done());
    }
  }
  private putFence_(pixels: number): void {
    const gl = this.renderer_.getContext() as WebGL2RenderingContext;
    const sync = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    if (sync) this.fences_.push({ sync, pixels, at: performance.now() });
    gl.flush();
  }
  /** More behind than it may be: further uploads would have to wait for it in the middle of a page's turn. */
  private gpuIsBusy_(now: number): boolean {
    const gl = this.renderer_.getContext() as WebGL2RenderingContext;
    this.fences_ = this.fences_.filter(({ sync, at }) => {
      if (now - at < longestFenceMs && gl.getSyncParameter(sync, gl.SYNC_STATUS) !== gl.SIGNALED) return true;
      gl.deleteSync(sync);
      return false;
    });
    return this.fences_.reduce((sum, f) => sum + f.pixels, 0) > this.mayBeBehindPx_;
  }

  /** All mip levels of everything, at once. */
  finish(): void {
    if (this.disposed_) return;
    this.mipsAt_ = performance.now();
    for (const p of this.planes.values()) if (p.mipsAreStale) p.updateMips();
  }
  /** Resolves when nothing waits to be uploaded. */
  settled(): Promise<void> {
    if (this.queue_.length === 0 || this.disposed_) return Promise.resolve();
    return new Promise((done) => this.idle_.push(done));
  }
  get pending(): number {
    let waiting = this.queue_.length;
    for (const works of this.waiting_.values()) waiting += works.length;
    return waiting;
  }

  dispose(): void {
    this.disposed_ = true;
    for (const work of [...this.queue_.splice(0), ...[...this.waiting_.values()].flat()]) work.drop?.();
    this.waiting_.clear();
    this.idle_.splice(0).forEach((done) => done());
    for (const p of this.planes.values()) p.dispose();
    this.planes.clear();
    this.blitter_.dispose();
    for (const { sync } of this.fences_) (this.renderer_.getContext() as WebGL2RenderingContext).deleteSync(sync);
    this.fences_ = [];
  }
}

/** The picture of a texture that three has loaded. */
function pictureOf(texture: Texture | null | undefined): ImageBitmap | HTMLImageElement | undefined {
  const image = texture?.image as ImageBitmap | HTMLImageElement | undefined;
  const is = (name: 'ImageBitmap' | 'HTMLImageElement'): boolean =>
    typeof globalThis[name] === 'function' && image instanceof globalThis[name];
  return is('ImageBitmap') || is('HTMLImageElement') ? image : undefined;
}
