import { isWebUrl } from './about';
import { annotationsPath } from './entry_paths';
import { JsonAt, parseJson } from './json_fields';

/** A point or direction: x, y, z. */
export type Point = [number, number, number];

/** Limits of annotations.json; lengths in bytes of UTF-8. */
export const annotationLimits = { bytes: 4_000_000, notes: 1000, languages: 32, images: 8, title: 200,
  text: 10_000, coordinate: 1e30 };

/** What a note says in one language. Plain text: nothing in it is markup. */
export interface AnnotationText {
  /** BCP 47; und where nobody has said. */
  language: string;
  title: string;
  text?: string;
}

/** A note at a point of the object, in the coordinates of the package's meshes. */
export interface Annotation {
  position: Point;
  /** Where it looks to; unit. */
  normal?: Point;
  /** One a language; the first where none suits. */
  texts: AnnotationText[];
  camera?: { position: Point; target: Point; fovDegrees: number };
  images?: { url: string }[];
}

/** Whether a text has the form of a BCP 47 tag. */
export const isLanguageTag = (text: string): boolean =>
  text.length <= 35 && /^[a-z]{1,8}(-[a-z0-9]{1,8})*$/i.test(text);

function readVector(at: JsonAt, most: number): Point {
  return at.each(3, 3, (x) => x.number(-most, most)) as Point;
}

function readText(at: JsonAt): AnnotationText {
  const language = at.at('language').by('N02').text(35);
  if (!isLanguageTag(language)) at.at('language').fail('a BCP 47 tag', language, 'N02');
  return {
    language,
    title: at.at('title').text(annotationLimits.title),
    ...(at.has('text') ? { text: at.at('text').text(annotationLimits.text) } : {}),
  };
}

function readNote(at: JsonAt): Annotation {
  const most = annotationLimits.coordinate;
  const note: Annotation = {
    position: readVector(at.at('position'), most),
    texts: at.at('texts').each(1, annotationLimits.languages, readText),
  };
  if (new Set(note.texts.map(({ language }) => language)).size < note.texts.length)
    at.at('texts').fail('one text a language', '', 'N02');
  if (at.has('normal')) {
    note.normal = readVector(at.at('normal'), 2);
    const length = Math.sqrt(note.normal.reduce((sum, x) => sum + x * x, 0));
    if (Math.abs(length - 1) > 1e-3) at.at('normal').fail('a vector of length 1', length);
  }
  if (at.has('camera')) {
    const camera = at.at('camera');
    note.camera = { position: readVector(camera.at('position'), most),
      target: readVector(camera.at('target'), most), fovDegrees: camera.at('fovDegrees').number(1, 170) };
  }
  if (at.has('images'))
    note.images = at.at('images').each(1, annotationLimits.images, (image) => {
      const url = image.at('url').text(2000);
      if (!isWebUrl(url)) image.at('url').fail('an http or https URL', url, 'N03');
      return { url };
    });
  return note;
}

/** annotations.json of a package: strict about fields of this version. FormatError names the place. */
export function readAnnotations(json: Uint8Array): Annotation[] {
  const at = parseJson(json, annotationsPath, annotationLimits.bytes).by('N01');
  const frame = at.at('frame').text(100);
  if (frame !== 'package') at.at('frame').fail('package', frame, frame === 'source' ? 'N04' : 'N01');
  return at.at('annotations').each(1, annotationLimits.notes, readNote);
}
