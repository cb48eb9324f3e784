import type { Annotation, AnnotationText } from '../format/annotations';

/** The text of a note in the first of these languages that the note has, else its first text. */
export function textFor({ texts }: Annotation, languages: readonly string[]): AnnotationText {
  const plain = (tag: string): string => tag.toLowerCase();
  for (const wanted of languages) {
    const same = texts.find(({ language }) => plain(language) === plain(wanted)) ??
      texts.find(({ language }) => plain(language).split('-')[0] === plain(wanted).split('-')[0]);
    if (same) return same;
  }
  return texts[0];
}

/** annotations.json for `texmesh compile --annotations`, in the coordinates of the package's meshes. */
export const annotationsFile = (annotations: readonly Annotation[]): string =>
  JSON.stringify({ frame: 'package', annotations }, undefined, 1);
