import { type Annotation, readAnnotations } from '../format/annotations';
import type { PackageDocuments } from '../http/package_documents';

/** The notes of a package; none where it has none. Loads that do not ask for them never fetch them. */
export async function readNotes(documents: PackageDocuments, signal?: AbortSignal): Promise<Annotation[]> {
  const { annotations } = documents.manifest;
  if (!annotations) return [];
  return readAnnotations(await documents.readChecked(annotations, { kind: 'other', signal }));
}
