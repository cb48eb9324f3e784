// What the console says to those who look after a page; loaded with the first of it.

import { InputError, TexmeshError } from '../format/errors';

const slowHosts = new Set<string>();
/** Once a host: what it does that costs speed; '' where nothing does, or the host was named. */
export function slowHostNote(form: string, compressed: boolean, url: string): string {
  const { origin } = new URL(url);
  if ((form !== 'whole' && !compressed) || slowHosts.has(origin)) return '';
  slowHosts.add(origin);
  const whole = form === 'whole'
    ? ' sends no parts of files (range requests, status 206): the whole package is read before the first ' +
      'picture. Allow ranges, or put an unpacked package (texmesh unpack) beside it.' : '';
  const packed = ' compresses packages (Content-Encoding), which are compressed already. That costs time, ' +
    'and parts of files may be lost by it. Switch it off for .texmesh, and for all but .json of unpacked ' +
    'packages.';
  return origin + whole + (compressed ? (whole && ' The host also') + packed : '');
}

/** Sources by what browsers call what a policy has forbidden. */
const sources: Record<string, string> = { blob: 'blob:', 'wasm-eval': "'wasm-unsafe-eval'",
  'trusted-types-policy': 'texmesh', 'trusted-types-sink': 'texmesh' };
/** What three.js' loader says where the small picture by which it tries a format does not come. */
const triedInVain = /required by asset but unsupported/;
const policyWords = (wanted: string[]): string =>
  "The page's Content-Security-Policy forbids what the object needs: it must have " +
  `${[...new Set(wanted)].join(', ')}.`;
/** '' of what is no address. */
function originOf(url: string, page?: string): string {
  try {
    return new URL(url, page).origin;
  } catch {
    return '';
  }
}
/** What a policy must allow; '' where it has forbidden nothing that matters. */
function policyNote(host: string, isUnanswered: boolean, all: Iterable<string>, error: unknown): string {
  const forbidden = [...all];
  // A page's own pictures do not matter.
  if (forbidden.includes('img-src data') && error instanceof Error && triedInVain.test(error.message))
    return policyWords(['img-src data:']);
  // Decoders stand beside the element.
  const hosts = [host, originOf(import.meta.url)].filter((origin) => origin !== '');
  const lacking = forbidden.map((what) => what.split(' ')).filter(([directive, blocked]) =>
    blocked in sources || (directive === 'connect-src' && hosts.includes(originOf(blocked))));
  // There is a decoder without WebAssembly, and no answer has to do with it.
  const wanted = lacking
    .filter(([, blocked]) => blocked !== 'wasm-eval' || (lacking.length < 2 && !isUnanswered))
    .map(([directive, blocked]) => `${directive.replace(/^require-(trusted-types)-for$/, '$1')} ` +
      (sources[blocked] ?? originOf(blocked)));
  return wanted.length > 0 ? policyWords(wanted) : '';
}

/**
 * What most often causes an error, '' where nobody knows; `page`, `url`: addresses of page and package;
 * `forbidden`: what the page's policy has forbidden.
 */
export function causeOf(error: unknown, url: string, page: string, forbidden: Iterable<string> = []): string {
  const isUnanswered = error instanceof InputError && !/status/.test(error.found);
  const from = originOf(url, page);
  const note = policyNote(from, isUnanswered, forbidden, error);
  if (note && (isUnanswered || !(error instanceof TexmeshError))) return note;
  if (!(error instanceof TexmeshError)) return '';
  const { found, rule } = error, status = Number(/status (\d+)/.exec(found)?.[1] ?? 0);
  if (status >= 400) return `The server's answer for ${url}: status ${status}.`;
  if (/html/.test(found) || rule === 'K11')
    return 'What the server sent is no texmesh package. A host that answers unknown addresses with its ' +
      'start page does so where the address is wrong.';
  if (/it was replaced/.test(found))
    return 'The file changes from answer to answer: the servers behind its address have several versions.';
  const { origin } = new URL(page);
  if (error instanceof InputError && status === 0)
    return from === origin
      ? 'The server did not answer, or it sends the request on to a host that does not allow it (CORS).'
      : `The server did not answer, or it does not let ${origin} read its files: it must send ` +
        'Access-Control-Allow-Origin (CORS).';
  return rule && `${rule} is a rule of texmesh's format/SPEC.md: the file is damaged, or a newer format.`;
}
