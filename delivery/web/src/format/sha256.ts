/** SHA-256 of some bytes, by WebCrypto where there is one. */
export async function sha256(bytes: Uint8Array): Promise<Uint8Array> {
  const subtle = globalThis.crypto?.subtle;
  if (!subtle) return (await import('./sha256_js')).sha256Js(bytes);
  return new Uint8Array(await subtle.digest('SHA-256', bytes as BufferSource));
}
