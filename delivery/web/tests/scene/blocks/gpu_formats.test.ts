import type { WebGLRenderer } from 'three';
import { describe, expect, it } from 'vitest';
import type { BlockFormat } from '../../../src/blocks/formats';
import { wayWithin } from '../../../src/decide/gpu_memory';
import type { TextureInfo } from '../../../src/format/textures';
import { blocksFor, bytesBy, formatsOf } from '../../../src/scene/blocks/gpu_formats';

const plane = (role: string, widthPx = 256, heightPx = 128): TextureInfo =>
  ({ role, widthPx, heightPx }) as TextureInfo;
const renderer = (...has: string[]): WebGLRenderer => ({ getContext: () => (
  { getExtension: (name: string) => (has.includes(name) ? {} : null) }) }) as unknown as WebGLRenderer;
const s3tc = ['WEBGL_compressed_texture_s3tc', 'WEBGL_compressed_texture_s3tc_srgb'];
const textures = [plane('base-colour'), plane('normal'), plane('alpha'), plane('data', 254),
  plane('colour', 32)];
const choose = (formats: ReadonlySet<BlockFormat>, any: boolean): (BlockFormat | undefined)[] =>
  textures.map((_, p) => blocksFor(textures, formats, any)(p));

describe('formats of a GPU', () => {
  it('are those whose extensions are all there', () => {
    expect([...formatsOf(renderer())]).toEqual([]);
    expect([...formatsOf(renderer(s3tc[0]))]).toEqual([]); // colours want sRGB
    expect([...formatsOf(renderer(...s3tc))]).toEqual(['bc1', 'bc3-normal']);
    expect([...formatsOf(renderer('EXT_texture_compression_bptc', 'EXT_texture_compression_rgtc',
      'WEBGL_compressed_texture_astc', 'WEBGL_compressed_texture_etc'))])
      .toEqual(['bc5', 'bc7', 'etc2', 'astc', 'astc-normal']);
  });
  it('suit roles and sizes', () => {
    expect(choose(new Set(['bc1', 'bc3-normal', 'bc5', 'bc7']), false))
      .toEqual(['bc7', 'bc5', 'bc7', undefined, undefined]);
    expect(choose(new Set(['astc', 'astc-normal', 'etc2']), false))
      .toEqual(['astc', 'astc-normal', 'astc', 'astc', undefined]);
    expect(choose(new Set(['bc1', 'bc3-normal']), false))
      .toEqual([undefined, 'bc3-normal', undefined, undefined, undefined]);
    expect(choose(new Set(['bc1', 'bc3-normal']), true))
      .toEqual(['bc1', 'bc3-normal', undefined, undefined, undefined]);
    expect(choose(new Set(['etc2']), true)).toEqual(['etc2', undefined, undefined, 'etc2', undefined]);
  });
  it('say how many bytes planes take, and memory takes the first way that fits', () => {
    const square = [plane('colour', 64, 64)];
    const texels = (4 ** 7 - 1) / 3;
    const [rgba, blocks] = [bytesBy(square, () => undefined)(0), bytesBy(square, () => 'bc7')(0)];
    expect(rgba).toBe(4 * texels);
    expect(blocks).toBe(16 * (256 + 64 + 16 + 4 + 1 + 1 + 1));
    expect(bytesBy(square, () => 'etc2')(0)).toBe(blocks / 2);
    const ways = [() => rgba, () => blocks];
    const all = [{ base: 0, plane: 0 }, { base: 1, plane: 1 }];
    expect([2 * rgba, 2 * rgba - 1, 2 * blocks, 0].map((most) => wayWithin(all, most, ways)))
      .toEqual([0, 1, 1, 1]);
  });
});
