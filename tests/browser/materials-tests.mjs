// Materials that make_scan's objects have not: coverage, two sides, textures of glTF's extensions. Against three.js's drawing of the source.
import {check, common, lab, labPage} from './browser.mjs';
import {test} from './harness.mjs';
import {kEverything, loaded} from './loads.mjs';

const kSheet = {size: 384, min: [-0.5, -0.5, -0.08], max: [0.5, 0.5, 0.08], azimuth: 20, elevation: 10, zoom: 1.2, background: 0x20c020};
const errorsOf = (r) => r.events.filter((e) => e.name === 'error').map((e) => e.message);

/** Mean difference of the canvas, drawn anew, from a picture that the page keeps. */
const apart = (page) => lab(page, () => {
  window.lab.draw();
  const got = window.lab.pixels();
  return window.source.reduce((sum, v, i) => sum + Math.abs(v - got[i]), 0) / (got.length * 3 / 4);
});

for (const name of ['blend', 'mask'])
  test(`materials are drawn as the source's: ${name}`, async () => {
    const b = await common();
    const page = await labPage(b.browser, b.url);
    await lab(page, (s) => window.lab.start(s), kSheet);
    const empty = await lab(page, async (u) => {
      window.lab.draw();
      const none = window.lab.pixels();
      const id = window.lab.loadGlb(u);
      await window.lab.loads[id].promise;
      window.lab.draw();
      window.source = window.lab.pixels();
      window.lab.clear(id);
      return window.source.reduce((sum, v, i) => sum + Math.abs(v - none[i]), 0) / (none.length * 3 / 4);
    }, `${b.url}/packages/${name}.glb`);
    const r = await loaded(null, page, `${b.url}/packages/${name}.texmesh`, {load: kEverything});
    check(!r.error && errorsOf(r).length === 0, JSON.stringify([r.error, errorsOf(r)]));
    check(r.state.planes.map((p) => p.role).join().includes('alpha') && r.state.planes.length === 3, `planes: ${r.state.planes.map((p) => p.role)}`);
    for (const p of r.state.planes) check(p.rungs.every((v) => v >= 0), `${p.role}: ${p.rungs}`);
    const d = await apart(page);
    check(d < 1.5 && empty > 15 * d, `differs by ${d.toFixed(2)} of 255 in the mean, nothing at all by ${empty.toFixed(2)}`);
    // Every texture of the material is the composed one: without it the drawing is another.
    for (const slot of ['map', 'alphaMap', 'sheenColorMap']) {
      const without = await lab(page, ([i, s]) => {
        const [m] = window.lab.loads[i].model.materials;
        const texture = m[s];
        m[s] = null;
        m.needsUpdate = true;
        window.restore = () => { m[s] = texture; m.needsUpdate = true; };
        return texture ? window.lab.loads[i].model.state.planes.some((p) => p.textures.includes(texture)) : null;
      }, [r.id, slot]);
      check(without === true, `${slot}: ${without === null ? 'none' : 'not composed'}`);
      const far = await apart(page);
      check(far > 2 * d, `${slot} does nothing: ${far.toFixed(2)} without it, ${d.toFixed(2)} with it`);
      await lab(page, () => window.restore());
    }
    check(page.said.length === 0, page.said.join('\n'));
    await page.close();
  });

test('materials with two sides are refined from both', async () => {
  const b = await common();
  const rungs = [];
  for (const azimuth of [0, 180]) {
    const page = await labPage(b.browser, b.url);
    await lab(page, (s) => window.lab.start(s), {...kSheet, azimuth, elevation: 0, size: 700});
    const r = await loaded(null, page, `${b.url}/packages/mask.texmesh`, {load: {time: 0.01}});
    check(!r.error, JSON.stringify(r.error));
    await lab(page, (i) => window.lab.loads[i].model.refine(), r.id);
    const {state} = await lab(page, (i) => window.lab.report(i), r.id);
    check(state.phase === 'done', state.phase);
    rungs.push(state.planes.flatMap((p) => p.rungs));
    await page.close();
  }
  const [front, back] = rungs.map((all) => all.filter((v) => v >= 0).length);
  check(front > 0.6 * rungs[0].length && back >= 0.9 * front, `${front} fragments fetched from in front, ${back} from behind, of ${rungs[0].length}`);
});
