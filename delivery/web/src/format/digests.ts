import { toHex } from './bytes';
import { FormatError } from './errors';
import { sha256 } from './sha256';

/** Throws FormatError where bytes have another SHA-256, or its first bytes are others. */
export async function requireDigest(bytes: Uint8Array, digest: Uint8Array, file: string, place: string): Promise<void> {
  const [wanted, found] = [digest, await sha256(bytes)].map((d) => toHex(d.subarray(0, digest.length)));
  if (found !== wanted) throw new FormatError(file, place, `SHA-256 ${wanted}`, found);
}
