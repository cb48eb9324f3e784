// Forms for other viewers, each opened by the program that it is for, and the site.
import {spawn} from 'node:child_process';
import {unfurl} from 'unfurl.js';
import {axe, check, common, env, fs, here, kDesktop, kPhone, listen, near, packages, path, pictures, run, serve} from './browser.mjs';
import {test} from './harness.mjs';
import {nginxMissing, startNginx} from './nginx.mjs';

const modules = path.join(here, 'node_modules');
const published = path.join(env.work, 'published');
const roots = {
  '/out/': published, '/three/': path.join(modules, 'three'), '/tiles-renderer/': path.join(modules, '3d-tiles-renderer'),
  '/babylonjs/': path.join(modules, 'babylonjs'), '/babylonjs-loaders/': path.join(modules, 'babylonjs-loaders'),
  '/model-viewer/': path.join(modules, '@google/model-viewer/dist'), '/': path.join(here, 'page'),
};

/** `texmesh export` of one of the tests' packages into a folder of its own. */
function exported(name, target, ...more) {
  fs.mkdirSync(published, {recursive: true});
  const folder = `${target}-${name}${more.filter((m) => m.startsWith('--')).join('')}`;
  run(env.texmesh, 'export', path.join(packages, `${name}.texmesh`), '--to', target, '-o', path.join(published, folder), ...more);
  return folder;
}

/** A page of the server; nothing may be said on the console, nothing asked of elsewhere. */
async function withPage(address, body, {viewport = kDesktop, dark = false, touch = false, script = true, elsewhere = [], allowed = /^$/, origin} = {}) {
  const {browser} = await common();
  const server = origin ? null : await serve(roots, {});
  const context = await browser.newContext({viewport, colorScheme: dark ? 'dark' : 'light', hasTouch: touch, deviceScaleFactor: touch ? 2 : 1, javaScriptEnabled: script});
  const page = await context.newPage();
  listen(page);
  for (const {url, file, type} of elsewhere)
    await page.route(url, (route) => route.fulfill({body: fs.readFileSync(file(route.request().url())), contentType: type, headers: {'Access-Control-Allow-Origin': '*'}}));
  try {
    const base = origin ?? server.url;
    await page.goto(`${base}/${address}`);
    await body(page, base, server);
    const said = page.said.filter((text) => !allowed.test(text));
    check(said.length === 0, said.join('\n'));
    const other = page.wentTo.filter((u) => !u.startsWith(base) && !/^(blob|data):/.test(u) && !elsewhere.some(({url}) => url.test(u)));
    check(other.length === 0, `asked elsewhere: ${other.join(' ')}`);
  } finally {
    await context.close();
    await server?.close();
  }
}

const shot = (page, name) => page.screenshot({path: path.join(pictures, `${name}.png`)});

/** What 3D Tiles 1.1 lets stand in each object; `extras` may stand in all. */
const kTileWords = {
  tileset: ['asset', 'geometricError', 'root'], asset: ['version', 'tilesetVersion'], content: ['uri', 'boundingVolume'], boundingVolume: ['box'],
  tile: ['boundingVolume', 'geometricError', 'refine', 'transform', 'content', 'children'],
};
const inWords = (object, kind) => check(Object.keys(object).every((k) => k === 'extras' || kTileWords[kind].includes(k)), `${kind}: ${Object.keys(object)}`);

/** Tiles of a tileset from the outside in, checked by what 3D Tiles 1.1 says and by what viewers rely on: one box within the other. */
function chainOf(tileset, folder) {
  inWords(tileset, 'tileset');
  inWords(tileset.asset, 'asset');
  check(tileset.asset.version === '1.1' && tileset.geometricError > 0, JSON.stringify(tileset.asset));
  check(tileset.root.refine === 'REPLACE', 'the root says how it refines');
  const tiles = [];
  let outside;
  for (let tile = tileset.root, above = tileset.geometricError; tile; [above, tile] = [tile.geometricError, tile.children?.[0]]) {
    inWords(tile, 'tile');
    inWords(tile.boundingVolume, 'boundingVolume');
    inWords(tile.content, 'content');
    const {box} = tile.boundingVolume;
    check(box.length === 12 && box.every(Number.isFinite) && box[3] > 0 && box[7] > 0 && box[11] > 0, `box ${box}`);
    check([4, 5, 6, 8, 9, 10].every((k) => box[k] === 0), `a box that is turned: ${box}`);
    for (const k of [0, 1, 2]) {
      const half = (b) => b[3 + 4 * k];
      check(!outside || Math.abs(box[k] - outside[k]) + half(box) <= half(outside) * (1 + 1e-9), `a tile reaches out of its parent along ${'xyz'[k]}`);
    }
    outside = box;
    const m = tile.transform;
    check(!m || (m.length === 16 && m.every(Number.isFinite) && [m[3], m[7], m[11], m[15]].join() === '0,0,0,1'), `transform ${m}`);
    check(Number.isFinite(tile.geometricError) && tile.geometricError >= 0 && tile.geometricError <= above, `error ${tile.geometricError} in ${above}`);
    check((tile.children?.length ?? 1) === 1 && /^level-\d\.glb$/.test(tile.content.uri), tile.content.uri);
    const glb = fs.readFileSync(path.join(folder, tile.content.uri));
    check(glb.toString('latin1', 0, 4) === 'glTF' && glb.readUInt32LE(4) === 2 && glb.readUInt32LE(8) === glb.length, `${tile.content.uri} is no GLB`);
    tiles.push(tile);
  }
  check(tiles.at(-1).geometricError === 0, 'the innermost tile has no error');
  return tiles;
}

for (const name of ['large', 'colours']) {
  test(`export: a tileset in 3d-tiles-renderer (${name})`, async () => {
    const folder = exported(name, '3dtiles');
    const tiles = chainOf(JSON.parse(fs.readFileSync(path.join(published, folder, 'tileset.json'))), path.join(published, folder));
    check(tiles.length >= 2, `${tiles.length} tiles`);
    const seen = [];
    await withPage('tiles.html', async (page, base) => {
      await page.waitForFunction('window.ready');
      for (const px of [20, 400, 4000]) {
        const r = await page.evaluate(([u, p]) => window.door.tiles(u, p), [`${base}/out/${folder}/tileset.json`, px]);
        check(r.still >= 10 && r.seen.length === 1, JSON.stringify(r));
        check(r.target === 16, `the renderer asks for ${r.target} px`);
        check(r.covered > 0.05 * Math.min(px, 512) ** 2, `${r.covered} px are covered at ${px} px`);
        // Up is +Z: the height that the source has along y. And the box is where the picture is.
        const {box} = tiles[0].boundingVolume;
        for (const [k, half] of [3, 7, 11].entries()) near(r.size[k], 2 * box[half], 0.05 * r.size[k], `side ${k} of what is shown`);
        const place = tiles[0].transform?.slice(12, 15) ?? [0, 0, 0];
        for (const k of [0, 1, 2]) near(r.centre[k], box[k] + place[k], 0.05 * Math.hypot(...r.size), `centre ${k}`);
        seen.push(tiles.findIndex((t) => t.content.uri === r.seen[0]));
        await shot(page, `tiles-${name}-${px}`);
      }
    }, {allowed: /tiles versions at 1\.1 or higher have limited support/}); // the renderer says so of every such tileset
    check(seen[0] <= seen[1] && seen[1] <= seen[2] && (seen[0] < seen[2] || name === 'colours') && seen[2] === tiles.length - 1, `levels ${seen} of ${tiles.length}`);
  }, {seconds: 120});
}

test('export: levels of detail in three.js', async () => {
  const folder = exported('maps', 'gltf-lod');
  const single = path.join(published, 'maps-s0.glb');
  run(env.texmesh, 'extract', path.join(packages, 'maps.texmesh'), '--scale', '0', '-o', single);
  await withPage('tiles.html', async (page, base) => {
    await page.waitForFunction('window.ready');
    const glb = (file) => page.evaluate((u) => window.door.glb(u), `${base}/out/${file}`);
    const one = await glb('maps-s0.glb'), lods = await glb(`${folder}/model.glb`); // one after the other: they share a renderer
    check(lods.triangles === one.triangles, `${lods.triangles} triangles are shown, S_0 has ${one.triangles}`);
    check(lods.images === one.images && one.images > 1, `${lods.images} images, a file of one scale has ${one.images}`);
    check(lods.extensions.includes('MSFT_lod') && lods.lod.extensions.MSFT_lod.ids.length >= 1, JSON.stringify(lods.extensions));
    const coverage = lods.lod.extras.MSFT_screencoverage;
    check(coverage.length === lods.lod.extensions.MSFT_lod.ids.length + 1 && coverage.every((c, k) => k === 0 || c <= coverage[k - 1]), `${coverage}`);
    check(lods.covered > 10000, 'nothing is drawn');
    for (const k of [0, 1, 2]) near(lods.centre[k], one.centre[k], 0.05 * Math.hypot(...one.size), `centre ${k}`);
    await shot(page, 'lods');
  });
}, {seconds: 90});

for (const [name, least] of [['maps', 2], ['chain', 12]]) {
  test(`unpack: GLBs of the scales of ${name} open in three.js by their URLs`, async () => {
    fs.mkdirSync(published, {recursive: true});
    const package_ = path.join(packages, `${name}.texmesh`), tree = path.join(published, `tree-${name}`);
    fs.rmSync(tree, {recursive: true, force: true});
    run(env.texmesh, 'unpack', package_, '-o', tree);
    const {scales} = JSON.parse(run(env.texmesh, 'dump', package_, 'scales', '--json'));
    const files = fs.readdirSync(path.join(tree, 'gltf')).filter((f) => f.endsWith('.glb')).map((f) => `gltf/${f}`);
    const ends = [scales[0], scales.at(-1)].map(({scale}) => `mesh/s${String(scale).padStart(2, '0')}.glb`);
    check(files.length + ends.length >= least, `${files} beside ${ends}`);
    await withPage('tiles.html', async (page, base) => {
      await page.waitForFunction('window.ready');
      const images = JSON.parse(fs.readFileSync(path.join(tree, 'textures.json'), 'utf8')).textures.filter((t) => !t.mip).length;
      for (const file of [...files, ...ends]) {
        const r = await page.evaluate((u) => window.door.glb(u), `${base}/out/tree-${name}/${file}`);
        const {triangles} = scales.find(({scale}) => scale === Number(/\d+/.exec(file)[0]));
        check(r.triangles <= triangles && r.triangles > 0.89 * triangles, `${file}: ${r.triangles} triangles, the scale has ${triangles}`);
        check(r.images === images, `${file}: ${r.images} images of ${images}`);
        check(r.covered > 10000, `${file}: nothing is drawn`);
        await shot(page, `tree-${name}-${path.basename(file, '.glb')}`);
      }
    });
  }, {seconds: 90});
}

test('export: levels of detail in Babylon.js, the coarsest first', async () => {
  const folder = exported('maps', 'gltf-lod');
  const {scales} = JSON.parse(run(env.texmesh, 'dump', path.join(packages, 'maps.texmesh'), 'scales', '--json'));
  await withPage('babylon.html', async (page, base) => {
    await page.waitForFunction('window.ready');
    const levels = await page.evaluate((u) => window.door.levels(u), `${base}/out/${folder}/model.glb`);
    const [first, last] = [levels[0], levels.at(-1)];
    check(levels.length > 1 && last.triangles === scales[0].triangles, `${levels.map((l) => l.triangles)} triangles, S_0 has ${scales[0].triangles}`);
    check(levels.every((l, k) => k === 0 || l.triangles >= levels[k - 1].triangles) && first.triangles < last.triangles, levels.map((l) => l.triangles).join());
    check(levels.every((l) => l.textures === last.textures) && last.textures > 1, `${levels.map((l) => l.textures)} textures`);
    check(levels.every((l) => l.covered > 10000 && l.covered < 0.9 * 512 ** 2), `${levels.map((l) => l.covered)} px are covered`);
    for (const l of levels) for (const k of [0, 1, 2]) near(l.size[k], last.size[k], 0.1 * Math.hypot(...last.size), `side ${k}`);
    await shot(page, 'lods-babylon');
  });
}, {seconds: 120});

/** The script and its licence, as a build of the viewer has them. */
function modelViewerFolder() {
  const folder = path.join(published, 'script');
  fs.mkdirSync(folder, {recursive: true});
  for (const file of ['dist/model-viewer.min.js', 'LICENSE']) fs.copyFileSync(path.join(modules, '@google/model-viewer', file), path.join(folder, path.basename(file)));
  return folder;
}
/** What <model-viewer> says of itself once it shows something. */
const modelShown = (page) => page.waitForFunction(() => document.querySelector('model-viewer').loaded, null, {timeout: 45000});

test('export: 220 materials, each with a texture, in all that read GLBs', async () => {
  fs.copyFileSync(path.join(env.source, 'tests/golden/v2.0-planes.texmesh'), path.join(packages, 'planes.texmesh'));
  const [tileset, lods] = ['3dtiles', 'gltf-lod'].map((target) => exported('planes', target));
  const single = exported('planes', 'model-viewer', '--plain', '--script', '../../model-viewer/model-viewer.min.js');
  await withPage('tiles.html', async (page, base) => {
    await page.waitForFunction('window.ready');
    const one = await page.evaluate((u) => window.door.glb(u), `${base}/out/${single}/model.glb`);
    check(one.images === 220 && one.covered > 10000, JSON.stringify(one));
    const tiles = await page.evaluate(([u, p]) => window.door.tiles(u, p), [`${base}/out/${tileset}/tileset.json`, 4000]);
    check(tiles.seen.join() === 'level-0.glb' && tiles.covered > 10000, JSON.stringify(tiles));
  }, {allowed: /tiles versions at 1\.1 or higher have limited support/});
  await withPage('babylon.html', async (page, base) => {
    await page.waitForFunction('window.ready');
    const levels = await page.evaluate((u) => window.door.levels(u), `${base}/out/${lods}/model.glb`);
    check(levels.at(-1).textures === 220 && levels.at(-1).covered > 1000, JSON.stringify(levels));
  });
  await withPage(`out/${single}/index.html`, (page) => modelShown(page), {allowed: /rAF timed out/}); // on a busy machine
}, {seconds: 150});

for (const [name, how, options] of [
  ['maps', 'plain', {}], ['colours', 'plain', {viewport: kPhone, touch: true}], ['maps', 'draco', {dark: true}],
]) {
  test(`export: a page with model-viewer (${name}, ${how}${options.touch ? ', phone' : ''})`, async () => {
    const folder = exported(name, 'model-viewer', '--viewer', modelViewerFolder(), ...(how === 'plain' ? ['--plain'] : []));
    // Its decoder of Draco comes from Google.
    const elsewhere = how === 'plain' ? [] : [{
      url: /^https:\/\/www\.gstatic\.com\/draco\//, type: 'application/wasm',
      file: (url) => path.join(modules, 'three/examples/jsm/libs/draco/gltf', path.basename(url)),
    }];
    await withPage(`out/${folder}/index.html`, async (page) => {
      await modelShown(page);
      await page.waitForTimeout(500);
      await shot(page, `model-viewer-${name}-${how}`);
      const picture = await page.locator('model-viewer').screenshot();
      check(picture.length > 8000, 'the picture is empty');
      check(!(await page.evaluate(() => document.documentElement.scrollWidth > innerWidth)), 'wider than the screen');
      await page.evaluate(axe);
      const {violations} = await page.evaluate(() => window.axe.run(document, {resultTypes: ['violations']}));
      check(violations.length === 0, violations.map((v) => `${v.id}: ${v.nodes[0].html}`).join('\n'));
    }, {...options, elsewhere, allowed: /rAF timed out/}); // on a busy machine
  }, {seconds: 90});
}

test('export: the build takes the version of model-viewer that is tested', () => {
  const {devDependencies} = JSON.parse(fs.readFileSync(path.join(env.source, 'examples/viewer/package.json')));
  const {version} = JSON.parse(fs.readFileSync(path.join(modules, '@google/model-viewer/package.json')));
  check(devDependencies['@google/model-viewer'] === version, `${devDependencies['@google/model-viewer']}, tests ${version}`);
});

test('export: an oEmbed answer, and its frame on a page of others', async () => {
  const {browser} = await common();
  const [server, other] = [await serve(roots, {}), await serve({'/': published}, {})];
  const page = await browser.newPage({viewport: kDesktop});
  listen(page);
  try {
    exported('maps', 'oembed', '--url', `${server.url}/out/frame/`, '--viewer', env.viewer, '--width', '700');
    fs.rmSync(path.join(published, 'frame'), {recursive: true, force: true});
    fs.renameSync(path.join(published, 'oembed-maps--url--viewer--width'), path.join(published, 'frame'));
    // As a consumer finds it: the object's page, its link, the answer, the HTML.
    await page.goto(`${server.url}/out/frame/index.html`);
    const href = await page.locator('link[type="application/json+oembed"]').getAttribute('href');
    check(href === `${server.url}/out/frame/oembed.json`, href);
    const answer = await (await fetch(href)).json();
    check(answer.type === 'rich' && answer.version === '1.0' && answer.width === 700 && answer.html.includes('<iframe'), JSON.stringify(answer));
    // A program that makes previews of links finds the same.
    const {oEmbed} = await unfurl(`${server.url}/out/frame/index.html`);
    check(oEmbed?.type === 'rich' && oEmbed.html === answer.html.replaceAll('&amp;', '&') && oEmbed.width === 700 && oEmbed.thumbnails[0].url === answer.thumbnail_url, JSON.stringify(oEmbed));
    const thumbnail = await fetch(answer.thumbnail_url);
    check(thumbnail.ok && thumbnail.headers.get('content-type') === 'image/jpeg', `${answer.thumbnail_url}: ${thumbnail.status}`);
    fs.writeFileSync(path.join(published, 'other.html'), `<!doctype html><html lang="en"><title>others</title><link rel="icon" href="data:,"><p>A page of others.</p>${answer.html}`);
    await page.goto(`${other.url}/other.html`);
    await page.locator('iframe').scrollIntoViewIfNeeded();
    const frame = await (await page.waitForSelector('iframe')).contentFrame();
    await frame.waitForFunction(() => window.texmeshViewer?.session.live.phase === 'done', null, {timeout: 60000});
    check(await frame.locator('#toggle').getAttribute('aria-expanded') === 'false', 'the panel is open');
    await shot(page, 'oembed');
    check((await page.locator('iframe').screenshot()).length > 8000, 'the frame is empty');
    check(page.said.length === 0, page.said.join('\n'));
  } finally {
    await page.close();
    await Promise.all([server.close(), other.close()]);
  }
}, {seconds: 90});

/** A site of the tests' packages, once. */
let made;
function site() {
  if (made) return made;
  const www = path.join(published, 'www');
  fs.mkdirSync(published, {recursive: true});
  run(env.texmesh, 'site', path.join(packages, 'alone'), '-o', www, '--viewer', env.viewer, '--title', 'Scans of the tests');
  return (made = www);
}

/** How far things moved after they had been there: Cumulative Layout Shift. */
const kWatchShifts = () => {
  window.shifts = 0;
  new PerformanceObserver((list) => { for (const e of list.getEntries()) if (!e.hadRecentInput) window.shifts += e.value; }).observe({type: 'layout-shift', buffered: true});
};

for (const [name, options] of [['desktop', {}], ['desktop-dark', {dark: true}], ['phone', {viewport: kPhone, touch: true}], ['phone-dark', {viewport: kPhone, touch: true, dark: true}]]) {
  test(`site: list and object, nothing moves, axe, nothing asked elsewhere (${name})`, async () => {
    site();
    const looked = async (page, what) => {
      await page.evaluate(axe);
      const {violations, passes} = await page.evaluate(() => window.axe.run(document, {resultTypes: ['violations', 'passes']}));
      check(passes.length > 8, `${passes.length} rules were looked at`);
      check(violations.length === 0, violations.map((v) => `${what}: ${v.id}: ${v.nodes[0].html} ${v.nodes[0].failureSummary}`).join('\n'));
      check(!(await page.evaluate(() => document.documentElement.scrollWidth > innerWidth)), `${what}: wider than the screen`);
    };
    await withPage('out/www/index.html', async (page, base) => {
      await page.evaluate(kWatchShifts);
      await page.waitForLoadState('networkidle');
      await shot(page, `site-${name}`);
      check(await page.locator('#objects > li').count() === fs.readdirSync(path.join(packages, 'alone')).length, 'a package is missing');
      check(await page.evaluate(() => [...document.images].every((i) => i.loading === 'lazy' || i.naturalWidth > 0)), 'a poster did not come');
      await page.evaluate(() => scrollTo(0, document.body.scrollHeight));
      await page.waitForTimeout(400);
      check(await page.evaluate(() => window.shifts) < 0.01, `shifts of ${await page.evaluate(() => window.shifts)}`);
      await looked(page, 'list');
      await page.goto(`${base}/out/www/objects/maps.html`);
      await page.evaluate(kWatchShifts);
      await page.waitForLoadState('networkidle');
      await shot(page, `site-object-${name}`);
      await looked(page, 'object');
      check(page.wentTo.every((u) => !u.includes('/viewer/')), 'the viewer comes before it is asked for');
      await page.locator('#show').click();
      const frame = await (await page.waitForSelector('iframe')).contentFrame();
      await frame.waitForFunction(() => window.texmeshViewer?.session.live.phase === 'done', null, {timeout: 60000});
      await page.waitForTimeout(300);
      await shot(page, `site-3d-${name}`);
      check(await page.evaluate(() => window.shifts) < 0.01, `shifts of ${await page.evaluate(() => window.shifts)}`);
      check((await page.locator('iframe').screenshot()).length > 8000, 'the frame is empty');
    }, options);
  }, {seconds: 120});
}

test('site: search and keyboard', async () => {
  site();
  await withPage('out/www/index.html', async (page) => {
    await page.keyboard.press('Tab');
    check(await page.evaluate(() => document.activeElement.className) === 'skip', 'the first key leads past the head');
    await page.keyboard.press('Tab');
    await page.keyboard.type('MAPS');
    await page.waitForFunction(() => document.querySelectorAll('#objects > li:not([hidden])').length === 1);
    check(/^1 of \d+ objects$/.test(await page.locator('#count').textContent()), await page.locator('#count').textContent());
    check(page.url().endsWith('?q=MAPS'), page.url());
    await page.reload();
    check(await page.locator('#objects > li:not([hidden])').count() === 1, 'the search is forgotten');
    await page.locator('#search').focus();
    for (const leads of ['SELECT', 'A']) {
      await page.keyboard.press('Tab');
      check(await page.evaluate(() => document.activeElement.tagName) === leads, `no ${leads}`);
    }
    await page.keyboard.press('Enter');
    await page.waitForURL(/objects\/maps\.html$/);
    await page.locator('#show').focus();
    await page.keyboard.press('Enter');
    const frame = await (await page.waitForSelector('iframe')).contentFrame();
    await frame.waitForFunction(() => window.texmeshViewer?.session.live.phase === 'done', null, {timeout: 60000});
    check(await page.evaluate(() => document.activeElement.tagName) === 'IFRAME', 'the focus is lost');
  });
}, {seconds: 90});

test('site: a choice and the search work together', async () => {
  site();
  await withPage('out/www/index.html', async (page) => {
    const shown = () => page.locator('#objects > li:not([hidden]) strong').allTextContents();
    const all = await shown();
    await page.locator('[data-facet=licence]').selectOption('CC-BY-4.0');
    check((await shown()).join() === 'Told', (await shown()).join());
    check(/^1 of \d+ objects$/.test(await page.locator('#count').textContent()), await page.locator('#count').textContent());
    await page.locator('#search').fill('maps');
    check((await shown()).length === 0, 'a choice that the search overrules');
    await page.locator('[data-facet=licence]').selectOption('');
    await page.locator('#search').fill('');
    check((await shown()).length === all.length, 'something stays hidden');
  });
});

test('site: without scripts the objects are links to the viewer', async () => {
  site();
  await withPage('out/www/index.html', async (page) => {
    check(await page.locator('.search').isHidden(), 'a search that does nothing');
    await page.locator('#objects a').first().click();
    check(/viewer\/index\.html\?panel=none&pkg=/.test(await page.locator('#show').getAttribute('href')), 'no link to the viewer');
  }, {script: false});
});

test('site: behind nginx', async ({skip}) => {
  if (nginxMissing(false)) skip(nginxMissing(false));
  const nginx = await startNginx({roots: {'/': site()}});
  try {
    await withPage('index.html', async (page) => {
      await page.getByRole('link', {name: 'maps'}).click();
      await page.locator('#show').click();
      const frame = await (await page.waitForSelector('iframe')).contentFrame();
      await frame.waitForFunction(() => window.texmeshViewer?.session.live.phase === 'done', null, {timeout: 60000});
      check(/"GET \/packages\/maps\.[0-9a-f]{16}\.texmesh[^"]*" 206/.test(nginx.log()), 'no ranges');
    }, {origin: nginx.url});
  } finally { nginx.close(); }
}, {seconds: 90});

test('site: from a server of files without ranges (python3 -m http.server)', async () => {
  const python = spawn('python3', ['-u', '-m', 'http.server', '0', '--bind', '127.0.0.1', '--directory', site()], {stdio: ['ignore', 'pipe', 'ignore']});
  try {
    const port = await new Promise((done, fail) => {
      python.on('error', fail);
      let said = '';
      python.stdout.on('data', (text) => {
        const [, found] = /port (\d+)/.exec((said += text)) ?? [];
        if (found) done(found);
      });
    });
    await withPage('index.html', async (page) => {
      await page.getByRole('link', {name: 'maps'}).click();
      await page.locator('#show').click();
      const frame = await (await page.waitForSelector('iframe')).contentFrame();
      await frame.waitForFunction(() => window.texmeshViewer?.session.live.phase === 'done', null, {timeout: 60000});
    }, {origin: `http://127.0.0.1:${port}`, allowed: /404/}); // a tree beside the package is asked for
  } finally { python.kill(); }
}, {seconds: 90});

test('site: from files the list is there', async () => {
  const www = site();
  const {browser} = await common();
  const page = await browser.newPage({viewport: kDesktop});
  listen(page);
  await page.goto(`file://${www}/index.html`);
  check(await page.evaluate(() => getComputedStyle(document.querySelector('#objects')).display) === 'grid', 'no style');
  check(await page.evaluate(() => document.images[0].naturalWidth > 0), 'no poster');
  await page.locator('#search').fill('maps');
  await page.waitForFunction(() => document.querySelectorAll('#objects > li:not([hidden])').length === 1);
  check(page.said.length === 0, page.said.join('\n'));
  await page.close();
});
