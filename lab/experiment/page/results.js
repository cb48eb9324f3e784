// The answers: kept in the browser after each one, offered as a file, posted where the experiment names an address.

const keyOf = (design) => `texmesh-experiment-${design.id}`;

/** What was kept and not finished, or null. A storage that is full or forbidden keeps nothing. */
export function keptResults(design) {
  try {
    const kept = JSON.parse(localStorage.getItem(keyOf(design)));
    return kept?.design === design.id && Array.isArray(kept.answers) ? kept : null;
  } catch { return null; }
}

export function keepResults(design, results) {
  try {
    localStorage.setItem(keyOf(design), JSON.stringify(results));
    return true;
  } catch { return false; }
}

export function forgetResults(design) {
  try { localStorage.removeItem(keyOf(design)); } catch { /* nothing was kept */ }
}

/** Which of the design's orders a judge gets: FNV-1a of the name, so that a judge who comes again gets the same. */
export function orderOf(design, judge) {
  let hash = 0x811c9dc5;
  for (const c of judge) hash = Math.imul(hash ^ c.codePointAt(0), 0x01000193) >>> 0;
  return hash % design.orders.length;
}

/** lab/schemas/experiment-results.v1.schema.json */
export function newResults(design, judge, display) {
  const round = (value, digits) => Number(value.toFixed(digits));
  return {
    version: 1, design: design.id, kind: design.kind, judge, order: orderOf(design, judge),
    date: new Date().toISOString().slice(0, 10),
    display: {
      css_px_per_mm: round(display.cssPxPerMm, 3), device_pixel_ratio: round(display.view.dpr, 4), zoom: display.zoom,
      pixels_per_degree: design.pixels_per_degree, distance_mm: round(display.distanceMm, 0), layout: display.layout,
      width_px: display.view.width, height_px: display.view.height, touch: matchMedia('(pointer: coarse)').matches,
    },
    trials: design.orders[0].length,
    ...(design.trials[0].moved && {places_px: design.conditions.map((c) => c.displayed_px)}), answers: [],
  };
}

const textOf = (results) => `${JSON.stringify(results, null, 1)}\n`;

/** Offers the answers at the end. */
export function offerResults(design, results, $) {
  const file = $('file');
  file.href = URL.createObjectURL(new Blob([textOf(results)], {type: 'application/json'}));
  file.download = `results-${design.id}-${results.judge}.json`;
  $('forget').addEventListener('click', () => {
    forgetResults(design);
    $('forget').disabled = true;
    $('sent').textContent = 'The answers are deleted in this browser.';
  });
  if (!design.post_url) return;
  const send = $('send');
  send.hidden = false;
  send.addEventListener('click', async () => {
    send.disabled = true;
    $('sent').textContent = 'Sending ...';
    try {
      const answer = await fetch(design.post_url, {
        method: 'POST', headers: {'Content-Type': 'application/json'}, body: textOf(results), credentials: 'omit', redirect: 'error',
      });
      if (!answer.ok) throw new Error(`the server answered ${answer.status}`);
      $('sent').textContent = 'The answers have been sent.';
    } catch (error) {
      send.disabled = false;
      $('sent').textContent = `The answers could not be sent (${error.message}). Try again, or save them as a file.`;
    }
  });
}
