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

/** Runs `draw` with `from` to be read and `to` to be drawn to, and leaves the renderer's state as it was. */
function withFramebuffers(
  renderer: WebGLRenderer,
  from: WebGLTexture,
  to: WebGLTexture | undefined,
  draw: (gl: WebGL2RenderingContext) => void,
): void {
  const gl = gl2(renderer);
  const targets = [gl.READ_FRAMEBUFFER, gl.DRAW_FRAMEBUFFER] as const;
  const before = [gl.READ_FRAMEBUFFER_BINDING, gl.DRAW_FRAMEBUFFER_BINDING].map(
    (name) => gl.getParameter(name) as WebGLFramebuffer | null,
  );
  const scissor = gl.isEnabled(gl.SCISSOR_TEST);
  if (scissor) gl.disable(gl.SCISSOR_TEST);
  const buffers = [from, to].map((texture, i) => {
    if (!texture) return null;
    const buffer = gl.createFramebuffer();
    gl.bindFramebuffer(targets[i], buffer);
    gl.framebufferTexture2D(targets[i], gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    return buffer;
  });
  try {
    draw(gl);
  } finally {
    targets.forEach((target, i) => gl.bindFramebuffer(target, before[i]));
    buffers.forEach((buffer) => gl.deleteFramebuffer(buffer));
    if (scissor) gl.enable(gl.SCISSOR_TEST);
  }
}

const mipmapped = (texture: Texture): boolean => texture.minFilter > 1006; // behind NearestFilter 1003, LinearFilter 1006

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
  private readonly views: FramebufferTexture[] = [];
  private readonly storages = new Set<WebGLTexture>();
  private readonly stale = new Set<WebGLTexture>();

  constructor(
    private readonly renderer: WebGLRenderer,
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
    return this.views;
  }

  /** A texture for the place where a material has `old`: the same sampler, channel and transform. */
  view(old: Texture): Texture {
    const texture = new FramebufferTexture(this.widthPx, this.heightPx);
    if (this.views.length > 0) texture.source = this.views[0].source;
    for (const name of ['name', 'channel', 'wrapS', 'wrapT', 'magFilter', 'minFilter', 'anisotropy', 'rotation'] as const)
      (texture as unknown as Record<string, unknown>)[name] = old[name];
    texture.colorSpace = this.info.colourSpace === 'srgb' ? 'srgb' : '';
    texture.offset.copy(old.offset);
    texture.repeat.copy(old.repeat);
    texture.center.copy(old.center);
    texture.matrixAutoUpdate = old.matrixAutoUpdate;
    texture.matrix.copy(old.matrix);
    texture.flipY = false;
    const storage = glTextureOf(this.renderer, texture);
    const first = this.views[0];
    this.views.push(texture);
    if (!this.storages.has(storage)) {
      this.storages.add(storage);
      if (first) this.blit(glTextureOf(this.renderer, first), this.widthPx, this.heightPx, [storage]);
    }
    return texture;
  }

  /** Fills the whole of it with another picture of the same image, scaled bilinearly: a preview or a coarser plane. */
  fillFrom(texture: Texture, widthPx: number, heightPx: number): void {
    this.blit(glTextureOf(this.renderer, texture), widthPx, heightPx, [...this.storages]);
    this.updateMips();
  }
  fillFromBitmap(bitmap: ImageBitmap): void {
    const { state } = this.renderer;
    const gl = gl2(this.renderer);
    const texture = gl.createTexture();
    state.bindTexture(gl.TEXTURE_2D, texture as WebGLTexture);
    this.unpackAsIs(gl);
    const format = this.info.colourSpace === 'srgb' ? gl.SRGB8_ALPHA8 : gl.RGBA8;
    gl.texImage2D(gl.TEXTURE_2D, 0, format, gl.RGBA, gl.UNSIGNED_BYTE, bitmap);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    this.blit(texture as WebGLTexture, bitmap.width, bitmap.height, [...this.storages]);
    state.unbindTexture();
    gl.deleteTexture(texture);
    this.updateMips();
  }
  private blit(from: WebGLTexture, widthPx: number, heightPx: number, to: WebGLTexture[]): void {
    for (const storage of to) {
      withFramebuffers(this.renderer, from, storage, (gl) =>
        gl.blitFramebuffer(
          0, 0, widthPx, heightPx, 0, 0, this.widthPx, this.heightPx, gl.COLOR_BUFFER_BIT, gl.LINEAR,
        ),
      );
      this.stale.add(storage);
    }
  }
  private unpackAsIs(gl: WebGL2RenderingContext): void {
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
    gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
    gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
  }

  /** A fragment's pixels go where they belong; what reaches beyond the image is left out. */
  upload(bitmap: ImageBitmap, fragment: number, rung: number): void {
    const { columns, fragmentWidthPx, fragmentHeightPx } = this.info;
    const x = (fragment % columns) * fragmentWidthPx;
    const y = Math.floor(fragment / columns) * fragmentHeightPx;
    const width = Math.min(fragmentWidthPx, this.widthPx - x);
    const height = Math.min(fragmentHeightPx, this.heightPx - y);
    const gl = gl2(this.renderer);
    for (const storage of this.storages) {
      this.renderer.state.bindTexture(gl.TEXTURE_2D, storage);
      this.unpackAsIs(gl);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, x, y, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bitmap);
      this.stale.add(storage);
    }
    this.rungs[fragment] = rung;
  }

  /** Smaller mip levels follow what has been uploaded. */
  updateMips(): void {
    const gl = gl2(this.renderer);
    if (this.views.some(mipmapped))
      for (const storage of this.stale) {
        this.renderer.state.bindTexture(gl.TEXTURE_2D, storage);
        gl.generateMipmap(gl.TEXTURE_2D);
      }
    this.stale.clear();
  }
  get mipsAreStale(): boolean {
    return this.stale.size > 0;
  }

  /** RGBA bytes, row 0 at the top. */
  read(): Uint8Array {
    const pixels = new Uint8Array(4 * this.widthPx * this.heightPx);
    const [storage] = this.storages;
    if (storage)
      withFramebuffers(this.renderer, storage, undefined, (gl) =>
        gl.readPixels(0, 0, this.widthPx, this.heightPx, gl.RGBA, gl.UNSIGNED_BYTE, pixels),
      );
    return pixels;
  }

  dispose(): void {
    for (const view of this.views) view.dispose();
    this.views.length = 0;
    this.storages.clear();
    this.stale.clear();
  }
}
