import { LinearFilter, LinearMipmapLinearFilter, NearestFilter, NearestMipmapNearestFilter, Texture,
  type WebGLRenderer } from 'three';
import { expect, it } from 'vitest';
import type { TextureInfo } from '../../src/format/textures';
import { ownLevels, PlaneStorage } from '../../src/scene/plane_storage';

/**
 * Takes every call; one storage for each minification filter, as three.js has it. `written`: by filter the
 * levels of uploads and of blits.
 */
function fakeRenderer(): { renderer: WebGLRenderer; written: Map<number, Set<number>> } {
  const written = new Map<number, Set<number>>();
  const storages = new Map<number, { filter: number }>();
  let bound = 0;
  const write = (filter: number, level: number): unknown =>
    written.set(filter, (written.get(filter) ?? new Set()).add(level));
  const calls: Record<string, (...args: never[]) => unknown> = {
    texSubImage2D: (_: unknown, level: number) => write(bound, level),
    framebufferTexture2D: (target: string, _: unknown, __: unknown, storage: {
      filter: number }, level: number) =>
      target === 'DRAW_FRAMEBUFFER' && write(storage.filter, level),
    getParameter: () => [true, true, true, true],
  };
  const gl = new Proxy({},
    { get: (_, name: string) => (name === name.toUpperCase() ? name : (calls[name] ?? (() => null))) });
  const of = ({ minFilter: filter }: Texture): unknown => {
    if (!storages.has(filter)) storages.set(filter, { filter });
    return { __webglTexture: storages.get(filter) };
  };
  const bindTexture = (_: unknown, storage: { filter: number }): unknown => (bound = storage.filter);
  const renderer = { getContext: () => gl, initTexture: of, properties: { get: of }, state: { bindTexture } };
  return { renderer: renderer as unknown as WebGLRenderer, written };
}

const info = { widthPx: 256, heightPx: 64, colourSpace: 'srgb' } as TextureInfo;
const levels =
  Array.from({ length: ownLevels }, (_, i) => ({ width: 64 >> i, height: 64 >> i }) as ImageBitmap);
const like = (minFilter: number, magFilter: number): Texture =>
  Object.assign(new Texture(), { minFilter, magFilter });

it('a view has the filters of the texture that it stands for', () => {
  const storage = new PlaneStorage(fakeRenderer().renderer, info);
  const view = storage.view(like(NearestMipmapNearestFilter, NearestFilter), false);
  expect([view.minFilter, view.magFilter]).toEqual([NearestMipmapNearestFilter, NearestFilter]);
});

it('every storage gets the levels that its filter has', () => {
  const { renderer, written } = fakeRenderer();
  const storage = new PlaneStorage(renderer, info);
  storage.view(like(LinearFilter, LinearFilter), false);
  storage.view(like(LinearMipmapLinearFilter, LinearFilter), true);
  storage.view(like(NearestFilter, NearestFilter), true);
  storage.upload(levels, 0, 0);
  storage.updateMips();
  expect([...written.get(LinearFilter)!]).toEqual([0]);
  expect([...written.get(NearestFilter)!]).toEqual([0]);
  expect([...written.get(LinearMipmapLinearFilter)!].sort()).toEqual([0, 1, 2, 3, 4, 5, 6, 7, 8]);
});
