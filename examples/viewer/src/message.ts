import { FormatError } from 'texmesh';
import { readable } from './choices';
import { byId, make } from './dom';

/** What stands in the middle of the picture when there is no object: an error, or a choice of packages. */
const box = (): HTMLElement => byId('message');

export function hideMessage(): void {
  box().hidden = true;
}

/** An error in words, with what may be done about it. */
export function showError(error: unknown, url: string): void {
  const text = error instanceof Error ? error.message : String(error);
  box().hidden = false;
  if (document.body.classList.contains('visitor')) {
    console.error(error);
    console.info(`${headline(error, text)}. ${advice(error, text, url)}`);
    box().replaceChildren(make('h2', {}, sentence(error, text)),
      make('button', { type: 'button', onclick: () => location.reload() }, 'Try again'));
    return;
  }
  box().replaceChildren(
    make('h2', {}, headline(error, text)),
    make('p', {}, make('code', {}, text)),
    make('p', {}, advice(error, text, url)));
}

const statusOf = (text: string): number => Number(/found status (\d+)/.exec(text)?.[1] ?? 0);
const isMissing = (text: string): boolean => [404, 410].includes(statusOf(text)) || /not found/i.test(text);

/** What a visitor reads, as the element `<texmesh-viewer>` says it. */
function sentence(error: unknown, text: string): string {
  if (error instanceof FormatError) return 'This object cannot be shown.';
  if (/webgl/i.test(text)) return 'This browser cannot show objects in 3D.';
  if (isMissing(text)) return 'This object is not here any more.';
  return 'The object could not be loaded. Please check the connection.';
}

function headline(error: unknown, text: string): string {
  if (error instanceof FormatError) return 'This is not a package that can be shown';
  if (/webgl/i.test(text)) return 'There is no WebGL here';
  if (isMissing(text)) return 'There is no package here';
  return 'The package could not be loaded';
}

function advice(error: unknown, text: string, url: string): string {
  const elsewhere = URL.canParse(url, document.baseURI) &&
    new URL(url, document.baseURI).origin !== location.origin;
  if (/webgl/i.test(text))
    return 'This browser, or its graphics driver, gives pages no WebGL. Another browser may.';
  if (!URL.canParse(url, document.baseURI)) return 'Look at the address behind ?pkg= in the address bar.';
  if (isMissing(text))
    return 'Look at the address behind ?pkg= in the address bar; it is relative to this page.';
  if (statusOf(text) >= 400)
    return 'The server does not give the package away: its rights, its rules or its load may be the reason.';
  if (/html|K11/.test(text))
    return 'What the server sent is no package. A host that answers unknown addresses with its start page ' +
      'does so where the address is wrong.';
  if (error instanceof FormatError)
    return 'The file may be damaged, or is of a later version. texmesh verify says more.';
  if (elsewhere)
    return 'It stands on another server, which must be reachable and allow this page to read ' +
      '(CORS: Access-Control-Allow-Origin).';
  return 'The server may be down, or the connection broken. Loading again may help.';
}

interface Listed {
  url: string;
  name?: string;
  /** What the package calls itself. */
  title?: string;
  /** URL of a picture of the object. */
  poster?: string;
}

/** Offers the packages that packages.json beside the page lists; false when there is none. */
export async function offerPackages(): Promise<boolean> {
  let list: Listed[] = [];
  try {
    const answer = await fetch('packages.json', { cache: 'no-cache' });
    if (answer.ok) list = ((await answer.json()) as { packages?: Listed[] }).packages ?? [];
  } catch {
    // Without a list that can be read, the address has to name a package.
  }
  const items = list.filter((p) => typeof p.url === 'string').map((p) => {
    const name = p.name ?? readable(p.url).replace(/^packages\//, '').replace(/\.texmesh$/, '');
    const poster = typeof p.poster === 'string'
      ? [make('img', { src: p.poster, alt: '', loading: 'lazy', width: '72', height: '72' })] : [];
    return make('li', {},
      make('a', { href: `?pkg=${encodeURIComponent(p.url)}` }, ...poster,
        make('span', {}, p.title || name)));
  });
  if (items.length) box().replaceChildren(make('h2', {}, 'Packages'), make('ul', {}, ...items));
  else {
    box().replaceChildren(make('h2', {}, 'No package'),
      make('p', {}, 'Name one in the address: ', make('code', {}, '?pkg=URL-of.texmesh'), ', or put a ',
        make('code', {}, 'packages.json'), ' beside this page.'));
  }
  box().hidden = false;
  return items.length > 0;
}
