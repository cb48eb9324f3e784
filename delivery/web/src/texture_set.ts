import type { Texture, WebGLRenderer } from 'three';
import { PlaneComposer } from './composer';
import type { PlaneChoice } from './fragment_list';
import { MaterialSet, Slot } from './scale_parts';
import type { TextureInfo } from './textures';

/** Milliseconds of uploads between two turns of the page. */
const sliceMs = 5;
/** Smaller mip levels are made anew this often while fragments come. */
const mipsEveryMs = 250;

interface Upload {
  plane: PlaneComposer;
  bitmap: ImageBitmap;
  fragment: number;
  rung: number;
  done: () => void;
}

/** The composed textures of a model, one per image (and one for its alpha), and the uploads to them. */
export class TextureSet {
  readonly planes = new Map<number, PlaneComposer>(); // by full-size plane
  private readonly queue: Upload[] = [];
  private pumping = false;
  private mipsAt = 0;
  private idle: (() => void)[] = [];
  private disposed = false;

  constructor(
    private readonly renderer: WebGLRenderer,
    private readonly textures: readonly TextureInfo[],
    private readonly materials: MaterialSet,
  ) {}

  /** Shows a texture by this plane from now on: filled with what was shown so far, materials changed at once. */
  show(choice: PlaneChoice, preview: ImageBitmap | undefined): PlaneComposer {
    const { base } = choice;
    const before = this.planes.get(base);
    const next = new PlaneComposer(this.renderer, this.textures[choice.plane], base, choice.plane);
    const slots = this.slotsOf(base);
    const old = slots.map((slot) => this.oldTexture(slot, base));
    const views = old.map((texture) => texture && next.view(texture));
    const first = old.find((texture) => texture && imageSize(texture));
    if (preview) next.fillFromBitmap(preview);
    else if (before?.textures[0]) next.fillFrom(before.textures[0], before.widthPx, before.heightPx);
    else if (first) next.fillFrom(first, ...imageSize(first)!);
    views.forEach((view, i) => view && this.put(slots[i], base, view));
    this.planes.set(base, next);
    if (before) before.dispose();
    else if (this.textures[base].role !== 'alpha') new Set(old).forEach((texture) => texture?.dispose());
    return next;
  }
  private slotsOf(base: number): Slot[] {
    const { image, role } = this.textures[base];
    if (role !== 'alpha') return this.materials.slots.filter((s) => s.image === image);
    // Coverage stands beside the colours that it belongs to, where the material asks for it.
    return this.materials.slots.filter(
      (s) => s.image === image && s.name === 'map' && (s.material.transparent || s.material.alphaTest > 0),
    );
  }
  private oldTexture(slot: Slot, base: number): Texture | null {
    const alpha = this.textures[base].role === 'alpha' ? { ...slot, name: 'alphaMap' } : slot;
    return this.materials.textureAt(alpha) ?? this.materials.textureAt(slot);
  }
  private put(slot: Slot, base: number, view: Texture): void {
    this.materials.setTexture(this.textures[base].role === 'alpha' ? { ...slot, name: 'alphaMap' } : slot, view);
  }
  /** A material that came with a later scale gets the textures that there are. */
  adopt(slot: Slot): void {
    for (const [base, plane] of this.planes) {
      if (!this.slotsOf(base).includes(slot)) continue;
      const old = this.materials.textureAt(slot);
      if (!old) continue;
      this.put(slot, base, plane.view(old));
    }
  }

  /** Queues a fragment; `done` when it is in its texture. */
  upload(plane: PlaneComposer, bitmap: ImageBitmap, fragment: number, rung: number, done: () => void): void {
    this.queue.push({ plane, bitmap, fragment, rung, done });
    if (!this.pumping) {
      this.pumping = true;
      setTimeout(() => this.pump(), 0);
    }
  }
  private pump(): void {
    const start = performance.now();
    while (this.queue.length > 0 && performance.now() - start < sliceMs) {
      const u = this.queue.shift()!;
      const current = this.planes.get(u.plane.base) === u.plane;
      if (current && !this.disposed && u.rung > u.plane.rungs[u.fragment]) u.plane.upload(u.bitmap, u.fragment, u.rung);
      u.bitmap.close();
      u.done();
    }
    if (this.disposed) return;
    const due = start - this.mipsAt > mipsEveryMs;
    if (due || this.queue.length === 0) this.updateMips(due);
    if (this.queue.length > 0 || this.stale) setTimeout(() => this.pump(), this.queue.length > 0 ? 0 : mipsEveryMs);
    else this.pumping = false;
    if (this.queue.length === 0) this.idle.splice(0).forEach((done) => done());
  }
  private get stale(): boolean {
    return [...this.planes.values()].some((p) => p.mipsAreStale);
  }
  private updateMips(due: boolean): void {
    if (!due) return;
    this.mipsAt = performance.now();
    for (const p of this.planes.values()) p.updateMips();
  }
  /** Mip levels of everything, at once. */
  finish(): void {
    if (!this.disposed) for (const p of this.planes.values()) p.updateMips();
  }
  /** Resolves when nothing waits to be uploaded. */
  settled(): Promise<void> {
    if (this.queue.length === 0 || this.disposed) return Promise.resolve();
    return new Promise((done) => this.idle.push(done));
  }
  get pending(): number {
    return this.queue.length;
  }

  dispose(): void {
    this.disposed = true;
    for (const u of this.queue.splice(0)) u.bitmap.close();
    this.idle.splice(0).forEach((done) => done());
    for (const p of this.planes.values()) p.dispose();
    this.planes.clear();
  }
}

function imageSize(texture: Texture): [number, number] | undefined {
  const image = texture.image as { width?: number; height?: number } | undefined;
  return image?.width && image.height ? [image.width, image.height] : undefined;
}
