import { describe, expect, it } from 'vitest';
import { imageSize } from '../../src/format/image_size';
import { PackageReader } from '../../src/reader';
import { container } from '../support/scan';

describe('pictures', () => {
  it('say how large they are before they are decoded', async () => {
    const reader = await PackageReader.openBytes(container, 'golden');
    const [info] = await reader.textures();
    for (const f of (await reader.planeTables(0)).order.slice(0, 8)) {
      const [w, h] = imageSize(await reader.completeFragment(0, 0, f));
      expect(w > 0 && w <= info.fragmentWidthPx && h > 0 && h <= info.fragmentHeightPx).toBe(true);
    }
    const riff = (kind: string, at: number, data: number[]): Uint8Array => {
      const b = new Uint8Array(40);
      b.set(new TextEncoder().encode(`RIFF    WEBP${kind}`));
      b.set(data, at);
      return b;
    };
    expect(imageSize(riff('VP8 ', 26, [0x80, 0, 0x40, 1]))).toEqual([128, 320]);
    expect(imageSize(riff('VP8L', 20, [0x2f, 0x7f, 0xc0, 0x4f, 0]))).toEqual([128, 320]);
    expect(imageSize(riff('VP8X', 24, [0x7f, 0, 0, 0x3f, 1, 0]))).toEqual([128, 320]);
    const png = (name: string): Uint8Array => Uint8Array.from(
      [0x89, ...new TextEncoder().encode(`PNG\r\n\x1a\n\0\0\0\r${name}`), 0, 0, 1, 64, 0, 1, 0, 2, 8, 6]);
    expect(imageSize(png('IHDR'))).toEqual([320, 65538]);
    expect(imageSize(png('tEXt'))).toEqual([0, 0]); // no decoder takes what does not begin with it
    for (let n = 0; n < 20; ++n) expect(Math.min(...imageSize(png('IHDR').subarray(0, n)))).toBe(0);
    // Markers without a length: decoders find another frame behind them than readers who read a length.
    const frame = [0xff, 0xc0, 0, 17, 8, 0, 16, 0, 16, 3];
    expect(imageSize(Uint8Array.from([0xff, 0xd8, ...frame]))).toEqual([16, 16]);
    for (const marker of [0x01, 0xd0, 0xd7, 0xd8, 0xd9])
      expect(imageSize(Uint8Array.from([0xff, 0xd8, 0xff, marker, 0, 4, 0, 0, ...frame]))).toEqual([0, 0]);
    expect(imageSize(Uint8Array.from([0xff, 0xd8, 0xff, 0xe0, 0, 1, 0, ...frame]))).toEqual([0, 0]);
    for (const none of [[], [0xff], [0xff, 0xd8], [0xff, 0xd8, 0xff, 0xe0, 0, 0], [1, 2, 3]])
      expect(imageSize(Uint8Array.from(none))).toEqual([0, 0]);
  });
});
