// Notes at points of the object, and measuring. Apart from the library: nothing of an ordinary load needs it.

import { type Annotation, readAnnotations } from './format/annotations';
import type { PackageDocuments } from './http/package_documents';

export * from './format/annotations';

/** The notes of a package; none where it has none. Loads that do not ask for them never fetch them. */
export async function readNotes(documents: PackageDocuments, signal?: AbortSignal): Promise<Annotation[]> {
  const { annotations } = documents.manifest;
  if (!annotations) return [];
  return readAnnotations(await documents.readChecked(annotations, { kind: 'other', signal }));
}

export * from './notes/editor';
export * from './notes/layer';
export * from './notes/measure';
export * from './notes/measuring';
export * from './notes/pick';
export * from './notes/texts';
export * from './notes/words';
