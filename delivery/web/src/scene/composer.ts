import type { Texture, WebGLRenderer } from 'three';
import type { Levels } from '../worker/protocol';
import type { ComposedPlane } from './api';
import type { BlockStorage, Upload } from './blocks/block_storage';
import { PlaneStorage } from './plane_storage';
import type { TextureInfo } from '../format/textures';

/** One texture of the model. Materials use views of it, which share storage if their samplers are alike. */
export interface PlaneComposer extends ComposedPlane {
  readonly info: TextureInfo;
  /** Where texels are stored as blocks. */
  readonly blocks?: BlockStorage;
  /** Fragments that have come, shown or not yet. */
  readonly come: Set<number>;
  /** Every pixel has a colour: fragments may be shown. */
  filled?: boolean;
  /** Resolves when the picture that a plane begins with does not come over this fragment any more. */
  clear?(fragment: number): Promise<unknown>;
  /** A texture for the place where a material has `old`: the same sampler, channel and transform. */
  view(old: Texture): Texture;
  /** Fills the whole with another texture, scaled bilinearly; blocks are filled by blocks/refill.ts. */
  fill(from: Texture): void;
  /** Uploads of pixels at a place of level 0 (multiples of 16) and below. It cuts them at the image's end. */
  uploads(levels: Levels, x: number, y: number): Upload[];
  /** Where a fragment begins. */
  placeOf(fragment: number): [x: number, y: number];
  /** The smallest levels follow the uploads. */
  updateMips(): void;
  /** RGBA bytes, row 0 at the top. */
  read(): Uint8Array;
  dispose(): void;
}

/** A plane to be composed in the renderer's context. */
export function planeComposer(renderer: WebGLRenderer, info: TextureInfo, base: number, plane: number,
    blocks?: BlockStorage): PlaneComposer {
  const { image, role, widthPx, heightPx, columns, rows, fragmentWidthPx, fragmentHeightPx } = info;
  const rgba = blocks ? undefined : new PlaneStorage(renderer, info);
  const storage = (blocks ?? rgba)!;
  const composer: PlaneComposer = {
    info, base, plane, image, role, widthPx, heightPx, blocks,
    texels: blocks?.format ?? 'rgba8',
    rungs: new Int16Array(columns * rows).fill(-1),
    come: new Set(),
    get textures() {
      return storage.textures;
    },
    view: (old) => storage.view(old, !!composer.filled),
    fill: (from) => rgba?.fillAll(from),
    uploads: (levels, x, y) =>
      blocks?.uploads(levels, x, y) ?? [{ pixels: levels[0].width * levels[0].height,
        run: () => rgba!.upload(levels as ImageBitmap[], x, y) }],
    placeOf: (fragment) =>
      [(fragment % columns) * fragmentWidthPx, Math.floor(fragment / columns) * fragmentHeightPx],
    updateMips: () => storage.updateMips(),
    read: () => storage.read(),
    dispose: () => storage.dispose(),
  };
  return composer;
}
