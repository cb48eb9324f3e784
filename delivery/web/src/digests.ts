import { samePrefix, toHex } from './bytes';
import { FormatError } from './errors';
import { sha256 } from './sha256';

/** Throws FormatError where bytes have another SHA-256, or its first bytes are others. */
export async function requireDigest(bytes: Uint8Array, digest: Uint8Array, file: string, place: string): Promise<void> {
  const found = await sha256(bytes);
  if (!samePrefix(found, digest)) throw new FormatError(file, place, `SHA-256 ${toHex(digest)}`, toHex(found.subarray(0, digest.length)));
}
