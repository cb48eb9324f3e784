import { aboutPath } from './entry_paths';
import { JsonAt, parseJson } from './json_fields';

/** about.json (format/SPEC.md): what the object is, whose it is, what its coordinates mean. Whatever is missing is not known. */
export interface About {
  title?: string;
  description?: string;
  /** Several names are separated by "; ". */
  creator?: string;
  /** The line to show beside the object. */
  attribution?: string;
  /** An SPDX licence expression, a URL, or what else the source said. */
  licence?: string;
  /** http(s) URL where the licence can be read. */
  licenceUrl?: string;
  /** http(s) URL of the object's page or the source file. */
  sourceUrl?: string;
  identifiers?: { scheme: string; value: string }[];
  /** How the object was captured. */
  capture?: string;
  /** Dates as the source gives them. */
  dates?: { event: string; text: string }[];
  /** One object unit, in metres. */
  unit?: { name: string; metres: number };
  /** The axis of the package's coordinates that points up. */
  upAxis?: 'x' | 'y' | 'z';
  coordinateReference?: { text?: string; epsg?: number };
  /** What the source file said, verbatim: any JSON of a stranger. */
  source?: Record<string, unknown>;
  /** What the publisher added: any JSON. */
  extras?: unknown;
}

const mostBytes = 262144;
const texts = { title: 200, description: 10000, creator: 2000, attribution: 2000, licence: 2000, capture: 2000 } as const;
const urls = ['licenceUrl', 'sourceUrl'] as const;

/** Whether a text is an absolute http or https URL: a link of anything else may run a script. */
export const isWebUrl = (text: string): boolean => /^https?:\/\/[^/\s"<>\\^`{|}\u0000-\u0020\u007f][^\s"<>\\^`{|}\u0000-\u0020\u007f]*$/.test(text);

function readText(at: JsonAt, most: number): string {
  const text = at.text(most);
  if (text === '') at.fail('a text', 'an empty one');
  return text;
}

function readUrl(at: JsonAt): string {
  const url = readText(at, 2000);
  if (!isWebUrl(url)) at.fail('an http or https URL', 'another text');
  return url;
}

function readReference(at: JsonAt): About['coordinateReference'] {
  if (!at.has('text') && !at.has('epsg')) at.fail('text or epsg', 'neither');
  return {
    ...(at.has('text') ? { text: readText(at.at('text'), 2000) } : {}),
    ...(at.has('epsg') ? { epsg: at.at('epsg').integer(1, 999999) } : {}),
  };
}

function readAxis(at: JsonAt): About['upAxis'] {
  const axis = at.text(1);
  if (axis !== 'x' && axis !== 'y' && axis !== 'z') at.fail('x, y or z', axis);
  return axis;
}

/** Reads about.json: strict about fields of this version, ignores unknown ones. FormatError names the place in the document. */
export function readAbout(json: Uint8Array): About {
  const at = parseJson(json, aboutPath, mostBytes);
  const about: About = {};
  for (const [name, most] of Object.entries(texts) as [keyof typeof texts, number][])
    if (at.has(name)) about[name] = readText(at.at(name), most);
  for (const name of urls) if (at.has(name)) about[name] = readUrl(at.at(name));
  const pairs = <A extends string, B extends string>(list: string, a: A, b: B): Record<A | B, string>[] =>
    at.at(list).each(1, 32, (pair) => ({ [a]: readText(pair.at(a), 100), [b]: readText(pair.at(b), 500) }) as Record<A | B, string>);
  if (at.has('identifiers')) about.identifiers = pairs('identifiers', 'scheme', 'value');
  if (at.has('dates')) about.dates = pairs('dates', 'event', 'text');
  if (at.has('unit')) about.unit = { name: readText(at.at('unit').at('name'), 50), metres: at.at('unit').at('metres').number(1e-12, 1e12) };
  if (at.has('upAxis')) about.upAxis = readAxis(at.at('upAxis'));
  if (at.has('coordinateReference')) about.coordinateReference = readReference(at.at('coordinateReference'));
  if (at.has('source')) about.source = at.at('source').object();
  if (at.has('extras')) about.extras = at.at('extras').any();
  return about;
}
