import { FramebufferTexture, type Texture, type WebGLRenderer } from 'three';
import type { TextureInfo } from '../format/textures';

/** Levels that come with every fragment. Further levels, 1/256 of the whole, are made of the last one. */
export const ownLevels = 5;

/** Filters of three.js behind NearestFilter (1003) and LinearFilter (1006) ask for mip levels. */
const linearFilter = 1006;

/** The storage on the GPU of a plane: views for materials share it where their samplers are alike. */
export class GpuStorage<View extends Texture> {
  protected readonly gl_: WebGL2RenderingContext;
  protected readonly views_ = new Map<Texture, View>(); // by the texture that each view is like
  protected readonly storages_ = new Map<WebGLTexture, number>(); // how many levels each has

  constructor(protected readonly renderer_: WebGLRenderer, protected readonly info_: TextureInfo) {
    this.gl_ = renderer_.getContext() as WebGL2RenderingContext;
  }

  get textures(): View[] {
    return [...this.views_.values()];
  }
  dispose(): void {
    this.views_.forEach((view) => view.dispose());
    this.views_.clear();
    this.storages_.clear();
  }

  protected storageOf_(texture: Texture): WebGLTexture {
    this.renderer_.initTexture(texture);
    const { __webglTexture: storage } =
      this.renderer_.properties.get(texture) as { __webglTexture?: WebGLTexture };
    if (!storage) throw new Error('the renderer gave no texture');
    return storage;
  }
  /** Levels of a picture whose mips a material's sampler asks for, or does not. */
  protected levelsFor_({ minFilter }: Texture): number {
    const { widthPx, heightPx } = this.info_;
    return (minFilter as number) > linearFilter ? 32 - Math.clz32(Math.max(widthPx, heightPx)) : 1;
  }
  protected side_(px: number, level: number): number {
    return Math.max(1, px >> level);
  }
}

/** Storage of RGBA. */
export class PlaneStorage extends GpuStorage<FramebufferTexture> {
  private stale_ = false; // the smallest levels

  /** See PlaneComposer.view. `filled`: a new storage gets the picture of the others. */
  view(old: Texture, filled: boolean): Texture {
    const known = this.views_.get(old);
    if (known) return known;
    const { widthPx, heightPx, colourSpace } = this.info_;
    const texture = new FramebufferTexture(widthPx, heightPx);
    const { source } = this.textures[0] ?? texture;
    texture.copy(old as FramebufferTexture);
    Object.assign(texture,
      { source, colorSpace: colourSpace === 'srgb' ? 'srgb' : '', flipY: false, generateMipmaps: false });
    const storage = this.storageOf_(texture);
    this.views_.set(old, texture);
    if (this.storages_.has(storage)) return texture;
    const [first] = this.storages_.keys();
    this.storages_.set(storage, this.levelsFor_(texture));
    if (first && filled) this.fill_(first, widthPx, heightPx, storage);
    return texture;
  }
  /** Fills the whole with another texture, scaled bilinearly. */
  fillAll(from: Texture): void {
    const { width, height } = from.image as ImageBitmap;
    for (const to of this.storages_.keys()) this.fill_(this.storageOf_(from), width, height, to);
  }
  /** See PlaneComposer.upload. */
  upload(levels: readonly ImageBitmap[], x: number, y: number): void {
    const { gl_: gl, info_: { widthPx, heightPx } } = this;
    for (const [storage, levelCount] of this.storages_) {
      this.renderer_.state.bindTexture(gl.TEXTURE_2D, storage);
      for (const name of [gl.UNPACK_FLIP_Y_WEBGL, gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL,
          gl.UNPACK_COLORSPACE_CONVERSION_WEBGL]) gl.pixelStorei(name, 0);
      levels.slice(0, levelCount).forEach((bitmap, level) => {
        const [left, top] = [x >> level, y >> level];
        const width = Math.min(bitmap.width, (widthPx >> level) - left);
        const height = Math.min(bitmap.height, (heightPx >> level) - top);
        if (width > 0 && height > 0)
          gl.texSubImage2D(gl.TEXTURE_2D, level, left, top, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bitmap);
      });
    }
    this.stale_ = true;
  }
  /** The smallest levels follow the uploads. */
  updateMips(): void {
    if (this.stale_) this.withBuffers_(() =>
      [...this.storages_.keys()].forEach((storage) => this.halve_(storage, ownLevels - 1)));
    this.stale_ = false;
  }
  /** RGBA bytes, row 0 at the top. */
  read(): Uint8Array {
    const { gl_: gl, info_: { widthPx, heightPx } } = this;
    const pixels = new Uint8Array(4 * widthPx * heightPx);
    this.withBuffers_(() => {
      this.attach_(gl.READ_FRAMEBUFFER, [...this.storages_.keys()][0], 0);
      gl.readPixels(0, 0, widthPx, heightPx, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    });
    return pixels;
  }

  /** Runs `use` with framebuffers of its own, and leaves the renderer's state as it was. */
  private withBuffers_(use: () => void): void {
    const { gl_: gl } = this;
    const targets = [gl.READ_FRAMEBUFFER, gl.DRAW_FRAMEBUFFER];
    const before = [gl.READ_FRAMEBUFFER_BINDING, gl.DRAW_FRAMEBUFFER_BINDING].map((name) =>
      gl.getParameter(name) as WebGLFramebuffer | null);
    const scissor = gl.isEnabled(gl.SCISSOR_TEST);
    gl.disable(gl.SCISSOR_TEST);
    const buffers = targets.map(() => gl.createFramebuffer());
    targets.forEach((target, i) => gl.bindFramebuffer(target, buffers[i]));
    use();
    targets.forEach((target, i) => gl.bindFramebuffer(target, before[i]));
    buffers.forEach((buffer) => gl.deleteFramebuffer(buffer));
    if (scissor) gl.enable(gl.SCISSOR_TEST);
  }
  /** Makes a level of a texture the framebuffer to read from, or to draw to. */
  private attach_(target: number, texture: WebGLTexture, level: number): void {
    const { gl_: gl } = this;
    gl.framebufferTexture2D(target, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, level);
  }
  private copy_(from: WebGLTexture, fromLevel: number, width: number, height: number, to: WebGLTexture,
      level: number): void {
    const { gl_: gl, info_: { widthPx, heightPx } } = this;
    this.attach_(gl.READ_FRAMEBUFFER, from, fromLevel);
    this.attach_(gl.DRAW_FRAMEBUFFER, to, level);
    gl.blitFramebuffer(0, 0, width, height, 0, 0, this.side_(widthPx, level), this.side_(heightPx, level),
      gl.COLOR_BUFFER_BIT, gl.LINEAR);
  }
  /** Makes the levels behind level `from`, each of the level before. */
  private halve_(storage: WebGLTexture, from: number): void {
    const { widthPx, heightPx } = this.info_;
    for (let level = from + 1; level < this.storages_.get(storage)!; ++level)
      this.copy_(storage, level - 1, this.side_(widthPx, level - 1), this.side_(heightPx, level - 1), storage,
        level);
  }
  private fill_(from: WebGLTexture, width: number, height: number, to: WebGLTexture): void {
    const { gl_: gl } = this;
    this.withBuffers_(() => {
      this.copy_(from, 0, width, height, to, 0);
      // Covered everywhere: coverage has a texture of its own.
      const mask = gl.getParameter(gl.COLOR_WRITEMASK) as [boolean, boolean, boolean, boolean];
      gl.colorMask(false, false, false, true);
      gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 1]);
      gl.colorMask(...mask);
      this.halve_(to, 0);
    });
  }
}
