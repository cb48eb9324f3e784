import { FormatError, InputError } from '../format/errors';
import { FragmentFiles, readFragmentFiles } from '../format/fragment_files';
import { bootstrapBytes } from '../format/layout';
import type { HttpClient } from './client';
import { Mirrors } from './mirrors';
import { shownUrl } from './requests';
import type { OpenedStore, PackageStore } from './store';
import { TreeStore, getWhole } from './tree_store';
import { openBytes } from './whole_store';

// For servers that know no ranges, and for containers in memory; loaded with the first of them.

export { openBytes };

/** URL of the tree beside a container: https://host/a/NAME.texmesh -> https://host/a/NAME/ ; '' when the URL is not of that form. */
export function treeUrl(url: string): string {
  const m = /^([^?#]*)\.texmesh([?#].*)?$/.exec(url);
  return m ? `${m[1]}/${m[2] ?? ''}` : '';
}

async function opened(store: PackageStore, signal?: AbortSignal): Promise<OpenedStore> {
  return { store, manifest: await store.manifest(signal) };
}
const treesOf = (urls: readonly string[]): string[] => urls.map(treeUrl).filter((root) => root !== '');

/** Opens a tree by its own URL, or by the URL of the container beside the tree. */
export function openTree(urls: readonly string[], client: HttpClient, signal?: AbortSignal): Promise<OpenedStore> {
  const isTree = urls[0].replace(/[?#].*$/, '').endsWith('/');
  const roots = isTree ? urls : treesOf(urls);
  if (roots.length === 0)
    throw new InputError(shownUrl(urls[0]), '', 'a URL that ends in .texmesh or /, for mode files', 'another');
  return opened(new TreeStore(roots, client), signal);
}

/** Opens the tree beside a container that ranges were read of, whose manifest must have these bytes. */
export async function openSameTree(urls: readonly string[], client: HttpClient, manifest: Uint8Array, signal?: AbortSignal): Promise<PackageStore> {
  const roots = treesOf(urls);
  if (roots.length === 0) throw new InputError(shownUrl(urls[0]), '', 'an answer with status 206', 'status 200: ranges are no longer answered');
  const { store, manifest: got } = await opened(new TreeStore(roots, client), signal);
  if (got.length !== manifest.length || got.some((byte, i) => byte !== manifest[i]))
    throw new FormatError(store.name, 'manifest.json', 'the package that reading began with', 'another: it was replaced, open it anew');
  return store;
}

/** Opens the tree beside a container, or the whole container. */
export async function openWithoutRanges(urls: readonly string[], client: HttpClient, signal?: AbortSignal): Promise<OpenedStore> {
  const roots = treesOf(urls);
  if (roots.length > 0) {
    try {
      const found = await opened(new TreeStore(roots, client), signal);
      if (found.manifest[0] === 0x7b) return found; // a brace: no page of the server's own
    } catch (error) {
      if (!(error instanceof InputError)) throw error;
    }
  }
  return new Mirrors(urls, client).ask(bootstrapBytes, async (m, { othersLeft, ...asking }) => {
    const how = { kind: 'other', signal, maxBytes: client.options.maxWholeBytes, ...asking } as const;
    const bytes = await getWhole(client, m.url, how, othersLeft);
    return opened(openBytes(bytes, shownUrl(m.url)), signal);
  });
}

const fragmentFilesPath = 'fragments.json';

/** See PackageReader.fragmentFiles. */
export async function readFragmentList(store: PackageStore, signal?: AbortSignal): Promise<FragmentFiles | undefined> {
  // A tree without the list has packs.
  const bytes = await store.extraFile?.(fragmentFilesPath, 256 << 20, { kind: 'index', signal }).catch((error: unknown) => {
    if (!(error instanceof InputError)) throw error;
    return undefined;
  });
  return bytes && readFragmentFiles(bytes);
}
