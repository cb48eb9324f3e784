// The size of a pixel on this screen, measured with a card (ISO/IEC 7810 ID-1), and from it zoom and distance.
const kCardMm = {long: 85.6, short: 53.98};
const kNearMm = 300; // nearer, eyes tire
const kNearestMm = 200;

/** Distance in mm at which a picture's pixel of `mm` fills its part of a degree. */
const distanceFor = (mm, pixelsPerDegree) => (mm * pixelsPerDegree) / (2 * Math.tan(Math.PI / 360));

/** Room in CSS px that the largest trial needs, stacked or in one row, without and with the controls. */
function roomFor(framePx, zoom, dpr, move) {
  const side = (framePx * zoom) / dpr;
  if (move) return {move: {width: 2 * side + 24, height: side + 190}};
  return {stacked: {width: 2 * side + 24, height: 2 * side + 150}, row: {width: 3 * side + 32, height: side + 140}};
}

/**
 * How the stimuli are shown: one pixel of a picture is `zoom` x `zoom` pixels of the screen, so that nothing is resampled.
 * {zoom, distanceMm, layout} or {misfit: text}.
 */
export function arrange(design, cssPxPerMm, view) {
  const framePx = Math.max(...design.conditions.map((c) => c.frame_px));
  const move = Boolean(design.trials[0].moved);
  const devicePxPerMm = cssPxPerMm * view.dpr;
  const distanceAt = (zoom) => distanceFor(zoom / devicePxPerMm, design.pixels_per_degree);
  let wanted = 1;
  while (distanceAt(wanted) < kNearMm) ++wanted;
  for (const zoom of [wanted, wanted - 1]) {
    if (zoom < 1 || distanceAt(zoom) < kNearestMm) continue;
    const room = roomFor(framePx, zoom, view.dpr, move);
    for (const layout of Object.keys(room))
      if (room[layout].width <= view.width && room[layout].height <= view.height)
        return {zoom, distanceMm: distanceAt(zoom), layout};
  }
  const rooms = Object.values(roomFor(framePx, wanted, view.dpr, move));
  const size = (r) => `${Math.ceil(r.width)} x ${Math.ceil(r.height)}`;
  return {misfit: `The pictures need ${rooms.map(size).join(' or ')} pixels, this window has ${view.width} x ${view.height}. Enlarge the window, turn the phone, or take a larger screen.`};
}

export const viewNow = () => ({width: window.innerWidth, height: window.innerHeight, dpr: window.devicePixelRatio || 1});

/** Asks for the card's width; resolves with {cssPxPerMm, zoom, distanceMm, layout, view}. */
export function measureDisplay(design, $) {
  const upright = window.innerWidth < 560;
  const cardMm = upright ? kCardMm.short : kCardMm.long;
  $('edge').textContent = upright ? 'the short side of the card' : 'the long side of the card';
  const slider = $('width');
  slider.max = Math.min(1000, window.innerWidth - 32);
  slider.value = Math.round((cardMm * 96) / 25.4);
  let found;
  const update = () => {
    const cssPx = Number(slider.value);
    $('card').style.width = `${cssPx}px`;
    const view = viewNow();
    const cssPxPerMm = cssPx / cardMm;
    found = {...arrange(design, cssPxPerMm, view), cssPxPerMm, view};
    $('misfit').textContent = found.misfit ?? '';
    $('measured').disabled = Boolean(found.misfit);
    $('distance').textContent = found.misfit ? '' :
      `Sit so that your eyes are ${(found.distanceMm / 10).toFixed(0)} cm from the screen: ${(found.distanceMm / kCardMm.long).toFixed(1)} times the card's long side.`;
  };
  const move = (step) => () => { slider.value = Number(slider.value) + step; update(); };
  slider.addEventListener('input', update);
  $('narrower').addEventListener('click', move(-1));
  $('wider').addEventListener('click', move(1));
  window.addEventListener('resize', update);
  update();
  return new Promise((done) => $('measured').addEventListener('click', () => {
    if (found.misfit) return;
    window.removeEventListener('resize', update);
    done(found);
  }));
}
