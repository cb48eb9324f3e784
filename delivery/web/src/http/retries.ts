import { throwIfAborted } from '../format/errors';
import type { HttpClient } from './client';
import { sleepS } from './clock';
import type { Answer } from './requests';

/** Whether asking again may give a better answer. */
function mayRetry({ status, complete, tooLong }: Answer): boolean {
  if (status === 200 || status === 206) return !complete && !tooLong;
  return status === 0 || status === 408 || status === 429 || status >= 500;
}

/** A function that waits before the next try, longer from try to try; false: enough tries, or another would be no better. */
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
