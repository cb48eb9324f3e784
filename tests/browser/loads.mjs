// Loads on the laboratory page, and what they must come to.
import {PNG, check, common, env, fs, lab, labPage, labRoots, packages, path, run, serve} from './browser.mjs';
import {startLink} from './link.mjs';

export const kTop = 99; // clipped to the highest rung there is
export const kEverything = {time: 1e9, scale: 0, rung: kTop, fullSize: true, autoRefine: false};

/** Loads one package on a new page and gives its report. */
export async function loaded(browser, page_, url, options = {}) {
  const page = page_ ?? await labPage(browser.browser, browser.url);
  if (page_ === null) await lab(page, () => window.lab.start({size: 256}));
  const id = await lab(page, ([u, o]) => window.lab.load(u, o), [url, options]);
  return {page, id, ...await lab(page, (i) => window.lab.finished(i), id)};
}

/** Differences of a composed plane from the C++ reconstruction, over stored fragments; `degrees`: mean angle, where the colours are normals. */
export async function comparePlane(page, id, base, name, quality) {
  const got = await lab(page, ([i, b]) => window.lab.plane(i, b), [id, base]);
  const file = path.join(env.work, `${name}-${got.plane}-${quality}.png`);
  run(env.compose, path.join(packages, `${name}.texmesh`), String(got.plane), String(quality), file);
  const wanted = PNG.sync.read(fs.readFileSync(file));
  check(wanted.width === got.widthPx && wanted.height === got.heightPx, `plane ${got.plane} is ${got.widthPx} x ${got.heightPx}, not ${wanted.width} x ${wanted.height}`);
  const data = Buffer.from(got.base64, 'base64');
  let [most, sum, n, angles, normals] = [0, 0, 0, 0, 0];
  const normal = (of, i) => [0, 1, 2].map((c) => of[i + c] - 127.5);
  for (let i = 0; i < wanted.data.length; i += 4) {
    if (wanted.data[i + 3] === 0) continue; // not stored
    const [a, z] = [normal(wanted.data, i), normal(data, i)];
    if (a[2] > 12) { // make_scan's normals point into the surface, too, as none of a scan do
      normals++;
      angles += Math.acos(Math.min(1, (a[0] * z[0] + a[1] * z[1] + a[2] * z[2]) / (Math.hypot(...a) * Math.hypot(...z))));
    }
    for (let c = 0; c < 3; c++) {
      const d = Math.abs(wanted.data[i + c] - data[i + c]);
      most = Math.max(most, d);
      sum += d;
      n++;
    }
  }
  return {most, mean: n ? sum / n : 0, n, degrees: normals ? angles / normals * 180 / Math.PI : 0};
}

export const kTopQuality = 100;
/** A load whose texture must be right in the end, from a server of the given kind. */
export async function rightFrom(b, origin, file, {page = null, options = {}} = {}) {
  const r = await loaded({browser: b.browser, url: origin}, page, `${origin}/packages/${file}`, {load: kEverything, ...options});
  check(!r.error, JSON.stringify(r.error));
  const d = await comparePlane(r.page, r.id, r.state.planes[0].base, path.basename(file.replace(/\/$/, '').replace(/\.texmesh$/, '')), kTopQuality);
  check(d.most <= 3, `texture differs by ${d.most}`);
  return r;
}

/** `body` gets a page whose origin is behind a link of 2 Mbit/s and 40 ms, or as `options` say, from now on. */
export async function throttled(options, body) {
  const b = await common();
  const server = await serve(labRoots);
  const link = await startLink({target: server.port});
  let page;
  try {
    page = await labPage(b.browser, link.url);
    await lab(page, async () => { await window.lab.draco.preload().decoderPending; window.lab.start({size: 900}); });
    await link.set({bytesPerSecond: 250000, rttMs: 40, ...options});
    await body(page, link, `${link.url}/packages/large.texmesh`);
  } finally {
    await page?.close();
    link.close();
    await server.close();
  }
}
