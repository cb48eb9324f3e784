// The course of an experiment: consent, the screen's measure, trials, results. design.json beside this file says all of it.
import {arrange, measureDisplay, viewNow} from './display.js';
import {keepResults, keptResults, newResults, offerResults} from './results.js';
import {askMove} from './move.js';
import {askTrial, makeTable} from './trial.js';

const $ = (id) => document.getElementById(id);

function show(name) {
  for (const section of document.querySelectorAll('main > section')) section.hidden = section.id !== name;
  document.body.classList.toggle('judging', name === 'trial');
  [...$(name).querySelectorAll('h1')].find((h) => h.offsetParent)?.focus();
  window.scrollTo(0, 0);
}

function fail(text) {
  $('reason').textContent = text;
  show('problem');
}

/** Paragraphs of plain text. */
function showText(element, text) {
  for (const part of text.split(/\n\s*\n/)) {
    const p = document.createElement('p');
    p.textContent = part;
    element.append(p);
  }
}

/** Whether judges move an object, in place of choosing one (6.2). */
const movesOf = (design) => Boolean(design.trials[0].moved);

const newName = () => `j-${[...crypto.getRandomValues(new Uint8Array(6))].map((n) => (n % 36).toString(36)).join('')}`;

/** Consent and name; resolves with {judge, kept}: kept are answers to go on with, or null. */
function welcome(design) {
  const trials = design.orders[0].length;
  $('length').textContent = `${trials} choices, about ${Math.max(2, Math.round((trials * (movesOf(design) ? 15 : 5)) / 60))} minutes.`;
  showText($('consent'), design.consent);
  const kept = keptResults(design);
  const open = kept && kept.answers.length > 0 && kept.answers.length < trials;
  $('judge').value = open ? kept.judge : newName();
  $('resume').hidden = !open;
  show('welcome');
  return new Promise((done) => {
    $('start').addEventListener('submit', (e) => { e.preventDefault(); done({judge: $('judge').value, kept: null}); });
    $('resume').addEventListener('click', () => { if ($('start').reportValidity()) done({judge: kept.judge, kept}); });
  });
}

/** The answers given so far, the last one last. */
async function judge(design, results, display) {
  const order = design.orders[results.order];
  const table = makeTable(design, display.zoom / display.view.dpr, display.layout, $);
  const watch = () => {
    const now = arrange(design, display.cssPxPerMm, viewNow());
    if (now.misfit || viewNow().dpr !== display.view.dpr) $('say').textContent = 'The window has changed. Make it as large as it was, without zoom.';
  };
  window.addEventListener('resize', watch);
  show('trial');
  for (let k = results.answers.length; k < order.length; ++k) {
    $('count').textContent = `${k + 1} of ${order.length}`;
    $('done-so-far').value = k / order.length;
    results.answers.push(await (movesOf(design) ? askMove : askTrial)(design, table, order[k], $));
    keepResults(design, results);
  }
  window.removeEventListener('resize', watch);
}

async function main() {
  const answer = await fetch('design.json');
  if (!answer.ok) throw new Error(`design.json: the server answered ${answer.status}`);
  const design = await answer.json();
  if (design.version !== 1) throw new Error(`design.json is of version ${design.version}, this page of version 1`);
  document.documentElement.style.setProperty('--stimulus', design.background);
  document.body.classList.toggle('moving', movesOf(design));
  const {judge: name, kept} = await welcome(design);
  show('display');
  const display = await measureDisplay(design, $);
  const results = newResults(design, name, display);
  if (kept) results.answers = kept.answers;
  await judge(design, results, display);
  $('summary').textContent = `${results.answers.length} choices are done.`;
  offerResults(design, results, $);
  show('done');
}

main().catch((error) => fail(location.protocol === 'file:' ?
  'Browsers do not let a page read files beside it. Serve the folder, for instance with: python3 -m http.server' : error.message));
