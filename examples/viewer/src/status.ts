import { readable } from './choices';
import type { About } from 'texmesh';
import { byId, make } from './dom';
import * as format from './format';
import type { Live } from './live';
import { rightsOf } from './rights';

const kPhases: Record<string, string> = {
  opening: 'Opening', 'first-picture': 'First picture', tables: 'Tables', mesh: 'Mesh', textures: 'Textures',
  refining: 'Refining', done: '',
  cancelled: 'Stopped', failed: 'Failed',
};

/** Writes what stands over and under the picture: title, progress, status, problems. */
export function showStatus(live: Live, packageUrl: string): void {
  showTitle(live, live.title || nameInAddress() || shortName(packageUrl));
  const phase = kPhases[live.phase] ?? live.phase;
  const busy = !['done', 'failed', 'cancelled'].includes(live.phase);
  showProgress(shareLoaded(live), busy);
  // what screen readers say
  byId('phase').textContent = busy ? phase : live.phase === 'done' ? 'Complete' : phase;
  showProblem(live);
  byId('status').textContent =
    [phase, live.bytes > 0 ? `${format.bytes(live.bytes)} in ${live.requests} requests` : '',
    Number.isFinite(live.doneS) && !busy ? `complete after ${format.seconds(live.doneS)}`
      : ''].filter(Boolean).join(' · ');
}

const nameInAddress = (): string => new URLSearchParams(location.search).get('title') ?? '';

/** A package's name by its URL, as people would write it, without the digest that a site puts behind it. */
function shortName(url: string): string {
  const name = readable(url.split(/[?#]/)[0] ?? '').replace(/\/$/, '').split('/').pop() ?? '';
  const words = name.replace(/(\.[0-9a-f]{16})?\.texmesh$/, '').replace(/[-_\s]+/g, ' ').trim();
  return words.charAt(0).toUpperCase() + words.slice(1) || 'texmesh';
}

/** Attribution, and licence as a link. Written once: a link under the pointer must stay. */
let shownRights: About | null = null;
function showRights(about: About | null): void {
  if (about === shownRights) return;
  shownRights = about;
  const line = byId('rights');
  const { by, licence, url } = rightsOf(about);
  line.replaceChildren(by);
  if (by !== '' && licence !== '') line.append(' · ');
  // Only http and https: the library has refused any other URL.
  if (url !== '')
    line.append(make('a', { href: url, rel: 'license noopener noreferrer', target: '_blank' }, licence));
  else line.append(licence);
  line.hidden = by === '' && licence === '';
}

function showTitle({ manifest, textures: planes, packageBytes, about, phase }: Live, name: string): void {
  byId('name').textContent = name;
  if (!manifest) return;
  const done = phase === 'done';
  const finest = manifest.scales[0];
  const textures = planes.filter((p) => p.mip === 0).length;
  byId('subtitle').textContent = [
    finest ? `${format.count(finest.triangles)} triangles` : '',
    // How many there are is known when their tables are.
    textures ? `${textures} ${textures === 1 ? 'texture' : 'textures'}` : done ? 'no texture' : '',
    format.bytes(packageBytes)].filter(Boolean).join(' · ');
  showRights(about);
  document.title = `${name} · texmesh`;
}

/**
 * With a time limit the share of the time that has passed, without one the share of the bytes that have come.
 */
function shareLoaded(live: Live): number {
  if (Number.isFinite(live.limitS))
    return Math.min((performance.now() - live.startedAt) / 1000 / live.limitS, 1);
  return live.expected > 0 ? Math.min(live.bytes / live.expected, 1) : 0.02;
}

function showProgress(share: number, busy: boolean): void {
  const bar = byId('progress');
  bar.hidden = !busy;
  bar.setAttribute('aria-valuenow', (100 * share).toFixed(0));
  (bar.firstElementChild as HTMLElement).style.width = `${(100 * share).toFixed(1)}%`;
}

function showProblem({ problem, problems }: Live): void {
  const line = byId('problem');
  line.hidden = problem === '';
  const said = problems > 1 ? `${problems} problems, the last: ${problem}` : problem;
  if (line.textContent !== said) line.textContent = said;
}
