import { isAbort } from '../format/errors';
import type { HttpClient } from './client';
import { RangeStore } from './range_store';
import type { OpenedStore, StoreMode } from './store';

/**
 * Finds out how the server can be read (SPEC.md, section 19): ranges of the container; the tree beside the container where the server
 * answers 200 to a range; the whole container where there is no tree. Where a server stops answering ranges, the tree, too.
 */
export async function openStore(
  url: string,
  mirrors: readonly string[],
  mode: StoreMode,
  client: HttpClient,
  signal?: AbortSignal,
): Promise<OpenedStore> {
  const urls = [url, ...mirrors.filter((m) => m !== url)];
  const files = () => import('./without_ranges');
  if (mode === 'files' || /^[^?#]*\/([?#]|$)/.test(url)) return (await files()).openTree(urls, client, signal);
  const openTree = async (manifest: Uint8Array, aborted?: AbortSignal) => (await files()).openSameTree(urls, client, manifest, aborted);
  const store = new RangeStore(urls, client, mode === 'range' ? undefined : openTree);
  try {
    return { store, manifest: await store.manifest(signal) };
  } catch (error) {
    const { noRanges } = store;
    // Whole files are better than nothing, whatever other mirrors answered.
    if (!noRanges || isAbort(error)) throw error;
    if (mode === 'range') throw noRanges;
    const { openWithoutRanges } = await files().catch(() => {
      throw noRanges;
    });
    return openWithoutRanges(urls, client, signal);
  }
}
