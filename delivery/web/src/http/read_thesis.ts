import { type ThesisTables, parseThesis } from '../format/thesis_tables';
import type { PackageDocuments } from './package_documents';

/**
 * thesis.bin of a package, read anew with every call; undefined where the package has none. Loads that do not
 * ask for it never fetch it.
 */
export async function readThesis(
  documents: PackageDocuments, signal?: AbortSignal,
): Promise<ThesisTables | undefined> {
  const { manifest } = documents;
  if (!manifest.thesis) return undefined;
  const bytes = await documents.readChecked(manifest.thesis, { kind: 'tables', signal });
  return parseThesis(bytes, manifest, await documents.textures(signal));
}
