/** The functions of documents.ts. */
export type Documents = typeof import('./documents');
/** Decodes a document by the name of a function of documents.ts. */
export type DocumentDecoder = <K extends keyof Documents>(
  name: K,
  ...args: Parameters<Documents[K]>
) => Promise<Awaited<ReturnType<Documents[K]>>>;
/** Decodes documents on this thread. */
export const decodeHere = (async (name, ...args: unknown[]) =>
  ((await import('./documents'))[name] as (...of: unknown[]) => unknown)(...args)) as DocumentDecoder;
