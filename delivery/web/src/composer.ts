import { FramebufferTexture, Texture, WebGLRenderer } from 'three';
import type { ComposedPlane } from './api';
import type { TextureInfo } from './textures';

/** A GPU texture under three's own; only what WebGLRenderer keeps of it. */
interface TextureProperties {
  __webglTexture?: WebGLTexture;
}

function glTextureOf(renderer: WebGLRenderer, texture: Texture): WebGLTexture {
  renderer.initTexture(texture);
  const { __webglTexture } = renderer.properties.get(texture) as TextureProperties;
  if (!__webglTexture) throw new Error('the renderer gave no texture');
  return __webglTexture;
}

const gl2 = (renderer: WebGLRenderer): WebGL2RenderingContext => renderer.getContext() as WebGL2RenderingContext;

/** A level of a GPU texture. */
interface Level {
  texture: WebGLTexture;
  level: number;
}
/** x0, y0, x1, y1 */
type Rect = readonly [number, number, number, number];
interface Copy {
  from: Level;
  to: Level;
  source: Rect;
  target: Rect;
}

/** Copies between textures on the GPU, and leaves the renderer's state as it was. */
export class Blitter {
  private readonly buffers_: (WebGLFramebuffer | null)[];
  constructor(readonly renderer: WebGLRenderer) {
    const gl = gl2(renderer);
    this.buffers_ = [gl.createFramebuffer(), gl.createFramebuffer()];
  }
  /** Runs `draw` with framebuffers of its own to attach textures to. */
  private with_(draw: (gl: WebGL2RenderingContext) => void): void {
    const gl = gl2(this.renderer);
    const targets = [gl.READ_FRAMEBUFFER, gl.DRAW_FRAMEBUFFER] as const;
    const before = [gl.READ_FRAMEBUFFER_BINDING, gl.DRAW_FRAMEBUFFER_BINDING].map(
      (name) => gl.getParameter(name) as WebGLFramebuffer | null,
    );
    const scissor = gl.isEnabled(gl.SCISSOR_TEST);
    if (scissor) gl.disable(gl.SCISSOR_TEST);
    targets.forEach((target, i) => gl.bindFramebuffer(target, this.buffers_[i]));
    draw(gl);
    for (const target of targets) gl.framebufferTexture2D(target, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, null, 0);
    targets.forEach((target, i) => gl.bindFramebuffer(target, before[i]));
    if (scissor) gl.enable(gl.SCISSOR_TEST);
  }
  /** Copies rectangles one after the other, each scaled bilinearly. */
  copy(copies: readonly Copy[]): void {
    this.with_((gl) => {
      for (const { from, to, source, target } of copies) {
        gl.framebufferTexture2D(gl.READ_FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, from.texture, from.level);
        gl.framebufferTexture2D(gl.DRAW_FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, to.texture, to.level);
        gl.blitFramebuffer(...source, ...target, gl.COLOR_BUFFER_BIT, gl.LINEAR);
      }
    });
  }
  /** Level 0 covers everything. */
  makeOpaque(texture: WebGLTexture): void {
    this.with_((gl) => {
      const mask = gl.getParameter(gl.COLOR_WRITEMASK) as [boolean, boolean, boolean, boolean];
      gl.framebufferTexture2D(gl.DRAW_FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
      gl.colorMask(false, false, false, true);
      gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 1]);
      gl.colorMask(...mask);
    });
  }
  read(texture: WebGLTexture, width: number, height: number): Uint8Array {
    const pixels = new Uint8Array(4 * width * height);
    this.with_((gl) => {
      gl.framebufferTexture2D(gl.READ_FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
      gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    });
    return pixels;
  }
  dispose(): void {
    for (const buffer of this.buffers_) gl2(this.renderer).deleteFramebuffer(buffer);
  }
}

const mipmapped = (texture: Texture): boolean => texture.minFilter > 1006; // behind NearestFilter 1003, LinearFilter 1006

/** Levels that come with every fragment; the others, 1/256 of the whole and less, are made of the last of them. */
export const ownLevels = 5;

/**
 * One texture of the model: fragments are uploaded into it where they belong, and materials use views of it, which
 * share its storage on the GPU as long as their samplers are alike.
 */
export class PlaneComposer implements ComposedPlane {
  readonly rungs: Int16Array;
  readonly image: number;
  readonly role: string;
  readonly widthPx: number;
  readonly heightPx: number;
  private readonly views_: FramebufferTexture[] = [];
  private readonly storages_ = new Set<WebGLTexture>();
  private readonly stale_ = new Set<WebGLTexture>();
  /** Every pixel is something: fragments may come. */
  filled = false;

  constructor(
    private readonly blitter_: Blitter,
    readonly info: TextureInfo,
    readonly base: number,
    readonly plane: number,
  ) {
    this.image = info.image;
    this.role = info.role;
    this.widthPx = info.widthPx;
    this.heightPx = info.heightPx;
    this.rungs = new Int16Array(info.columns * info.rows).fill(-1);
  }

  get textures(): readonly Texture[] {
    return this.views_;
  }

  /** A texture for the place where a material has `old`: the same sampler, channel and transform. */
  view(old: Texture): Texture {
    const texture = new FramebufferTexture(this.widthPx, this.heightPx);
    if (this.views_.length > 0) texture.source = this.views_[0].source;
    for (const name of ['name', 'channel', 'wrapS', 'wrapT', 'magFilter', 'minFilter', 'anisotropy', 'rotation'] as const)
      (texture as unknown as Record<string, unknown>)[name] = old[name];
    texture.colorSpace = this.info.colourSpace === 'srgb' ? 'srgb' : '';
    texture.offset.copy(old.offset);
    texture.repeat.copy(old.repeat);
    texture.center.copy(old.center);
    texture.matrixAutoUpdate = old.matrixAutoUpdate;
    texture.matrix.copy(old.matrix);
    texture.flipY = false;
    const storage = glTextureOf(this.renderer_, texture);
    const [first] = this.storages_;
    this.views_.push(texture);
    if (this.storages_.has(storage)) return texture;
    this.storages_.add(storage);
    if (first && this.filled) {
      this.fillFrom_(first, this.widthPx, this.heightPx, storage);
    }
    return texture;
  }
  private get renderer_(): WebGLRenderer {
    return this.blitter_.renderer;
  }

  /** Fills the whole with a coarser plane of the same image, scaled bilinearly. */
  fillFrom(coarser: PlaneComposer): void {
    const [from] = coarser.storages_;
    if (from) for (const to of this.storages_) this.fillFrom_(from, coarser.widthPx, coarser.heightPx, to);
    this.filled = true;
  }
  /** The same with a texture of three's. */
  fillFromTexture(texture: Texture, widthPx: number, heightPx: number): void {
    for (const to of this.storages_) this.fillFrom_(glTextureOf(this.renderer_, texture), widthPx, heightPx, to);
    this.filled = true;
  }
  private fillFrom_(from: WebGLTexture, widthPx: number, heightPx: number, to: WebGLTexture): void {
    const target: Rect = [0, 0, this.widthPx, this.heightPx];
    this.blitter_.copy([
      { from: { texture: from, level: 0 }, to: { texture: to, level: 0 }, source: [0, 0, widthPx, heightPx], target },
    ]);
    this.blitter_.makeOpaque(to); // coverage has a texture of its own
    this.halve_(to, 0);
  }

  private unpackAsIs_(gl: WebGL2RenderingContext): void {
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
    gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
    gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
  }

  /** A fragment's pixels go where they belong; what reaches beyond the image is left out. */
  uploadFragment(levels: readonly ImageBitmap[], fragment: number, rung: number): void {
    const { columns, fragmentWidthPx, fragmentHeightPx } = this.info;
    const x = (fragment % columns) * fragmentWidthPx;
    const y = Math.floor(fragment / columns) * fragmentHeightPx;
    this.upload(levels, x, y);
    this.rungs[fragment] = rung;
  }
  /** Pixels at a place of level 0 (multiples of 16), and the same in the levels below it. */
  upload(levels: readonly ImageBitmap[], x: number, y: number): void {
    const gl = gl2(this.renderer_);
    for (const storage of this.storages_) {
      this.renderer_.state.bindTexture(gl.TEXTURE_2D, storage);
      this.unpackAsIs_(gl);
      levels.forEach((bitmap, level) => {
        if (level > 0 && (level >= this.levels_ || !this.views_.some(mipmapped))) return;
        const [left, top] = [x >> level, y >> level];
        const width = Math.min(bitmap.width, (this.widthPx >> level) - left);
        const height = Math.min(bitmap.height, (this.heightPx >> level) - top);
        if (width > 0 && height > 0)
          gl.texSubImage2D(gl.TEXTURE_2D, level, left, top, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bitmap);
      });
      this.stale_.add(storage);
    }
  }

  /** Makes the levels behind one, each of the one before. */
  private halve_(storage: WebGLTexture, from: number): void {
    const side = (px: number, level: number): number => Math.max(1, px >> level);
    const rect = (level: number): Rect => [0, 0, side(this.widthPx, level), side(this.heightPx, level)];
    const copies: Copy[] = [];
    for (let level = from + 1; level < this.levels_; ++level)
      copies.push({
        from: { texture: storage, level: level - 1 },
        to: { texture: storage, level },
        source: rect(level - 1),
        target: rect(level),
      });
    if (copies.length > 0 && this.views_.some(mipmapped)) this.blitter_.copy(copies);
  }
  private get levels_(): number {
    return 32 - Math.clz32(Math.max(this.widthPx, this.heightPx));
  }
  /** The smallest levels follow what has been uploaded. */
  updateMips(): void {
    for (const storage of this.stale_) this.halve_(storage, ownLevels - 1);
    this.stale_.clear();
  }
  get mipsAreStale(): boolean {
    return this.stale_.size > 0;
  }

  /** RGBA bytes, row 0 at the top. */
  read(): Uint8Array {
    const [storage] = this.storages_;
    return storage ? this.blitter_.read(storage, this.widthPx, this.heightPx) : new Uint8Array(0);
  }

  dispose(): void {
    for (const view of this.views_) view.dispose();
    this.views_.length = 0;
    this.storages_.clear();
    this.stale_.clear();
  }
}
