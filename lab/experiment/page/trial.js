// One trial: three pictures that turn together, a time limit, one choice.
export const kTurnMs = 900; // a view, while the pictures turn by themselves
export const kBlindMs = 150; // a choice so early was meant for the trial before

export const wait = (ms) => new Promise((done) => setTimeout(done, ms));

/** A picture that is there before it is shown. */
export async function loadPicture(name) {
  const picture = new Image();
  picture.src = `stimuli/${name}`;
  await picture.decode();
  return picture.src;
}

/** The judge's table. `scale`: CSS px per pixel of a picture. */
export function makeTable(design, scale, layout, $) {
  const boxes = ['reference', 'left', 'right'].map((name) => $(name));
  const images = boxes.map((box) => box.querySelector('img'));
  const turn = $('turn');
  turn.max = design.views - 1;
  $('table').classList.add(layout);
  for (const where of document.querySelectorAll('#trial .where')) where.textContent = layout === 'row' ? 'one in the middle' : 'one on top';
  let sides = [0, 0, 0], margins = [0, 0, 0];
  const showView = (view) => {
    const wrapped = (view + design.views) % design.views;
    turn.value = wrapped;
    images.forEach((image, k) => {
      image.style.left = `${margins[k] - wrapped * sides[k]}px`;
      image.style.clipPath = `inset(0 ${(design.views - 1 - wrapped) * sides[k]}px 0 ${wrapped * sides[k]}px)`;
    });
  };
  return {
    turn, boxes, showView,
    view: () => Number(turn.value),
    blank: (on) => $('table').classList.toggle('blank', on),
    /** Puts picture `k`, whose views have a side of `px`, into the middle of a box with a side of `framePx`. */
    put(k, source, px, framePx) {
      sides[k] = px * scale;
      margins[k] = Math.floor((framePx - px) / 2) * scale;
      boxes[k].style.width = boxes[k].style.height = `${framePx * scale}px`;
      images[k].src = source;
      images[k].style.top = `${margins[k]}px`;
      images[k].style.height = `${sides[k]}px`;
      images[k].style.width = `${sides[k] * design.views}px`;
    },
  };
}

/** Waits for the choice: {chosen, ms, late}. After the time limit nothing turns any more, and the judge has to choose. */
function choiceOf(design, table, $) {
  return new Promise((done) => {
    const begun = performance.now();
    let late = false;
    let own = matchMedia('(prefers-reduced-motion: reduce)').matches; // the judge turns, not the page
    const turning = setInterval(() => { if (!own && !late) table.showView(table.view() + 1); }, kTurnMs);
    const clock = setInterval(() => {
      const part = (performance.now() - begun) / (1000 * design.time_limit_s);
      $('time').value = Math.min(part, 1);
      if (part < 1 || late) return;
      late = true;
      table.turn.disabled = true;
      $('say').textContent = 'Time is up. Choose now; guess if you must.';
    }, 100);
    const choose = (chosen) => {
      const ms = performance.now() - begun;
      if (ms < kBlindMs && ms < 1000 * design.time_limit_s) return;
      clearInterval(turning);
      clearInterval(clock);
      stop.abort();
      done({chosen, ms: Math.round(ms), late});
    };
    const stop = new AbortController();
    const listen = (target, event, f) => target.addEventListener(event, f, {signal: stop.signal});
    listen($('left'), 'click', () => choose('left'));
    listen($('right'), 'click', () => choose('right'));
    listen(table.turn, 'input', () => { own = true; table.showView(table.view()); });
    listen(document, 'keydown', (e) => {
      if (e.repeat || e.altKey || e.ctrlKey || e.metaKey || e.target === table.turn) return;
      const step = {ArrowUp: 1, ArrowDown: -1}[e.key];
      if (e.key === 'ArrowLeft') choose('left');
      else if (e.key === 'ArrowRight') choose('right');
      else if (!step) return;
      else if (!late) { own = true; table.showView(table.view() + step); }
      e.preventDefault();
    });
  });
}

/** Shows trial `code` of an order, 2 x trial + (1: the same one stands on the right), and gives its answer. */
export async function askTrial(design, table, code, $) {
  const trial = design.trials[code >> 1];
  const side = code & 1 ? 'right' : 'left';
  const names = [trial.reference, ...(side === 'left' ? [trial.same, trial.changed] : [trial.changed, trial.same])];
  table.blank(true);
  $('time').value = 0;
  $('say').textContent = '';
  table.turn.disabled = false;
  const [sources] = await Promise.all([Promise.all(names.map(loadPicture)), wait(1000 * design.pause_s)]);
  const condition = design.conditions[trial.condition];
  sources.forEach((source, k) => table.put(k, source, condition.frame_px, condition.frame_px));
  table.showView(0);
  await Promise.all(table.boxes.map((box) => box.querySelector('img').decode()));
  table.blank(false);
  const {chosen, ms, late} = await choiceOf(design, table, $);
  table.blank(true);
  return {trial: code >> 1, displayed_px: condition.displayed_px, level: trial.level, catch: trial.catch, side, chosen, ms, late};
}
