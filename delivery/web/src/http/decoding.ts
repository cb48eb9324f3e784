import { decodeHere, type DocumentDecoder, type Documents } from '../format/document_decoder';
import { FormatError, abortError, throwIfAborted } from '../format/errors';

/** Result of a function of format/documents. */
export type Decoded<K extends keyof Documents> = Awaited<ReturnType<Documents[K]>>;

/** Rejects after so many seconds, or when a signal says so; `clear` ends the waiting. */
function lateness(mostS: number, signal?: AbortSignal): { late: Promise<never>; clear(): void } {
  let clear = (): void => undefined;
  const late = new Promise<never>((_, fail) => {
    const cancel = (): void => fail(abortError());
    const timer = setTimeout(cancel, 1000 * mostS);
    signal?.addEventListener('abort', cancel);
    clear = () => {
      clearTimeout(timer);
      signal?.removeEventListener('abort', cancel);
    };
  });
  return { late, clear: () => clear() };
}

/**
 * A document as `decoder` decodes it; decoded on this thread where the decoder fails or does not answer in time: because there are no
 * workers, or because the workers belong to a load that has ended.
 */
export async function decodeWith<K extends keyof Documents>(
  decoder: DocumentDecoder,
  mostS: number,
  signal: AbortSignal | undefined,
  name: K,
  ...args: Parameters<Documents[K]>
): Promise<Decoded<K>> {
  throwIfAborted(signal);
  const { late, clear } = lateness(mostS, signal);
  try {
    const result = await Promise.race([decoder(name, ...args), late]);
    throwIfAborted(signal);
    return result;
  } catch (error) {
    if (error instanceof FormatError || signal?.aborted) throw error;
    return decodeHere(name, ...args);
  } finally {
    clear();
  }
}
