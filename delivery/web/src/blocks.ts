import wasm from 'encoder.wasm';
import { type BlockLevel, type BlockRequest, type Pixels, blockBytes, blockFormats } from './blocks/formats';

// What workers fetch where textures become blocks of 4 x 4 texels: encoder/ as WASM, and its use.

interface Encoder {
  memory: WebAssembly.Memory;
  __heap_base: WebAssembly.Global;
  encode(format: number, blockBytes: number, pixels: number, width: number, height: number,
    out: number): void;
  halve(pixels: number, width: number, height: number): void;
}
let encoder: Promise<Encoder> | undefined;

async function start(): Promise<Encoder> {
  const bytes = Uint8Array.from(atob(wasm), (c) => c.charCodeAt(0));
  return (await WebAssembly.instantiate(bytes)).instance.exports as unknown as Encoder;
}
function pixelsOf(picture: ImageBitmap, [width, height]: [number, number]): Uint8ClampedArray {
  const context =
    new OffscreenCanvas(width, height).getContext('2d', { alpha: false, willReadFrequently: true })!;
  context.drawImage(picture, 0, 0);
  return context.getImageData(0, 0, width, height).data;
}
const pageBytes = 65536;

/** A picture and its halves as blocks; the picture is closed. */
export async function toBlocks(from: ImageBitmap | Pixels,
    { format, own, size: [mostWidth, mostHeight] }: BlockRequest): Promise<BlockLevel[]> {
  let [width, height] = [Math.min(from.width, mostWidth), Math.min(from.height, mostHeight)];
  const { memory, __heap_base: base, encode, halve } = await (encoder ??= start());
  const pixels = 'pixels' in from ? from.pixels : pixelsOf(from, [width, height]);
  if ('close' in from) from.close();
  const bytesOf = (): number => Math.ceil(width / 4) * Math.ceil(height / 4) * blockBytes(format);
  const at = (base.value + 15) & ~15;
  const out = at + 4 * width * height;
  const lacking = out + bytesOf() - memory.buffer.byteLength;
  if (lacking > 0) memory.grow(Math.ceil(lacking / pageBytes));
  const heap = new Uint8Array(memory.buffer);
  heap.set(pixels, at);
  const levels: BlockLevel[] = [];
  for (let level = 0; ; ++level) {
    const blocks = level < own;
    if (blocks) encode(blockFormats.indexOf(format), blockBytes(format), at, width, height, out);
    levels.push({ width, height,
      data: blocks ? heap.slice(out, out + bytesOf()) : heap.slice(at, at + 4 * width * height) });
    // A piece that is narrower than a texel of the next level has no part in it. Wholes end with a texel.
    const last = Number.isFinite(own) ? Math.min(width, height) < 2 : Math.max(width, height) < 2;
    if (!blocks || last) return levels;
    halve(at, width, height);
    [width, height] = [Math.max(1, width >> 1), Math.max(1, height >> 1)];
  }
}
