// What the element says to people, and what its attributes mean.

import { InputError, TexmeshError } from '../format/errors';
import { type Orbit, defaultOrbit } from '../page/framing';

/** Bytes as people read them. */
export function bytesInWords(n: number): string {
  if (!Number.isFinite(n) || n < 0) return '';
  const [unit, name] = n < 999.5e3 ? [1e3, 'kB'] : [1e6, 'MB'];
  const value = n / unit;
  return `${value < 9.95 ? value.toFixed(1).replace('.0', '') : value.toFixed(0)} ${name}`;
}
/** Seconds as people read them. */
export const secondsInWords = (s: number): string =>
  (s < 1 ? 'under a second' : s < 9.5 ? `about ${Math.round(s)} s` : `about ${Math.round(s / 5) * 5} s`);

/** What a click costs: bytes of the first picture and of all (0: unknown), bytes per second (0: unknown). */
export function offerInWords(firstBytes: number, allBytes: number, linkBytesS: number): string {
  const wait = linkBytesS > 0 ? `, ${secondsInWords(firstBytes / linkBytesS)}` : '';
  const more = allBytes > firstBytes ? `; up to ${bytesInWords(allBytes)} in all` : '';
  return `${bytesInWords(firstBytes)}${wait}${more}`;
}

/** An angle, "30deg" or ".5rad", in degrees; `otherwise` where it cannot be read. */
export function degreesOf(said: string | null | undefined, otherwise: number): number {
  const found = /^(-?(?:\d+\.?\d*|\.\d+))(deg|rad)$/.exec(said?.trim() ?? '');
  return found ? Number(found[1]) * (found[2] === 'rad' ? 180 / Math.PI : 1) : otherwise;
}
/** "28deg 72deg 105%" or parts of it: angles round and from the vertical axis, distance. Else the default. */
export function orbitOf(text: string | null): Orbit {
  const [theta, phi, distance] = (text ?? '').trim().split(/\s+/).filter(Boolean);
  const share = /^(\d+(?:\.\d+)?)%$/.exec(distance ?? '');
  return {
    thetaDegrees: degreesOf(theta, defaultOrbit.thetaDegrees),
    phiDegrees: Math.min(179, Math.max(1, degreesOf(phi, defaultOrbit.phiDegrees))),
    distance: share ? Math.min(20, Math.max(0.05, Number(share[1]) / 100)) : defaultOrbit.distance,
  };
}

/** A number that an attribute says, within bounds; `otherwise` where it says none. */
export function numberOf(text: string | null, otherwise: number, least: number, most: number): number {
  const value = text === null || text.trim() === '' ? NaN : Number(text);
  return Number.isFinite(value) ? Math.min(most, Math.max(least, value)) : otherwise;
}

// What an element knows of the way to its server before anything is asked for.

interface Connection {
  saveData?: boolean;
  /** Mbit/s */
  downlink?: number;
}
const connection = (): Connection =>
  (globalThis.navigator as { connection?: Connection } | undefined)?.connection ?? {};
const bytesPerMegabit = 125e3;
/** Smaller files say how long the way is, not how wide. */
const tellingBytes = 3e4;
/** A file that is larger is none. */
export const mostBytes = 1e12;

/** Whether the user wants no more bytes than need be. */
export const savesData = (): boolean => connection().saveData === true;
/** Bytes per second of the link: as the browser says, else as the page's own files came; 0: nobody knows. */
export function linkBytesS(): number {
  const files = performance.getEntriesByType('resource') as PerformanceResourceTiming[];
  const rates = files.filter((f) => f.transferSize > tellingBytes)
    .map((f) => f.transferSize / Math.max(1e-3, (f.responseEnd - f.responseStart) / 1000));
  return (connection().downlink ?? 0) * bytesPerMegabit || Math.max(0, ...rates);
}
/** Bytes of a file as its server says without sending it; 0: unknown. */
export async function bytesAt(url: string): Promise<number> {
  const answer = await fetch(url, { method: 'HEAD' }).catch(() => undefined);
  return answer?.ok ? numberOf(answer.headers.get('content-length'), 0, 0, mostBytes) : 0;
}

// What the element says to visitors, in the language of the page.

/** The element's sentences; `TexmeshViewer.words` has them by language, and an application may add others. */
export interface Words {
  loading: string;
  show: string;
  again: string;
  /** Nothing stands at the address, or not for everybody. */
  missing: string;
  /** What stands there is no package, or a damaged one. */
  unreadable: string;
  /** No answer, or not the one that was asked for. */
  unreachable: string;
  /** A part did not come, and is asked for again later. */
  rest: string;
  no3d: string;
}
export const words: Record<string, Words> = {
  en: { loading: 'Loading …', show: 'Show in 3D', again: 'Try again',
    missing: 'This object is not here any more.',
    unreadable: 'This object cannot be shown.',
    unreachable: 'The object could not be loaded. Please check the connection.',
    rest: 'Parts of it could not be loaded yet.',
    no3d: 'This browser cannot show objects in 3D.' },
  de: { loading: 'Wird geladen …', show: 'In 3D ansehen', again: 'Noch einmal versuchen',
    missing: 'Dieses Objekt ist nicht mehr hier.',
    unreadable: 'Dieses Objekt lässt sich nicht zeigen.',
    unreachable: 'Das Objekt konnte nicht geladen werden. Bitte prüfen Sie die Verbindung.',
    rest: 'Teile konnten noch nicht geladen werden.',
    no3d: 'Dieser Browser kann keine Objekte in 3D zeigen, ein anderer oder neuerer vielleicht.' },
  fr: { loading: 'Chargement …', show: 'Voir en 3D', again: 'Réessayer',
    missing: "Cet objet n'est plus ici.",
    unreadable: 'Cet objet ne peut pas être affiché.',
    unreachable: "L'objet n'a pas pu être chargé. Veuillez vérifier la connexion.",
    rest: "Une partie n'a pas encore pu être chargée.",
    no3d: 'Ce navigateur ne peut pas afficher des objets en 3D.' },
};
/** The words for a language such as "de-AT"; English where there are none. */
export const wordsFor = (language = ''): Words => words[language.toLowerCase().split('-')[0]] ?? words.en;

/** The sentence that a visitor reads of an error. */
export function sentenceOf(error: unknown): keyof Words {
  if (!(error instanceof TexmeshError))
    return /WebGL|Worker is not/.test(String(error)) ? 'no3d' : 'unreadable';
  const { found, rule } = error, status = Number(/status (\d+)/.exec(found)?.[1] ?? 0);
  if (/status 4(?!08|29)/.test(found)) return 'missing';
  const page = status < 300 && (rule === 'K11' || /html/.test(found));
  return error instanceof InputError && !page ? 'unreachable' : 'unreadable';
}
