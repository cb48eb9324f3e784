import { aboutPath } from './entry_paths';
import { JsonAt, parseJson } from './json_fields';
import { maxAboutBytes } from './shared_numbers';

/** about.json: what the object is, whose it is, what its coordinates mean. Missing is not known. */
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

const texts = { title: 200, description: 10000, creator: 2000, attribution: 2000, licence: 2000,
  capture: 2000, licenceUrl: 2000, sourceUrl: 2000 };
const lists = { identifiers: ['scheme', 'value'], dates: ['event', 'text'] };

const webUrl = /^https?:\/\/(?!\/)[^\s"<>\\^`{|}\u0000-\u001f\u007f]+$/;

/** Whether a text is an absolute http or https URL: a link of anything else may run a script. */
export const isWebUrl = (text: string): boolean => webUrl.test(text);

/** about.json: strict about fields of this version; others stay as they are. FormatError names the place. */
export function readAbout(json: Uint8Array): About {
  const about = parseJson(json, aboutPath, maxAboutBytes).by('B01');
  const check = (within: JsonAt, name: string, read: (at: JsonAt) => unknown): void => {
    if (within.has(name)) read(within.at(name));
  };
  const text = (most: number, good = /[^]/) => (at: JsonAt): void => {
    if (!good.test(at.text(most)))
      at.fail(`a text like ${good.source}`, '', good === webUrl ? 'B02' : undefined);
  };
  for (const [name, most] of Object.entries(texts))
    check(about, name, text(most, /Url/.test(name) ? webUrl : undefined));
  for (const [name, [kind, value]] of Object.entries(lists))
    check(about, name,
      (list) => list.each(1, 32, (pair) => { text(100)(pair.at(kind)); text(500)(pair.at(value)); }));
  check(about, 'unit', (unit) => { text(50)(unit.at('name')); unit.at('metres').number(1e-12, 1e12); });
  check(about, 'upAxis', text(1, /[xyz]/));
  check(about, 'coordinateReference', (at) => {
    if (!at.has('epsg')) text(2000)(at.at('text'));
    check(at, 'text', text(2000));
    check(at, 'epsg', (code) => code.integer(1, 999999));
  });
  check(about, 'source', (source) => source.has(''));
  return about.value() as About;
}
