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
/** Gives the page a turn: resolves in a task of its own, where a timer would wait for 4 ms and more. */
export const nextTurn = (): Promise<void> =>
  new Promise((done) => {
    const { port1, port2 } = new MessageChannel();
    port1.onmessage = (): void => {
      port1.close();
      done();
    };
    port2.postMessage(0);
  });
