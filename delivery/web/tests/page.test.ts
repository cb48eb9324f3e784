import { describe, expect, it } from 'vitest';
import type { PageModel, PageModelOptions } from '../src/page';
import { defaultOrbit } from '../src/page/framing';
import { type Fault, fakeServer } from './support/fake_server';
import { type FakeCanvas, withPage } from './support/fake_page';
import { decodeNothing, until } from './support/loading';
import { container, rejection, url } from './support/scan';

/** Twenty copies of the golden scan, each with an address of its own. */
const hosts = Array.from({ length: 20 }, (_, i) => `http://host/${i}/scan.texmesh`);
const files = Object.fromEntries([...hosts, url].map((u) => [new URL(u).pathname, container]));
const options = (fault?: Fault): { how: PageModelOptions; server: ReturnType<typeof fakeServer> } => {
  const server = fakeServer(files, { fault });
  return { server, how: { open: { fetch: server.fetch, retries: 0, retryDelayS: 0.001,
    decode: decodeNothing }, load: { decode: decodeNothing, meshes: 'glb' } } };
};
const isShown = (m: PageModel): boolean => m.phase === 'shown';
const picturesOf = (m: PageModel): number => (m.canvas as unknown as FakeCanvas).pictures;

describe('a page', () => {
  it('shows all that is seen, first pictures before anything else, within one time', () =>
    withPage({ time: 6, openAtOnce: 4 }, async ({ page, canvas }) => {
      const { how, server } = options();
      const said: string[] = [];
      let most = 0;
      page.on('first-pictures', ({ models }) => said.push(`pictures of ${models}`));
      page.on('deadline', ({ actual, limit }) => said.push(`deadline ${actual <= limit + 1}`));
      const models = hosts.slice(0, 8).map((u) => page.add(canvas(), u, how));
      for (const m of models)
        m.on('phase', () => {
          most = Math.max(most, models.filter((o) => o.phase === 'opening' && o.coming).length);
          if (m.phase === 'turn') said.push('turn');
          expect(models.filter((o) => o.phase === 'turn').length).toBeLessThanOrEqual(1);
        });
      expect(await until(() => models.every(isShown))).toBe(true);
      expect(said[0]).toBe('pictures of 8');
      expect(said.filter((s) => s === 'turn').length).toBe(8);
      expect(said.at(-1)).toBe('deadline true');
      expect(most).toBe(4);
      expect(models.every((m) => picturesOf(m) > 0)).toBe(true);
      // Beginnings came first: of every package before the second request for any.
      expect(new Set(server.log.slice(0, 8).map((l) => l.url)).size).toBe(8);
      expect(page.gpuBytes).toBe(models.reduce((sum, m) => sum + m.gpuBytes, 0));
    }));
  it('refines what another view shows', () =>
    withPage({ time: 0.2 }, async ({ page, canvas }) => {
      const { how } = options();
      const model = page.add(canvas(), url, how);
      expect(await until(() => model.complete)).toBe(true);
      const load = model.load!;
      const { refine } = load;
      let rounds = 0;
      load.refine = () => (++rounds, refine());
      for (const [before, turned] of [180, 0].entries()) {
        model.frame({ ...defaultOrbit, thetaDegrees: defaultOrbit.thetaDegrees + turned });
        expect(await until(() => rounds > before && model.complete)).toBe(true);
      }
      expect(rounds).toBe(2);
      model.lacking = true; // what did not come is asked for again at its own time
      model.frame({ ...defaultOrbit, thetaDegrees: defaultOrbit.thetaDegrees + 90 });
      expect(await until(() => !model.complete, 0.8)).toBe(false);
      expect(rounds).toBe(2);
    }));
  it('keeps within its memory', () =>
    withPage({ time: 2, memoryBytes: 1e6 }, async ({ page, canvas }) => {
      const { how } = options();
      const models = hosts.slice(0, 2).map((u) => page.add(canvas(0, 900), u, how));
      expect(await until(() => models.every((m) => m.complete))).toBe(true);
      const small = page.gpuBytes;
      for (const m of models) m.remove();
      await withPage({ time: 2, memoryBytes: 1e9 }, async (other) => {
        const large = hosts.slice(0, 2).map((u) => other.page.add(other.canvas(0, 900), u, how));
        expect(await until(() => large.every((m) => m.complete))).toBe(true);
        expect(other.page.gpuBytes).toBeGreaterThan(1e6);
      });
      expect(small).toBeLessThanOrEqual(1e6);
      expect(page.gpuBytes).toBe(0);
    }));
  it('keeps within its memory while the reader scrolls: what has just been seen makes room', () =>
    withPage({ time: 0.3, memoryBytes: 2e6 }, async ({ page, canvas, scrolled }) => {
      const { how } = options();
      const canvases = Array.from({ length: 6 }, (_, i) => canvas(i * 0.6, 900));
      const models = canvases.map((c, i) => page.add(c, hosts[i], how));
      let most = 0;
      for (let at = 0; at < 3; ++at) {
        canvases.forEach((c, i) => ((c as unknown as FakeCanvas).top = (i - 2 * at) * 0.6));
        scrolled();
        expect(await until(() =>
          [2 * at, 2 * at + 1].every((i) => models[i].phase === 'shown' && models[i].complete))).toBe(true);
        most = Math.max(most, page.gpuBytes);
      }
      expect(most).toBeGreaterThan(1e5);
      expect(most).toBeLessThanOrEqual(2e6);
    }));
  it('fetches nothing for what is far from the screen, releases what has gone there, and shows it again',
    () =>
    withPage({ time: 1 }, async ({ page, canvas, scrolled }) => {
      const { how, server } = options();
      const [here, far] = [canvas(0), canvas(7)];
      const [a, b] = [page.add(here, hosts[0], how), page.add(far, hosts[1], how)];
      await a.firstPicture;
      expect(await until(() => a.phase === 'shown' && a.complete)).toBe(true);
      expect(b.phase).toBe('waiting');
      expect(server.log.every((l) => l.url === hosts[0])).toBe(true);
      (here as unknown as FakeCanvas).top = -7;
      (far as unknown as FakeCanvas).top = 0;
      scrolled();
      expect(await until(() => b.phase === 'shown')).toBe(true);
      expect(a.phase).toBe('released');
      expect(a.gpuBytes).toBe(0);
      const [pictures, opened] = [picturesOf(a), a.package];
      (here as unknown as FakeCanvas).top = 0;
      scrolled();
      expect(await until(() => a.phase === 'shown')).toBe(true);
      expect(a.package).toBe(opened); // its documents are still there
      expect(picturesOf(a)).toBeGreaterThan(pictures);
    }));
  it('goes on when one package cannot be had, says so where it stands, and tries again when asked', () =>
    withPage({ time: 1 }, async ({ page, canvas }) => {
      let dead = true;
      const { how } = options(({ url: asked }) => (dead && asked === hosts[1] ? 'status-404' : false));
      const models = hosts.slice(0, 3).map((u) => page.add(canvas(), u, how));
      const errors: string[] = [];
      models.forEach((m, i) =>
        m.on('error', ({ fatal, message }) => errors.push(`${i} ${fatal} ${/404/.test(message)}`)));
      expect(await until(() => models[0].phase === 'shown' && models[2].phase === 'shown')).toBe(true);
      expect(errors).toEqual(['1 true true']);
      expect(models[1].phase).toBe('failed');
      expect((await rejection(models[1].firstPicture)).message).toContain('404');
      dead = false;
      models[1].retry();
      expect(await until(() => models[1].phase === 'shown')).toBe(true);
    }));
  it('waits for a canvas of no height, and takes it when it has one', () =>
    withPage({ time: 1 }, async ({ page, canvas, scrolled }) => {
      const { how, server } = options();
      const flat = canvas(0, 0);
      const model = page.add(flat, hosts[0], how);
      await new Promise((go) => setTimeout(go, 30));
      expect(server.log.length).toBe(0);
      Object.assign(flat, { clientWidth: 80, clientHeight: 60 });
      scrolled();
      expect(await until(() => model.phase === 'shown')).toBe(true);
      expect([flat.width, flat.height]).toEqual([80, 60]);
    }));
  it('leaves nothing behind over 200 models that come and go, at whatever moment', () =>
    withPage({ time: 0.2 }, async ({ page, canvas, observed }) => {
      const { how, server } = options();
      for (let i = 0; i < 200; ++i) {
        const model = page.add(canvas(), hosts[i % hosts.length], how);
        const ended = rejection(model.firstPicture.then(() => Promise.reject(new Error('shown'))));
        if (i % 3) await new Promise((go) => setTimeout(go, i % 5));
        model.remove();
        model.remove(); // once more does no harm
        expect(['AbortError', 'Error']).toContain((await ended).name);
      }
      expect(page.models.length).toBe(0);
      expect(observed()).toBe(0);
      expect(page.gpuBytes).toBe(0);
      const asked = server.log.length;
      await new Promise((go) => setTimeout(go, 50));
      expect(server.log.length).toBe(asked); // nobody goes on asking
    }));
  it('gives a canvas that is used again to the new package', () =>
    withPage({ time: 1 }, async ({ page, canvas }) => {
      const { how } = options();
      const one = canvas();
      const [a, b] = [page.add(one, hosts[0], how), page.add(one, hosts[1], how)];
      expect(await until(() => b.phase === 'shown')).toBe(true);
      expect(a.phase).toBe('removed');
      expect(page.models).toEqual([b]);
    }));
});
