// One trial of 6.2: the left object stays, the judge moves the right one until both look alike.
import {kBlindMs, kTurnMs, loadPicture, wait} from './trial.js';

/** Waits until the judge is content: {place, ms}. `show` puts the right object at a place. */
function placeOf(design, table, begins, show, $) {
  return new Promise((done) => {
    const begun = performance.now();
    let own = matchMedia('(prefers-reduced-motion: reduce)').matches; // the judge turns, not the page
    const turning = setInterval(() => { if (!own) table.showView(table.view() + 1); }, kTurnMs);
    const slider = $('place');
    slider.max = design.conditions.length - 1;
    slider.value = begins;
    const move = (step) => { slider.value = Number(slider.value) + step; show(Number(slider.value)); };
    const choose = () => {
      const ms = performance.now() - begun;
      if (ms < kBlindMs) return;
      clearInterval(turning);
      stop.abort();
      done({place: Number(slider.value), ms: Math.round(ms)});
    };
    const stop = new AbortController();
    const listen = (target, event, f) => target.addEventListener(event, f, {signal: stop.signal});
    listen($('alike'), 'click', choose);
    listen(slider, 'input', () => move(0));
    listen(table.turn, 'input', () => { own = true; table.showView(table.view()); });
    listen(document, 'keydown', (e) => {
      if (e.altKey || e.ctrlKey || e.metaKey || e.target === table.turn) return;
      const step = {ArrowUp: 1, ArrowDown: -1}[e.key];
      if (e.key === 'ArrowLeft' || e.key === 'ArrowRight') move(e.key === 'ArrowLeft' ? -1 : 1);
      else if (step) { own = true; table.showView(table.view() + step); }
      else if (e.key === 'Enter' && !e.repeat && e.target !== $('alike')) choose(); // the button clicks by itself
      else return;
      e.preventDefault();
    });
  });
}

/** Shows trial `code` of an order, 2 x trial + (1: the right object begins at the farthest place), and gives its answer. */
export async function askMove(design, table, code, $) {
  const trial = design.trials[code >> 1];
  const frames = design.conditions.map((c) => c.frame_px);
  const begins = code & 1 ? frames.length - 1 : 0;
  table.blank(true);
  $('say').textContent = '';
  const [[reference, ...moved]] = await Promise.all([
    Promise.all([trial.reference, ...trial.moved].map(loadPicture)), wait(1000 * design.pause_s)]);
  const show = (place) => {
    table.put(2, moved[place], frames[place], frames[0]);
    table.showView(table.view());
  };
  table.put(0, reference, frames[0], frames[0]);
  table.showView(0);
  show(begins);
  await Promise.all([0, 2].map((k) => table.boxes[k].querySelector('img').decode()));
  table.blank(false);
  const {place, ms} = await placeOf(design, table, begins, show, $);
  table.blank(true);
  return {trial: code >> 1, displayed_px: design.conditions[0].displayed_px, level: trial.level, catch: trial.catch,
    began: begins ? 'far' : 'near', place, ms, late: false};
}
