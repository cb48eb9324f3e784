/** The encoder as WASM, base64: build.mjs. */
declare module 'encoder.wasm' {
  const base64: string;
  export default base64;
}
