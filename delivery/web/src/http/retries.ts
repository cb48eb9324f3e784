import { throwIfAborted } from '../format/errors';
import type { HttpClient } from './client';
import { sleepS } from './clock';
import type { Answer } from './requests';

/** Whether asking again may help. */
function mayRetry({ status, complete, tooLong }: Answer): boolean {
  if (status === 200 || status === 206) return !complete && !tooLong;
  return status === 0 || status === 408 || status === 429 || status >= 500;
}

/** Waits longer from try to try; gives false when there have been enough, or the answer says that another would be no better. */
export function retriesOf({ options }: HttpClient, signal?: AbortSignal): (a: Answer) => Promise<boolean> {
  let [left, delayS] = [options.retries, options.retryDelayS];
  return async (a) => {
    if (!mayRetry(a) || left-- <= 0) return false;
    await sleepS(delayS, signal);
    throwIfAborted(signal);
    delayS *= 2;
    return true;
  };
}
