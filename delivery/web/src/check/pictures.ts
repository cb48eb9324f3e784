import { imageSize } from '../format/image_size';
import { Cursor, requireRule } from './fields';

/** Tells width and height of a complete picture, or throws where it cannot be decoded. */
export type DecodePicture = (data: Uint8Array, mediaType: string) => Promise<{ width: number; height: number }>;

/** By the browser; undefined where there is none. */
export const decodeByBrowser: DecodePicture | undefined =
  typeof createImageBitmap === 'function'
    ? async (data, type) => {
        const bitmap = await createImageBitmap(new Blob([data as BlobPart], { type }));
        const size = { width: bitmap.width, height: bitmap.height };
        bitmap.close();
        return size;
      }
    : undefined;

/** The segments of a JPEG in front of its first scan, the last one of each marker. */
export function segmentsOf(data: Uint8Array, what: string): Map<number, Uint8Array> {
  const c = new Cursor(data, 'F08', what);
  const found = new Map<number, Uint8Array>();
  c.raw(2);
  while (data[c.at] === 0xff && data[c.at + 1] !== 0xda && data[c.at + 1] !== 0xd9) {
    const [, marker, high, low] = c.raw(4);
    found.set(marker, c.raw(Math.max(2, high * 256 + low) - 2));
  }
  return found;
}
/** Number of channels of a JPEG; 3 for WebP. */
function channelsOf(data: Uint8Array, what: string): number {
  if (data[0] !== 0xff) return 3;
  for (const [marker, segment] of segmentsOf(data, what)) if (marker >= 0xc0 && marker <= 0xc2) return segment[5];
  return 0;
}

/** Whether a file has its end, as far as that can be told without decoding: a JPEG's EOI, a PNG's last chunk, the size of a WebP. */
function isWhole(data: Uint8Array): boolean {
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  const isAt = (at: number, ...bytes: number[]): boolean => bytes.every((byte, k) => data[at + k] === byte);
  if (isAt(0, 0xff, 0xd8)) {
    let at = data.length - 2;
    while (at > 1 && !isAt(at, 0xff, 0xd9)) --at;
    return at > 1;
  }
  if (isAt(0, 0x52, 0x49, 0x46, 0x46)) return data.length >= 8 && view.getUint32(4, true) + 8 <= data.length;
  for (let at = 8; at + 12 <= data.length; at += 12 + view.getUint32(at)) if (isAt(at + 4, 0x49, 0x45, 0x4e, 0x44)) return true;
  return false;
}
/** A source image has the size of its plane. Nothing of it is decoded: browsers do not read all that may be kept. */
export function requireSource(data: Uint8Array, isTiff: boolean, wanted: Wanted, what: string): void {
  const [width, height] = isTiff ? tiffSize(data) : imageSize(data);
  requireRule(width === wanted.width && height === wanted.height, 'O02', what, 'the size of its plane');
  requireRule(isTiff || isWhole(data), 'O02', what, 'the end of its image');
}

interface Wanted {
  width: number;
  height: number;
  /** Undefined: any. */
  channels?: number;
}
/** A JPEG or a WebP file has this size, and can be decoded where `decode` is there. */
export async function requirePicture(data: Uint8Array, wanted: Wanted, rule: string, what: string, decode?: DecodePicture): Promise<void> {
  const isSize = (width: number, height: number): boolean => width === wanted.width && height === wanted.height;
  const size = imageSize(data);
  const isWanted = isSize(...size) && (!wanted.channels || channelsOf(data, what) === wanted.channels);
  requireRule(isWanted, rule, what, `a picture of ${wanted.width} x ${wanted.height} px, instead of ${size.join(' x ')}`);
  const decoded = await decode?.(data, data[0] === 0xff ? 'image/jpeg' : 'image/webp').catch(() => ({ width: 0, height: 0 }));
  requireRule(!decoded || isSize(decoded.width, decoded.height), rule, what, 'a picture that can be decoded');
}

/** Width and height that the first directory of a TIFF file says, or 0, 0. */
function tiffSize(data: Uint8Array): [number, number] {
  const isLittle = data[0] === 0x49;
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  const u16 = (at: number): number => (at + 2 <= data.length ? view.getUint16(at, isLittle) : 0);
  const u32 = (at: number): number => (at + 4 <= data.length ? view.getUint32(at, isLittle) : 0);
  if ((!isLittle && data[0] !== 0x4d) || u16(2) !== 42) return [0, 0];
  const found = new Map<number, number>();
  for (let left = u16(u32(4)), at = u32(4) + 2; left > 0; --left, at += 12) found.set(u16(at), u16(at + 2) === 3 ? u16(at + 8) : u32(at + 8));
  return [found.get(256) ?? 0, found.get(257) ?? 0];
}
