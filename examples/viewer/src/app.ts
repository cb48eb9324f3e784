import { choicesFromAddress, readable } from './choices';
import { warmDecoders } from './session/decoders';
import { byId } from './dom';
import * as format from './format';
import type { Live } from './live';
import { hideMessage, offerPackages, showError } from './message';
import { Panel } from './panel/panel';
import { Session } from './session/session';
import { Stage } from './stage/stage';
import { toggleTheme } from './theme';

const kPhases: Record<string, string> = {
  opening: 'Opening', 'first-picture': 'First picture', tables: 'Tables', mesh: 'Mesh', textures: 'Textures', refining: 'Refining', done: '',
  cancelled: 'Stopped', failed: 'Failed',
};

/** Progress is told no more often than this: each time the page is drawn anew. */
const kStatusMs = 100;

function showStatus(live: Live): void {
  const m = live.manifest;
  byId('name').textContent = live.title || shortName();
  if (m) {
    const first = m.scales[0];
    const textures = m.previews.length;
    byId('subtitle').textContent = [
      first ? `${format.count(first.triangles)} triangles` : '', textures ? `${textures} ${textures === 1 ? 'texture' : 'textures'}` : 'no texture',
      format.bytes(live.packageBytes)].filter(Boolean).join(' · ');
    document.title = `${live.title || shortName()} · texmesh`;
  }
  const phase = kPhases[live.phase] ?? live.phase;
  const busy = !['done', 'failed', 'cancelled'].includes(live.phase);
  // With a time limit its time is what passes; without one the bytes are.
  const elapsed = (performance.now() - live.startedAt) / 1000;
  const share = Number.isFinite(live.limitS) ? Math.min(elapsed / live.limitS, 1) : live.expected > 0 ? Math.min(live.bytes / live.expected, 1) : 0.02;
  const bar = byId('progress');
  bar.hidden = !busy;
  bar.setAttribute('aria-valuenow', (100 * share).toFixed(0));
  (bar.firstElementChild as HTMLElement).style.width = `${(100 * share).toFixed(1)}%`;
  byId('phase').textContent = busy ? phase : live.phase === 'done' ? 'Complete' : phase; // what screen readers say
  const problem = byId('problem');
  problem.hidden = live.problem === '';
  const said = live.problems > 1 ? `${live.problems} problems, the last: ${live.problem}` : live.problem;
  if (problem.textContent !== said) problem.textContent = said;
  byId('status').textContent = [phase, live.bytes > 0 ? `${format.bytes(live.bytes)} in ${live.requests} requests` : '',
    Number.isFinite(live.doneS) && !busy ? `complete after ${format.seconds(live.doneS)}` : ''].filter(Boolean).join(' · ');
}

let packageUrl = '';
const shortName = (): string => readable(packageUrl.split(/[?#]/)[0] ?? '').replace(/\/$/, '').split('/').pop()?.replace(/\.texmesh$/, '') || 'texmesh';

/** The page, as its address has it. Throws when the address is none. */
export function start(query: URLSearchParams): void {
  packageUrl = query.get('pkg') ?? '';
  const stage = new Stage(byId<HTMLCanvasElement>('view'));
  const session = new Session(stage, new URL(packageUrl, document.baseURI).href);
  const choices = choicesFromAddress(query);
  const divider = byId('divider');
  const panel = new Panel(byId('panel'), choices, {
    choose: (c) => {
      Object.assign(choices, c);
      session.override(choices);
    },
    reload: () => {
      hideMessage();
      void session.start(choices);
      if (!divider.hidden) void compare();
    },
    refine: () => { void session.refine(); },
  }, session.live);
  let [asked, told] = [false, -Infinity];
  session.onChange = () => {
    panel.update(session.live);
    if (asked) return;
    asked = true;
    setTimeout(() => {
      asked = false;
      told = performance.now();
      showStatus(session.live);
    }, Math.max(0, told + kStatusMs - performance.now()));
  };
  session.onError = (error) => {
    // What is on the screen stays there: a message in front of it would hide more than it tells.
    if (session.live.scale === null) showError(error, packageUrl);
    else session.problem(error);
  };
  const compare = wireTools(stage, session);
  byId('toggle').setAttribute('aria-expanded', String(!document.body.classList.contains('wide')));
  Object.assign(window, { texmeshViewer: { stage, session, choices } });
  if (packageUrl === '') {
    byId('status').textContent = '';
    void offerPackages();
    return;
  }
  warmDecoders();
  void session.start(choices);
}

/** Gives what shows the original; where that fails, the whole picture is the current one again. */
function wireTools(stage: Stage, session: Session): () => Promise<void> {
  const divider = byId('divider');
  const stageBox = byId('stage');
  let share = 0.5;
  const splitButton = byId('split');
  const place = (): void => {
    divider.style.left = `${100 * share}%`;
    divider.setAttribute('aria-valuenow', (100 * share).toFixed(0));
    stage.setSplit(divider.hidden ? 0 : share);
  };
  const toggleSplit = (): void => {
    divider.hidden = !divider.hidden;
    splitButton.setAttribute('aria-pressed', String(!divider.hidden));
    place();
    if (!divider.hidden) void compare();
  };
  const side = byId('side-original');
  const compare = async (): Promise<void> => {
    const loading = (is: boolean): void => { side.textContent = is ? 'original, loading' : 'original'; };
    try {
      await session.showOriginal(loading);
    } catch (error) {
      loading(false);
      if (!divider.hidden) toggleSplit();
      session.onError(error);
    }
  };
  const togglePanel = (): void => {
    const wide = document.body.classList.toggle('wide');
    byId('toggle').setAttribute('aria-expanded', String(!wide));
  };
  divider.addEventListener('pointerdown', (e) => divider.setPointerCapture(e.pointerId));
  divider.addEventListener('pointermove', (e) => {
    if (!divider.hasPointerCapture(e.pointerId)) return;
    const box = stageBox.getBoundingClientRect();
    share = Math.min(Math.max((e.clientX - box.left) / box.width, 0.03), 0.97);
    place();
  });
  divider.addEventListener('keydown', (e) => {
    if (e.key !== 'ArrowLeft' && e.key !== 'ArrowRight') return;
    share = Math.min(Math.max(share + (e.key === 'ArrowLeft' ? -0.03 : 0.03), 0.03), 0.97);
    place();
    e.preventDefault();
  });
  splitButton.addEventListener('click', toggleSplit);
  byId('home').addEventListener('click', () => stage.home());
  byId('theme').addEventListener('click', toggleTheme);
  byId('toggle').addEventListener('click', togglePanel);
  document.addEventListener('keydown', (e) => {
    if (e.ctrlKey || e.metaKey || e.altKey || /^(INPUT|SELECT|TEXTAREA)$/.test((e.target as HTMLElement).tagName)) return;
    const action = { s: toggleSplit, t: toggleTheme, p: togglePanel, '0': () => stage.home() }[e.key];
    action?.();
  });
  return compare;
}
