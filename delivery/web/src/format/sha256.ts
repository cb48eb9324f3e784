import { toHex } from './bytes';
import { FormatError } from './errors';

/** SHA-256 of some bytes, by WebCrypto where there is one. */
export async function sha256(bytes: Uint8Array): Promise<Uint8Array> {
  const subtle = globalThis.crypto?.subtle;
  if (!subtle) return (await import('./sha256_js')).sha256Js(bytes);
  return new Uint8Array(await subtle.digest('SHA-256', bytes as BufferSource));
}

/** Throws FormatError by a rule where bytes have another SHA-256; a shorter digest is held to the first bytes. */
export async function requireDigest(bytes: Uint8Array, digest: Uint8Array, file: string, place: string, rule = 'I08'): Promise<void> {
  const [wanted, found] = [digest, await sha256(bytes)].map((d) => toHex(d.subarray(0, digest.length)));
  if (found !== wanted) throw new FormatError(file, place, `SHA-256 ${wanted}`, found, rule);
}
