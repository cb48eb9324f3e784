import { FormatError } from './errors';

/** The functions of documents.ts. */
export type Documents = typeof import('./documents');
/** Decodes a document by the name of a function of documents.ts. */
export type DocumentDecoder = <K extends keyof Documents>(
  name: K,
  ...args: Parameters<Documents[K]>
) => Promise<Awaited<ReturnType<Documents[K]>>>;
/** Decodes documents on this thread. './documents' may be the workers' file with error classes of its own. */
export const decodeHere = (async (name, ...args: unknown[]) => {
  const documents = await import('./documents');
  try {
    return await (documents[name] as (...of: unknown[]) => unknown)(...args);
  } catch (error) {
    const { name: kind, file, place, expected, found, rule } = error as FormatError;
    throw kind === 'FormatError' ? new FormatError(file, place, expected, found, rule) : error;
  }
}) as DocumentDecoder;
