// What is seen while a load goes on and after it: mip levels, switches of scale, what follows the camera, a lost graphics context.
import {check, common, lab, labPage} from './browser.mjs';
import {test} from './harness.mjs';
import {comparePlane, kEverything, kTopQuality, loaded, throttled} from './loads.mjs';
import {starvation} from './starved.mjs';

const until = (page, f, arg, timeout = 30000) => page.waitForFunction(f, arg, {timeout});
const phaseIs = (page, id, phase = 'done') => until(page, ([i, p]) => {
  const {model} = window.lab.loads[i];
  model?.update(window.lab.loads[i].px ? undefined : window.lab.stage().camera);
  return model?.state.phase === p;
}, [id, phase]);

test('every mip level is the mean of the level before', async () => {
  const b = await common();
  const r = await loaded(b, null, `${b.url}/packages/large.texmesh`, {load: kEverything});
  check(!r.error, JSON.stringify(r.error));
  const levels = await lab(r.page, ([i, p]) => window.lab.levels(i, p), [r.id, r.state.planes[0].base]);
  check(levels.length === 11 && levels.at(-1).w === 1, `${levels.length} levels of 2048 px`);
  for (const {level, most, mean} of levels) {
    // The smallest are made on the GPU, in linear light: means of unequal texels are lighter there.
    const [mostMay, meanMay] = level < 5 ? [24, 1.2] : [64, 6];
    check(most <= mostMay && mean <= meanMay, `level ${level}: differs by ${most} at most, ${mean.toFixed(2)} in the mean`);
  }
  await r.page.close();
});

test('a scale changes when the display has changed by more than a tenth', async () => {
  const b = await common();
  const page = await labPage(b.browser, b.url);
  await lab(page, () => window.lab.start({size: 256}));
  // By pictures a finer scale may come where time is left, and stays.
  const scales = await lab(page, async (u) => { const p = await window.lab.open(u); p.dispose(); return p.manifest.scales; }, `${b.url}/packages/large.texmesh`);
  const steps = [];
  for (const {scale, displayPxJnd: upToPx} of scales.slice(1).reverse())
    if (upToPx > 1.3 * (steps.at(-1)?.upToPx ?? 0)) steps.push({scale, upToPx});
  const at = steps[Math.floor((steps.length - 1) / 2)];
  const id = await lab(page, ([u, o]) => window.lab.load(u, o),
    [`${b.url}/packages/large.texmesh`, {px: 0.98 * at.upToPx, load: {time: 2, rule: 'jnd', rung: 0, meshes: 'glb'}}]);
  await lab(page, (i) => window.lab.finished(i), id);
  await phaseIs(page, id);
  const wanted = async (factor) => lab(page, ([i, px]) => {
    window.lab.loads[i].px = px;
    window.lab.loads[i].model.update();
    return window.lab.loads[i].model.state.wantedScale;
  }, [id, factor * at.upToPx]);
  const before = (await lab(page, (i) => window.lab.report(i), id)).state.wantedScale;
  check(before === at.scale, `S_${before}, not S_${at.scale}`);
  for (const factor of [1.03, 0.97, 1.05, 0.95, 1.08]) check(await wanted(factor) === before, `S_${await wanted(factor)} at ${factor}`);
  const finer = await wanted(1.15);
  check(finer < before, `S_${finer} at 1.15`);
  for (const factor of [1.05, 0.97, 1.03, 0.95]) check(await wanted(factor) === finer, `S_${await wanted(factor)} at ${factor}, back`);
  check(await wanted(0.85) >= before, `S_${await wanted(0.85)} at 0.85`);
  await page.close();
});

test('fragments are refined where the camera looks', async () => {
  const b = await common();
  const seenFrom = async (azimuth) => {
    const page = await labPage(b.browser, b.url);
    await lab(page, (a) => window.lab.start({size: 900, zoom: 3, azimuth: a}), azimuth);
    // No time: all that comes is refining's.
    const id = await lab(page, ([u, o]) => window.lab.load(u, o), [`${b.url}/packages/large.texmesh`, {load: {time: 0.01, refineTo: 0}}]);
    await lab(page, (i) => window.lab.finished(i), id);
    await phaseIs(page, id);
    const {planes} = (await lab(page, (i) => window.lab.report(i), id)).state;
    await page.close();
    return planes[0].rungs.flatMap((r, f) => (r >= 0 ? [f] : []));
  };
  const [front, back] = [await seenFrom(30), await seenFrom(210)];
  const both = front.filter((f) => back.includes(f)).length;
  check(front.length > 4 && back.length > 4, `${front.length} and ${back.length} fragments`);
  check(both < 0.7 * Math.min(front.length, back.length), `${both} of ${front.length} and ${back.length} are the same`);
});

test('the camera turns during the timed part: what is refined then is what it looks at by then', async () => {
  const refined = {};
  for (const turned of [false, true])
    await throttled({}, async (page, link, url) => {
      await lab(page, () => window.lab.start({size: 900, zoom: 3, azimuth: 30}));
      const starved = starvation();
      const id = await lab(page, (u) => window.lab.load(u, {load: {time: 1.5, refineTo: 0}}), url);
      await until(page, (i) => window.lab.report(i).events.some((e) => e.name === 'first-picture'), id);
      check(!(await lab(page, (i) => window.lab.report(i), id)).events.some((e) => e.name === 'deadline'), 'the timed part is over already');
      if (turned) {
        await lab(page, () => {
          const {camera, centre} = window.lab.stage();
          const away = camera.position.clone().sub(centre);
          camera.position.set(centre.x - away.x, centre.y + away.y, centre.z - away.z);
          camera.lookAt(centre);
          camera.updateMatrixWorld();
        });
      }
      const timed = await lab(page, (i) => window.lab.finished(i), id);
      check(!timed.error, JSON.stringify(timed.error));
      const {at, actual} = timed.events.find((e) => e.name === 'deadline');
      const waited = starved();
      check(actual <= 1.5 * 1.1 + waited, `${actual} s of 1.5, ${waited} s without a processor`);
      await link.set({bytesPerSecond: 1e12, rttMs: 0});
      await phaseIs(page, id);
      const {events} = await lab(page, (i) => window.lab.report(i), id);
      refined[turned] = new Set(events.filter((e) => e.name === 'fragment' && e.at > at).map((e) => `${e.plane}/${e.fragment}`));
    });
  const [stayed, other] = [refined.false, refined.true];
  const both = [...other].filter((f) => stayed.has(f)).length;
  check(stayed.size > 4 && other.size > 4 && both < 0.7 * Math.min(stayed.size, other.size), `${both} of ${stayed.size} and ${other.size} fragments are the same`);
}, {seconds: 120, timed: true});

test('coming nearer during a load: it ends in time, with what the new view asks for', () => throttled({}, async (page, link, url) => {
  await lab(page, () => window.lab.start({size: 900, zoom: 0.4}));
  const starved = starvation();
  const id = await lab(page, (u) => window.lab.load(u, {load: {time: 3, rule: 'error'}}), url);
  await until(page, (i) => window.lab.report(i).events.some((e) => e.name === 'fragment'), id);
  const far = (await lab(page, (i) => window.lab.report(i), id)).state.wantedScale;
  await lab(page, () => {
    const {camera, centre, radius} = window.lab.stage();
    camera.position.sub(centre).setLength(radius * 1.2).add(centre);
    camera.updateMatrixWorld();
  });
  const r = await lab(page, (i) => window.lab.finished(i), id);
  check(!r.error, JSON.stringify(r.error));
  const deadline = r.events.find((e) => e.name === 'deadline');
  const waited = starved();
  check(deadline.actual <= 3 * 1.06 + waited, `${deadline.actual} s of 3; starved for ${waited} s`);
  await link.set({bytesPerSecond: 1e12, rttMs: 0});
  await phaseIs(page, id);
  // What the deadline left comes on its own, on a busy machine a little after.
  await until(page, (i) => { const {state} = window.lab.report(i); return state.scale === state.wantedScale; }, id);
  const {state, events} = await lab(page, (i) => window.lab.report(i), id);
  check(state.scale < far && state.scale === state.wantedScale, `S_${far}, then S_${state.scale} of S_${state.wantedScale}`);
  check(!events.some((e) => e.name === 'error'), JSON.stringify(events.filter((e) => e.name === 'error')));
}), {seconds: 90, timed: true});

test('no crack opens at a switch: no background within the outline', () => throttled({bytesPerSecond: 500000}, async (page, link, url) => {
  await lab(page, () => window.lab.start({size: 400, background: 0xff00ff}));
  const id = await lab(page, (u) => window.lab.load(u, {frames: 1, load: {time: 4, scale: 0, meshes: 'stream', autoRefine: false}}), url);
  const r = await lab(page, (i) => window.lab.finished(i), id);
  check(!r.error, JSON.stringify(r.error));
  const scales = r.events.filter((e) => e.name === 'scale').map((e) => e.scale);
  check(new Set(scales).size > 4, `scales ${scales}`);
  const holes = await lab(page, (i) => window.lab.loads[i].frames.map(({data}) => {
    const n = 400;
    const empty = (p) => data[4 * p] === 255 && data[4 * p + 1] === 0 && data[4 * p + 2] === 255;
    const seen = new Uint8Array(n * n);
    const open = [];
    const reach = (p) => { if (!seen[p] && empty(p)) { seen[p] = 1; open.push(p); } };
    for (let k = 0; k < n; k++) for (const p of [k, n * (n - 1) + k, k * n, k * n + n - 1]) reach(p);
    while (open.length) {
      const p = open.pop();
      if (p % n) reach(p - 1);
      if (p % n < n - 1) reach(p + 1);
      if (p >= n) reach(p - n);
      if (p < n * (n - 1)) reach(p + n);
    }
    const inside = [];
    for (let p = 0; p < n * n; p++) if (empty(p) && !seen[p]) inside.push([p % n, Math.floor(p / n)]);
    return inside;
  }), id);
  // What one sees through the object itself, between two of its bumps, is there in the end, too.
  const through = holes.at(-1);
  const cracks = holes.map((h) => h.filter(([x, y]) => !through.some(([u, v]) => Math.hypot(u - x, v - y) < 8)).length);
  check(holes.length > 5 && through.length < 20, `${holes.length} frames, the last with ${through.length} pixels of background inside`);
  check(Math.max(...cracks) === 0, `pixels of background inside, by frame: ${cracks}`);
}), {seconds: 60, timed: true});

test('a lost graphics context: the library makes anew what it had', async () => {
  const b = await common();
  const r = await loaded(b, null, `${b.url}/packages/maps.texmesh`, {load: {...kEverything, autoRefine: true}});
  const {page, id} = r;
  check(!r.error, JSON.stringify(r.error));
  await phaseIs(page, id);
  const rungs = (s) => JSON.stringify(s.planes.map((p) => p.rungs));
  await lab(page, () => { window.loss = window.lab.gl().getExtension('WEBGL_lose_context'); window.loss.loseContext(); });
  await until(page, (i) => window.lab.report(i).events.some((e) => e.name === 'context' && e.lost), id);
  await lab(page, () => window.loss.restoreContext());
  await until(page, (i) => {
    const names = window.lab.report(i).events.map((e) => (e.name === 'context' ? `context ${e.lost}` : e.name));
    return names.lastIndexOf('done') > names.indexOf('context false') && names.includes('context false');
  }, id);
  const after = await lab(page, (i) => window.lab.report(i), id);
  check(rungs(after.state) === rungs(r.state), `rungs ${rungs(r.state)} before, ${rungs(after.state)} after`);
  for (const p of after.state.planes) {
    const d = await comparePlane(page, id, p.base, 'maps', kTopQuality);
    check(d.most <= 3, `${p.role}: differs by ${d.most}`);
  }
  check(!after.events.some((e) => e.name === 'error'), JSON.stringify(after.events.filter((e) => e.name === 'error')));
  await page.close();
}, {seconds: 90});

test('a graphics context that is lost during a load', () => throttled({bytesPerSecond: 400000}, async (page, link, url) => {
  const id = await lab(page, (u) => window.lab.load(u, {load: {time: 1e9, scale: 19, rung: 3, fullSize: true, autoRefine: false}}), url);
  await until(page, (i) => window.lab.report(i).events.filter((e) => e.name === 'fragment').length > 5, id);
  await lab(page, async () => {
    const loss = window.lab.gl().getExtension('WEBGL_lose_context');
    loss.loseContext();
    await new Promise((go) => setTimeout(go, 300));
    loss.restoreContext();
  });
  await link.set({bytesPerSecond: 1e12, rttMs: 0});
  const r = await lab(page, (i) => window.lab.finished(i), id);
  check(!r.error, JSON.stringify(r.error));
  await lab(page, (i) => window.lab.loads[i].model.refine(), id);
  const {state} = await lab(page, (i) => window.lab.report(i), id);
  const errors = r.events.filter((e) => e.name === 'error').map((e) => e.message);
  check(state.planes.length > 0 && state.planes.every((p) => p.rungs.some((k) => k === 3)), JSON.stringify([errors, state.planes.map((p) => p.rungs)]));
  const levels = await lab(page, ([i, p]) => window.lab.levels(i, p), [id, state.planes[0].base]);
  check(levels[0].mean < 1.5, `mip level 1 differs by ${levels[0].mean} in the mean`);
}), {seconds: 90});
