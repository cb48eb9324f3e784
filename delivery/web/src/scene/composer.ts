import { FramebufferTexture, Texture, WebGLRenderer } from 'three';
import type { ComposedPlane } from './api';
import type { TextureInfo } from '../format/textures';

/** Levels that come with every fragment; the others, 1/256 of the whole and less, are made of the last of them. */
export const ownLevels = 5;

/**
 * One texture of the model: fragments are uploaded into it where they belong, and materials use views of it, which
 * share its storage on the GPU as long as their samplers are alike.
 */
export interface PlaneComposer extends ComposedPlane {
  readonly info: TextureInfo;
  /** Fragments that have come, be it before they can be shown. */
  readonly come: Set<number>;
  /** Every pixel is something: fragments may be shown. */
  filled?: boolean;
  ready?: Promise<void>;
  /** A texture for the place where a material has `old`: the same sampler, channel and transform. */
  view(old: Texture): Texture;
  /** Fills the whole with another texture, scaled bilinearly. */
  fill(from: Texture): void;
  /** Pixels at a place of level 0 (multiples of 16), and the same in the levels below it; what reaches beyond the image is left out. */
  upload(levels: readonly ImageBitmap[], x: number, y: number): void;
  uploadFragment(levels: readonly ImageBitmap[], fragment: number, rung: number): void;
  /** The smallest levels follow what has been uploaded. */
  updateMips(): void;
  /** RGBA bytes, row 0 at the top. */
  read(): Uint8Array;
  dispose(): void;
}

/** A plane to be composed in the renderer's context. */
export function planeComposer(renderer: WebGLRenderer, info: TextureInfo, base: number, plane: number): PlaneComposer {
  const { image, role, widthPx, heightPx, columns, rows, fragmentWidthPx, fragmentHeightPx } = info;
  const gl = renderer.getContext() as WebGL2RenderingContext;
  const views = new Map<Texture, FramebufferTexture>(); // by what they are like
  const storages = new Set<WebGLTexture>();
  let stale = false;
  const side = (px: number, level: number): number => Math.max(1, px >> level);

  function storageOf(texture: Texture): WebGLTexture {
    renderer.initTexture(texture);
    const { __webglTexture: storage } = renderer.properties.get(texture) as { __webglTexture?: WebGLTexture };
    if (!storage) throw new Error('the renderer gave no texture');
    return storage;
  }
  /** Runs `use` with framebuffers of its own, and leaves the renderer's state as it was. */
  function withBuffers(use: () => void): void {
    const targets = [gl.READ_FRAMEBUFFER, gl.DRAW_FRAMEBUFFER];
    const before = [gl.READ_FRAMEBUFFER_BINDING, gl.DRAW_FRAMEBUFFER_BINDING].map((name) => gl.getParameter(name) as WebGLFramebuffer | null);
    const scissor = gl.isEnabled(gl.SCISSOR_TEST);
    gl.disable(gl.SCISSOR_TEST);
    const own = targets.map(() => gl.createFramebuffer());
    targets.forEach((target, i) => gl.bindFramebuffer(target, own[i]));
    use();
    targets.forEach((target, i) => gl.bindFramebuffer(target, before[i]));
    own.forEach((buffer) => gl.deleteFramebuffer(buffer));
    if (scissor) gl.enable(gl.SCISSOR_TEST);
  }
  /** The framebuffer that is read from, or drawn to, is a level of a texture. */
  const attach = (target: number, texture: WebGLTexture, level: number): void =>
    gl.framebufferTexture2D(target, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, level);
  function copy(from: WebGLTexture, fromLevel: number, width: number, height: number, to: WebGLTexture, level: number): void {
    attach(gl.READ_FRAMEBUFFER, from, fromLevel);
    attach(gl.DRAW_FRAMEBUFFER, to, level);
    gl.blitFramebuffer(0, 0, width, height, 0, 0, side(widthPx, level), side(heightPx, level), gl.COLOR_BUFFER_BIT, gl.LINEAR);
  }
  /** Levels that there are: one, where no view asks for more (filters behind NearestFilter 1003 and LinearFilter 1006). */
  const levelCount = (): number => ([...views.values()].some((v) => v.minFilter > 1006) ? 32 - Math.clz32(Math.max(widthPx, heightPx)) : 1);
  /** Makes the levels behind one, each of the one before. */
  function halve(storage: WebGLTexture, from: number): void {
    for (let level = from + 1; level < levelCount(); ++level)
      copy(storage, level - 1, side(widthPx, level - 1), side(heightPx, level - 1), storage, level);
  }
  function fill(from: WebGLTexture, width: number, height: number, to: WebGLTexture): void {
    withBuffers(() => {
      copy(from, 0, width, height, to, 0);
      // Covered everywhere: coverage has a texture of its own.
      const mask = gl.getParameter(gl.COLOR_WRITEMASK) as [boolean, boolean, boolean, boolean];
      gl.colorMask(false, false, false, true);
      gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 1]);
      gl.colorMask(...mask);
      halve(to, 0);
    });
  }

  const composer: PlaneComposer = {
    info, base, plane, image, role, widthPx, heightPx,
    rungs: new Int16Array(columns * rows).fill(-1),
    come: new Set(),
    get textures() {
      return [...views.values()];
    },
    view(old) {
      const known = views.get(old);
      if (known) return known;
      const texture = new FramebufferTexture(widthPx, heightPx);
      const { source } = composer.textures[0] ?? texture;
      texture.copy(old as FramebufferTexture);
      Object.assign(texture, { source, colorSpace: info.colourSpace === 'srgb' ? 'srgb' : '', flipY: false, generateMipmaps: false });
      const storage = storageOf(texture);
      views.set(old, texture);
      const [first] = storages;
      if (first && composer.filled && !storages.has(storage)) fill(first, widthPx, heightPx, storage);
      storages.add(storage);
      return texture;
    },
    fill(from) {
      const { width, height } = from.image as ImageBitmap;
      for (const to of storages) fill(storageOf(from), width, height, to);
    },
    uploadFragment(levels, fragment, rung) {
      composer.upload(levels, (fragment % columns) * fragmentWidthPx, Math.floor(fragment / columns) * fragmentHeightPx);
      composer.rungs[fragment] = rung;
    },
    upload(levels, x, y) {
      for (const storage of storages) {
        renderer.state.bindTexture(gl.TEXTURE_2D, storage);
        for (const name of [gl.UNPACK_FLIP_Y_WEBGL, gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, gl.UNPACK_COLORSPACE_CONVERSION_WEBGL]) gl.pixelStorei(name, 0);
        levels.slice(0, levelCount()).forEach((bitmap, level) => {
          const [left, top] = [x >> level, y >> level];
          const width = Math.min(bitmap.width, (widthPx >> level) - left);
          const height = Math.min(bitmap.height, (heightPx >> level) - top);
          if (width > 0 && height > 0) gl.texSubImage2D(gl.TEXTURE_2D, level, left, top, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bitmap);
        });
      }
      stale = true;
    },
    updateMips() {
      if (stale) withBuffers(() => storages.forEach((storage) => halve(storage, ownLevels - 1)));
      stale = false;
    },
    read() {
      const pixels = new Uint8Array(4 * widthPx * heightPx);
      withBuffers(() => {
        attach(gl.READ_FRAMEBUFFER, [...storages][0], 0);
        gl.readPixels(0, 0, widthPx, heightPx, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
      });
      return pixels;
    },
    dispose() {
      views.forEach((view) => view.dispose());
      views.clear();
      storages.clear();
    },
  };
  return composer;
}
