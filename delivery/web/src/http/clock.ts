/** Seconds of performance.now(). */
export const nowS = (): number => performance.now() / 1000;
/** Resolves after so many seconds, or when a signal says so. */
export const sleepS = (seconds: number, signal?: AbortSignal): Promise<void> =>
  new Promise((done) => {
    const end = (): void => {
      clearTimeout(timer);
      signal?.removeEventListener('abort', end);
      done();
    };
    const timer = setTimeout(end, seconds * 1000);
    signal?.addEventListener('abort', end);
  });
