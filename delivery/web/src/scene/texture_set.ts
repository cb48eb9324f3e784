import { Texture, type WebGLRenderer } from 'three';
import type { PlaneChoice } from '../decide/texture_loss';
import type { BlockFormat } from '../blocks/formats';
import type { TextureInfo } from '../format/textures';
import type { WorkerPool } from '../worker/pool';
import type { Levels } from '../worker/protocol';
import type { Compression } from './blocks/compression';
import { type PlaneComposer, planeComposer } from './composer';
import type { Clear } from './enlarge';
import { isLost, isSoftware } from './gpu';
import { type MaterialSet, type Slot, disposeTexture, texturesIn } from './scale_parts';
import { UploadQueue } from './upload_queue';

/** The composed textures of a model, one per image (and one for its alpha), and the uploads to them. */
export class TextureSet {
  readonly planes = new Map<number, PlaneComposer>(); // by full-size plane
  /** Fragments that wait to be uploaded. */
  pending = 0;
  private readonly uploads_: UploadQueue;
  private readonly software_: Promise<boolean>;
  private readTwoChannels_?: Compression['readTwoChannels']; // loaded with the first plane that needs it

  /** Composes the textures of a package for these materials. */
  constructor(
    private readonly renderer_: WebGLRenderer,
    private readonly textures_: readonly TextureInfo[],
    private readonly materials_: MaterialSet,
    private readonly pool_: WorkerPool,
    /** How a plane's texels are stored; left out: as RGBA. */
    private readonly blocksOf_: (plane: number) => [Compression, BlockFormat] | undefined = () => undefined,
  ) {
    this.uploads_ = new UploadQueue(renderer_, () => this.planes.forEach((plane) => plane.updateMips()));
    this.uploads_.disposed = isLost(renderer_);
    // once, and soon: a GPU that has something to draw keeps the page waiting for its name
    this.software_ = isSoftware(renderer_);
  }

  /** Nothing goes to the GPU any more: its context was lost, or the load has ended. */
  get stopped(): boolean {
    return this.uploads_.disposed;
  }
  /** Nothing goes to the GPU from now on; the planes still tell what was there. */
  stop(): void {
    this.uploads_.disposed = true;
  }
  /**
   * Shows a texture by this plane from now on. The plane is filled with the picture shown so far (or the
   * preview) in small steps, then the materials are changed at once. Resolves when the materials have been
   * changed.
   */
  async show({ base, plane }: PlaneChoice, preview?: ImageBitmap): Promise<void> {
    const { planes } = this;
    const before = planes.get(base);
    const next: PlaneComposer =
        planeComposer(this.renderer_, this.textures_[plane], base, plane, this.blocksOf_(plane)?.[0].storage({
      renderer: this.renderer_, pool: this.pool_, uploads: this.uploads_, info: this.textures_[plane],
      format: this.blocksOf_(plane)![1],
      pending: (by) => (this.pending += by),
      refill: (from) => void this.refill_(next, from, next.blocks?.format).catch(() => undefined),
    }));
    const old = this.slotsOf_(base).map(textureAt);
    const shown = old.find((texture) => (texture.image as ImageBitmap | null)?.width);
    if (this.stopped && before) return;
    if (!this.stopped) next.view(shown ?? old[0] ?? new Texture()); // a finer scale may bring the material
    planes.set(base, next);
    if (this.stopped) return; // a later set shows it
    try {
      let enlarges!: (clear?: Clear) => void;
      const enlarged = new Promise<Clear | undefined>((done) => (enlarges = done));
      const ready = this.fill_(next, enlarges, before, shown, preview).finally(enlarges);
      next.clear = (fragment) =>
        enlarged.then((clear) => clear?.(fragment) ?? ready).catch(() => ready).catch(() => undefined);
      await ready;
    } catch (error) {
      if (this.stopped) return;
      if (before) planes.set(base, before);
      else planes.delete(base);
      next.dispose();
      throw error;
    }
    if (!this.stopped) next.updateMips();
    await next.blocks?.settled();
    if (this.stopped || planes.get(base) !== next) return; // another has taken its place meanwhile
    this.showInMaterials_(next);
    if (before) before.dispose();
    else if (this.textures_[base].role !== 'alpha') old.forEach(disposeTexture);
  }
  /** Whether a material that is there shows this plane. */
  isUsed(base: number): boolean {
    return this.slotsOf_(base).length > 0;
  }
  /** Materials that came with a later scale show the planes, too. */
  showInNewMaterials(): void {
    if (!this.stopped) this.planes.forEach((plane) => plane.filled && this.showInMaterials_(plane));
  }
  /** Queues a fragment; resolves with true when it is shown, with false when its rung is no better. */
  async upload(plane: PlaneComposer, levels: Levels, fragment: number, rung: number,
      better: (there: number) => boolean): Promise<boolean> {
    if (this.stopped) return false;
    ++this.pending;
    plane.come.add(fragment);
    let shown = false;
    await plane.clear!(fragment);
    const uploads = plane.uploads(levels, ...plane.placeOf(fragment));
    // All at once, so that none of another rung comes between.
    await Promise.all(uploads.map(({ pixels, run }, i) => this.uploads_.enqueue(pixels, () => {
      shown = this.planes.get(plane.base) === plane && better(plane.rungs[fragment]);
      if (shown) run();
      if (shown && i === uploads.length - 1) plane.rungs[fragment] = rung;
    })));
    --this.pending;
    return shown;
  }
  /** Makes the smallest mip levels of all planes now. */
  finishMips(): void {
    this.uploads_.finishMips();
  }
  dispose(): void {
    this.stop();
    this.planes.forEach((plane) => plane.dispose());
    this.planes.clear();
  }

  /** Slots of materials that show this plane; coverage stands beside its colours where a material asks. */
  private slotsOf_(base: number): Slot[] {
    const { image, role } = this.textures_[base];
    const slots = this.materials_.slots.filter((s) => s.image === image);
    if (role !== 'alpha') return slots;
    const covered =
      slots.filter(({ name, material: m }) => name === 'map' && (m.transparent || m.alphaTest > 0));
    return covered.map((s) => ({ ...s, name: 'alphaMap' }));
  }
  /** Gives materials views of a plane, materials that came meanwhile or with a later scale, too. */
  private showInMaterials_(plane: PlaneComposer): void {
    for (const slot of this.slotsOf_(plane.base)) {
      const old = textureAt(slot);
      const shown = texturesIn(slot.material);
      if (!plane.textures.includes(old)) {
        if (!shown[slot.name]) slot.material.needsUpdate = true;
        shown[slot.name] = plane.view(old);
      }
      // A finer scale's material may copy one that shows the plane: it has its textures, not its shader.
      const asBlocks = plane.blocks &&
        this.blocksOf_(plane.plane)?.[0].readTwoChannels(slot.material, slot.name, plane.blocks.format);
      if (!asBlocks && this.isXy_(plane)) this.readTwoChannels_?.(slot.material, slot.name, 'jpeg-xy');
    }
  }
  private async fill_(next: PlaneComposer, enlarges: (clear?: Clear) => void, before?: PlaneComposer,
      old?: Texture, preview?: ImageBitmap): Promise<void> {
    const image = preview ?? (old?.image as ImageBitmap | null | undefined);
    if (before?.filled) await this.scale_(next, before.textures[0], before.blocks?.format);
    else if (image?.width)
      try {
        // Coverage alone has a preview of its own: the colours are shown already.
        if (preview || next.blocks || (await this.software_)) await this.enlarge_(next, image, enlarges);
        else await this.scale_(next, old!);
      } catch (error) {
        // A browser whose workers cannot draw leaves enlarging to the GPU.
        if (preview || next.rungs.some((rung) => rung >= 0) || this.stopped) throw error;
        await this.scale_(next, old!);
      }
    if (this.isXy_(next)) this.readTwoChannels_ ??= (await import('./blocks/two_channels')).readTwoChannels;
    next.filled = true;
  }
  /** Whether fragments bring x and y alone. */
  private isXy_({ plane }: PlaneComposer): boolean {
    return this.textures_[plane].codec === 'jpeg-xy';
  }
  /** Fills a plane with a texture that stands on the GPU. */
  private async scale_(next: PlaneComposer, from: Texture, format?: BlockFormat): Promise<void> {
    if (next.blocks) await this.refill_(next, from, format);
    else if (!this.stopped) next.fill(from);
  }
  private async refill_(next: PlaneComposer, from: Texture, format?: BlockFormat): Promise<void> {
    await this.blocksOf_(next.plane)?.[0].refill(next, from, format, this.renderer_, this.pool_,
      this.uploads_);
  }
  private async enlarge_(next: PlaneComposer, image: ImageBitmap,
      enlarges: (clear?: Clear) => void): Promise<void> {
    const { clear, done } = (await import('./enlarge')).enlarge(next, image, this.pool_, this.uploads_);
    enlarges(clear);
    await done;
  }
}

const textureAt = ({ material, name }: Slot): Texture =>
  (texturesIn(material)[name] ?? texturesIn(material).map)!;
