// The thesis as printed: a package of --profile thesis, loaded with the policy thesis.
import {check, lab} from './browser.mjs';
import {test} from './harness.mjs';
import {loaded, throttled} from './loads.mjs';

test('the policy thesis loads as printed: the JND\'s scale, F-bar first, one fragment at a time, none skipped', () => throttled({bytesPerSecond: 150000, rttMs: 2}, async (page, link) => {
  const time = 12; // every fragment waits for a round trip, and on a busy machine for the page
  const r = await loaded(null, page, `${link.url}/packages/printed.texmesh`, {px: 600, load: {time, policy: 'thesis', autoRefine: false}});
  check(!r.error, JSON.stringify(r.error));
  const said = r.events.filter((e) => e.name === 'decision');
  const taken = said.filter((e) => e.done === undefined);
  const ended = new Map(said.filter((e) => e.done !== undefined).map((e) => [e.position, e.done]));
  check(taken.length > 8, `${taken.length} decisions`);
  const odd = taken.filter((d) => d.fragments.length !== 1 || d.skipped);
  check(odd.length === 0, `${odd.length} of ${taken.length} decisions are for more than a fragment, or skip one: ${JSON.stringify(odd[0])}`);
  const etas = taken.map((d) => Math.abs(d.eta)); // they count from Gamma
  check(etas[0] === Math.min(...etas), `the first is not nearest to Gamma: ${etas}`);
  for (const d of taken.slice(1)) check(d.issued >= ended.get(d.position - 1) - 1e-9, `decision ${d.position} did not wait`);
  const wanted = await lab(page, (i) => {
    const {scales} = window.lab.loads[i].pkg.manifest;
    return scales.filter((s) => s.scale > 0 && s.displayPxJnd >= 600).map((s) => s.scale).at(-1) ?? 0;
  }, r.id);
  check(r.state.scale === wanted, `S_${r.state.scale} is shown, S_${wanted} is the rule's`);
  check(r.state.planes.every((p) => p.plane === p.base), 'a mip is shown');
  const end = r.events.find((e) => e.name === 'deadline');
  check(end && end.skipped === 0 && end.actual < 1.5 * time, JSON.stringify(end));
}));
