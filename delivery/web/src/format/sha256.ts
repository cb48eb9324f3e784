import { FormatError } from './errors';

/** Bytes as lower-case hexadecimal digits. */
export function toHex(bytes: Uint8Array): string {
  let text = '';
  for (const byte of bytes) text += byte.toString(16).padStart(2, '0');
  return text;
}

/** Whether two byte strings are equal over the length of the shorter one. */
export function samePrefix(a: Uint8Array, b: Uint8Array): boolean {
  const n = Math.min(a.length, b.length);
  for (let i = 0; i < n; ++i) if (a[i] !== b[i]) return false;
  return true;
}

/** Pieces as one; a single piece is that piece itself, not a copy. */
export function concat(pieces: readonly Uint8Array[]): Uint8Array {
  if (pieces.length === 1) return pieces[0];
  const whole = new Uint8Array(pieces.reduce((bytes, piece) => bytes + piece.length, 0));
  let at = 0;
  for (const piece of pieces) {
    whole.set(piece, at);
    at += piece.length;
  }
  return whole;
}

/** SHA-256 of some bytes, by WebCrypto where there is one. */
export async function sha256(bytes: Uint8Array): Promise<Uint8Array> {
  const subtle = globalThis.crypto?.subtle;
  if (!subtle) return (await import('./sha256_js')).sha256Js(bytes);
  return new Uint8Array(await subtle.digest('SHA-256', bytes as BufferSource));
}

/** FormatError by a rule where bytes have another SHA-256; a shorter digest holds its first bytes. */
export async function requireDigest(bytes: Uint8Array, digest: Uint8Array, file: string, place: string,
    rule = 'I08'): Promise<void> {
  const [wanted, found] = [digest, await sha256(bytes)].map((d) => toHex(d.subarray(0, digest.length)));
  if (found !== wanted) throw new FormatError(file, place, `SHA-256 ${wanted}`, found, rule);
}
