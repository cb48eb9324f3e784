import { describe, expect, it } from 'vitest';
import { toBlocks } from '../src/blocks';
import { type BlockFormat, blockBytes, blockFormats } from '../src/blocks/formats';
import * as decoders from './support/block_decoders';

type Decoder = (block: Uint8Array) => number[][];
const decode: Record<BlockFormat, Decoder> = {
  bc1: decoders.decodeBc1, 'bc3-normal': decoders.decodeBc3Normal, bc5: decoders.decodeBc5,
  bc7: decoders.decodeBc7, etc2: decoders.decodeEtc2,
  astc: decoders.decodeAstc, 'astc-normal': decoders.decodeAstcNormal,
};
const channelsOf = (format: BlockFormat): number => (/normal|bc5/.test(format) ? 2 : 3);

/** Two channels hold normals: what they should hold of a colour. */
const wantedOf = (format: BlockFormat, colour: number[]): number[] => {
  if (channelsOf(format) === 3) return colour;
  const n = colour.map((v, c) => (c === 2 ? Math.max(0, v - 127.5) : v - 127.5));
  const length = Math.hypot(...n);
  return n.slice(0, 2).map((v) => 127.5 + (127.5 * v) / Math.max(1, length));
};
const picture = (width: number, height: number, at: (x: number, y: number) => number[]): Uint8Array =>
  Uint8Array.from({ length: 4 * width * height }, (_, i) => {
    const texel = i >> 2;
    return i % 4 === 3 ? 255
      : Math.min(255, Math.max(0, Math.round(at(texel % width, Math.floor(texel / width))[i % 4])));
  });
/** The picture that blocks hold. */
function unpack(format: BlockFormat, data: Uint8Array, width: number, height: number): number[][] {
  const columns = Math.ceil(width / 4);
  expect(data.length).toBe(columns * Math.ceil(height / 4) * blockBytes(format));
  const blocks = Array.from({ length: data.length / blockBytes(format) },
    (_, b) => decode[format](data.subarray(b * blockBytes(format), (b + 1) * blockBytes(format))));
  return Array.from({ length: width * height }, (_, i) => {
    const [x, y] = [i % width, Math.floor(i / width)];
    return blocks[(y >> 2) * columns + (x >> 2)][(y & 3) * 4 + (x & 3)];
  });
}
async function blocksOf(format: BlockFormat, pixels: Uint8Array, width: number, height: number, own = 1) {
  return toBlocks({ pixels, width, height }, { url: '', format, own, size: [width, height] });
}
/** dB. */
async function psnr(format: BlockFormat, pixels: Uint8Array, width: number, height: number): Promise<number> {
  const [{ data }] = await blocksOf(format, pixels, width, height);
  const shown = unpack(format, data, width, height);
  const n = channelsOf(format);
  const sum = shown.reduce((s, texel, i) => {
    const wanted = wantedOf(format, [...pixels.subarray(4 * i, 4 * i + 3)]);
    return s + wanted.reduce((e, v, c) => e + (v - texel[c]) ** 2, 0);
  }, 0);
  return 10 * Math.log10((255 ** 2 * n * shown.length) / Math.max(sum, 1e-9));
}

// Smooth shades of several colours, a fine pattern, and an edge: what scans show.
const scan = picture(64, 64, (x, y) => {
  const shade = 120 + 60 * Math.sin(x / 9) * Math.cos(y / 7) + 12 * Math.sin(2.1 * x + 1.3 * y);
  return x + y > 90 ? [shade * 0.4 + 20, shade * 0.7, shade] : [shade, shade * 0.8 + 10, shade * 0.6];
});
const smooth = picture(64, 64, (x, y) => [40 + 2 * x, 200 - x - y, 90 + y]);

describe('blocks', () => {
  // Some dB below what there was when this was written.
  const least: Record<BlockFormat, [scan: number, smooth: number]> = {
    bc1: [31, 39], 'bc3-normal': [33, 42], bc5: [36, 46], bc7: [33, 47], etc2: [30, 42], astc: [33, 47],
    'astc-normal': [30, 42],
  };
  it.each(blockFormats)('%s comes close to the picture', async (format) => {
    const got = [await psnr(format, scan, 64, 64), await psnr(format, smooth, 64, 64)];
    expect(got[0], 'scan').toBeGreaterThan(least[format][0]);
    expect(got[1], 'smooth').toBeGreaterThan(least[format][1]);
  });
  it.each(blockFormats)('%s keeps single colours', async (format) => {
    for (const colour of [[0, 0, 0], [255, 255, 255], [128, 128, 255], [17, 93, 201], [254, 1, 127]]) {
      const shown = unpack(format, (await blocksOf(format, picture(4, 4, () => colour), 4, 4))[0].data, 4, 4);
      const most = format === 'etc2' || format === 'bc1' ? 3 : format === 'bc3-normal' ? 2 : 1;
      const wanted = wantedOf(format, colour);
      for (const texel of shown)
        wanted.forEach((v, c) => expect(Math.abs(texel[c] - v), `${colour}`).toBeLessThanOrEqual(most));
    }
  });
  it.each(blockFormats)('%s of noise stays within its modes, and near', async (format) => {
    let seed = 1;
    const random = (): number => (seed = (seed * 1103515245 + 12345) % 2 ** 31) / 2 ** 31;
    expect(await psnr(format, picture(64, 64, () => [255 * random(), 255 * random(), 255 * random()]), 64,
      64)).toBeGreaterThan(9);
  });
  it.each([[1, 1], [5, 3], [18, 7]])('a picture of %i x %i px has whole blocks, filled by its border',
      async (width, height) => {
    const part = picture(width, height, (x, y) => [40 + 3 * x, 90 + 5 * y, 120]);
    for (const format of blockFormats)
      expect(await psnr(format, part, width, height), format).toBeGreaterThan(34);
  });
  it('levels are means of four texels; the one behind the blocks comes as RGBA', async () => {
    const levels = await blocksOf('bc7', scan, 64, 64, 2);
    expect(levels.map(({ width, height, data }) => [width, height, data.length]))
      .toEqual([[64, 64, 4096], [32, 32, 1024], [16, 16, 1024]]);
    const mean = (x: number, y: number): number => {
      let sum = 0;
      for (let i = 0; i < 16; ++i) sum += scan[4 * (64 * (4 * y + (i >> 2)) + 4 * x + (i & 3))];
      return sum / 16;
    };
    for (const [x, y] of [[0, 0], [7, 3], [15, 15]])
      expect(Math.abs(levels[2].data[4 * (16 * y + x)] - mean(x, y))).toBeLessThanOrEqual(1);
  });
  it('all levels of a whole picture end with one texel', async () => {
    const levels = await blocksOf('bc7', picture(8, 3, () => [9, 9, 9]), 8, 3, Infinity);
    expect(levels.map(({ width, height }) => [width, height])).toEqual([[8, 3], [4, 1], [2, 1], [1, 1]]);
    expect(levels.every(({ data }) => Math.abs(decode.bc7(data)[0][0] - 9) <= 1)).toBe(true);
  });
  it('what lies beyond the size is left out, and larger pictures find memory', async () => {
    const [{ width, height }] = await toBlocks({ pixels: picture(1024, 512, () => [1, 2, 3]), width: 1024,
      height: 512 }, { url: '', format: 'bc1', own: 1, size: [1024, 512] });
    expect([width, height]).toEqual([1024, 512]);
  });
});
