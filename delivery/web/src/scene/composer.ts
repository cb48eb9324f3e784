import type { Texture, WebGLRenderer } from 'three';
import type { ComposedPlane } from './api';
import { PlaneStorage } from './plane_storage';
import type { TextureInfo } from '../format/textures';

/**
 * One texture of the model: fragments are uploaded into the texture where they belong. Materials use views of the texture, which
 * share storage on the GPU as long as their samplers are alike.
 */
export interface PlaneComposer extends ComposedPlane {
  readonly info: TextureInfo;
  /** Fragments that have come, shown or not yet. */
  readonly come: Set<number>;
  /** Every pixel has a colour: fragments may be shown. */
  filled?: boolean;
  ready?: Promise<void>;
  /** A texture for the place where a material has `old`: the same sampler, channel and transform. */
  view(old: Texture): Texture;
  /** Fills the whole with another texture, scaled bilinearly. */
  fill(from: Texture): void;
  /** Uploads pixels at a place of level 0 (multiples of 16), and the same in the levels below. Pixels beyond the image are left out. */
  upload(levels: readonly ImageBitmap[], x: number, y: number): void;
  uploadFragment(levels: readonly ImageBitmap[], fragment: number, rung: number): void;
  /** The smallest levels follow the uploads. */
  updateMips(): void;
  /** RGBA bytes, row 0 at the top. */
  read(): Uint8Array;
  dispose(): void;
}

/** A plane to be composed in the renderer's context. */
export function planeComposer(renderer: WebGLRenderer, info: TextureInfo, base: number, plane: number): PlaneComposer {
  const { image, role, widthPx, heightPx, columns, rows, fragmentWidthPx, fragmentHeightPx } = info;
  const storage = new PlaneStorage(renderer, info);
  const composer: PlaneComposer = {
    info, base, plane, image, role, widthPx, heightPx,
    rungs: new Int16Array(columns * rows).fill(-1),
    come: new Set(),
    get textures() {
      return storage.textures;
    },
    view: (old) => storage.view(old, !!composer.filled),
    fill: (from) => storage.fillAll(from),
    uploadFragment(bitmaps, fragment, rung) {
      composer.upload(bitmaps, (fragment % columns) * fragmentWidthPx, Math.floor(fragment / columns) * fragmentHeightPx);
      composer.rungs[fragment] = rung;
    },
    upload: (bitmaps, x, y) => storage.upload(bitmaps, x, y),
    updateMips: () => storage.updateMips(),
    read: () => storage.read(),
    dispose: () => storage.dispose(),
  };
  return composer;
}
