import { choicesFromAddress } from './choices';
import { Comparison } from './comparison';
import { byId } from './dom';
import { hideMessage, offerPackages, showError } from './message';
import { Notes } from './notes';
import { Panel } from './panel/panel';
import { hidePoster } from './poster';
import { warmDecoders } from './session/decoders';
import { Session } from './session/session';
import { Stage } from './stage/stage';
import { showStatus } from './status';
import { wireTools } from './tools';

/** The status is written no more often than this: writing lays the page out anew. */
const kStatusMs = 100;

/** The page, as its address has it. Throws when the address names no URL. */
export function start(query: URLSearchParams): void {
  const packageUrl = query.get('pkg') ?? '';
  const stage = new Stage(byId<HTMLCanvasElement>('view'));
  const session = new Session(stage, new URL(packageUrl, document.baseURI).href);
  const comparison = new Comparison(stage, session);
  const choices = choicesFromAddress(query);
  const panel = new Panel(byId('panel'), choices, {
    choose: (c) => {
      Object.assign(choices, c);
      session.override(choices);
    },
    reload: () => {
      hideMessage();
      void session.start(choices);
      comparison.load();
    },
    refine: () => { void session.refine(); },
  }, session.live);
  const soonStatus = atMostEvery(kStatusMs, () => showStatus(session.live, packageUrl));
  const notes = new Notes(stage, session);
  session.onChange = () => {
    if (session.live.scale !== null) hidePoster();
    panel.update(session.live);
    notes.changed();
    soonStatus();
  };
  session.onError = (error) => {
    // What is on the screen stays there: a message in front of it would hide more than it tells.
    hidePoster();
    if (session.live.scale === null) showError(error, packageUrl);
    else session.problem(error);
  };
  wireTools(stage, comparison);
  Object.assign(window, { texmeshViewer: { stage, session, choices } });
  if (packageUrl === '') {
    byId('status').textContent = '';
    void offerPackages();
    return;
  }
  warmDecoders();
  void session.start(choices);
}

/** A function that calls `f` soon, but never twice within so many milliseconds. */
function atMostEvery(ms: number, f: () => void): () => void {
  let [asked, last] = [false, -Infinity];
  return () => {
    if (asked) return;
    asked = true;
    setTimeout(() => {
      asked = false;
      last = performance.now();
      f();
    }, Math.max(0, last + ms - performance.now()));
  };
}
