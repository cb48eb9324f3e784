// Notes at points of an object, measuring, and AR: in the element and in the viewer, by mouse and by keys.
import {axe, check, env, fs, near, path, pictures, run} from './browser.mjs';
import {test} from './harness.mjs';
import {html, onPage, settled} from './page-tests.mjs';
import {phase, shot, withViewer} from './viewer-tests.mjs';

const noted = (attributes = '', style = '') => html(`<texmesh-viewer src="/packages/noted.texmesh" alt="a statue" camera-controls ${attributes}></texmesh-viewer>`,
  `.grid{grid-template-columns:1fr}texmesh-viewer{height:600px}${style}`).replace('<title>', '<meta name="viewport" content="width=device-width"><title>');
const layer = (page) => page.locator('texmesh-viewer .tm-notes');
/** A file that the page hands out. */
async function saved(page, click) {
  const [download] = await Promise.all([page.waitForEvent('download'), click()]);
  return {name: download.suggestedFilename(), text: fs.readFileSync(await download.path(), 'utf8')};
}

test('notes: numbers, a list, keys, languages, and text that stays text', () => onPage(noted(), async (page, server) => {
  await settled(page, 1);
  const notes = layer(page), pins = notes.locator('.pin');
  await pins.first().waitFor();
  check(await pins.count() === 2, `${await pins.count()} numbers`);
  check(await pins.nth(0).evaluate((e) => !e.classList.contains('behind')) && await pins.nth(1).evaluate((e) => e.classList.contains('behind')), 'the wrong one is behind');
  await pins.nth(0).focus();
  await page.keyboard.press('ArrowRight');
  check(await pins.nth(1).evaluate((e) => e === e.getRootNode().activeElement), 'an arrow leads nowhere');
  await page.keyboard.press('Enter');
  const card = notes.locator('.card');
  check(await card.isVisible() && await card.locator('h3').textContent() === '2. <img src=x onerror=alert(1)>', await card.textContent());
  check(await card.locator('img, script').count() === 0, 'a text became markup');
  check(await card.locator('a').getAttribute('rel') === 'noopener noreferrer', 'the link says who asks');
  await page.waitForFunction(() => document.querySelector('texmesh-viewer').shadowRoot.querySelector('.pin[aria-expanded=true]:not(.behind)')?.textContent === '2');
  check(/2: <img/.test(await notes.locator('.live').textContent()), 'nothing is said');
  await card.getByRole('button', {name: 'Next'}).click();
  check(/^1\. The front/.test(await card.locator('h3').textContent()), await card.textContent());
  await page.screenshot({path: path.join(pictures, 'notes-element.png')});
  await page.keyboard.press('Escape');
  check(await card.isHidden(), 'Escape closes nothing');
  await notes.getByRole('button', {name: 'Notes (2)'}).click();
  check(await notes.locator('ol button').count() === 2, 'no list');
  check(server.requests.every((r) => !/example/.test(r.path)), 'a picture of strangers was asked for');
}), {seconds: 60});

test('notes: a tour goes from stop to stop, and fetches nothing of a package without notes', () => onPage(noted(), async (page) => {
  await settled(page, 1);
  await layer(page).locator('.pin').first().waitFor();
  const stops = await page.evaluate(() => {
    const root = document.querySelector('texmesh-viewer').shadowRoot, seen = [];
    const card = root.querySelector('.card');
    // Views that the load is asked for beside the one that is seen.
    const {load, camera} = root.host.model, {update} = load, ahead = [];
    load.update = function (view, ...rest) {
      if (view !== camera) ahead.push([seen.length, view.position.clone().normalize().dot(camera.position.clone().normalize())]);
      return update.call(this, view, ...rest);
    };
    new MutationObserver(() => { const title = card.querySelector('h3')?.textContent; if (title && seen.at(-1) !== title) seen.push(title); }).observe(card, {childList: true});
    return new Promise((resolve) => {
      root.querySelector('.list button:nth-of-type(2)').click();
      const at = performance.now();
      const look = () => (seen.length === 2 ? resolve({seen, ahead, s: (performance.now() - at) / 1000}) : setTimeout(look, 50));
      look();
    });
  });
  check(/^1/.test(stops.seen[0]) && /^2/.test(stops.seen[1]), JSON.stringify(stops));
  check(stops.s > 7 && stops.s < 11, `${stops.s} s for a stop of 8`);
  check(stops.ahead.some(([stop, cosine]) => stop === 1 && cosine < 0.9), `the next stop is not fetched ahead: ${JSON.stringify(stops.ahead)}`);
}), {seconds: 60, timed: true});

test('notes: a curator places one by Enter, writes, and saves a file that the compiler takes', () => onPage(noted('annotate'), async (page) => {
  await settled(page, 1);
  const notes = layer(page);
  await notes.getByRole('button', {name: 'Add notes'}).click();
  await page.locator('texmesh-viewer canvas').focus();
  await page.keyboard.press('Enter');
  check(await notes.locator('.pin').count() === 3, 'no note');
  await page.keyboard.type('New & <b>bold</b>');
  await notes.getByLabel('Text').fill('first line\nsecond line');
  const file = await saved(page, () => notes.getByRole('button', {name: 'Save as a file'}).click());
  const {frame, annotations} = JSON.parse(file.text);
  check(file.name === 'annotations.json' && frame === 'package' && annotations.length === 3, file.text);
  check(annotations[2].texts[0].title === 'New & <b>bold</b>' && annotations[2].texts[0].text === 'first line second line', file.text);
  near(Math.hypot(...annotations[2].normal), 1, 1e-6, 'length of the normal');
  const [scan, from, to] = ['noted-again.glb', 'noted-again.json', 'noted-again.texmesh'].map((name) => path.join(env.work, name));
  fs.writeFileSync(from, file.text);
  run(env.makeScan, '-o', scan, '--triangles', '3000', '--texture', '256', '--charts', '8', '--textures');
  run(env.texmesh, 'compile', scan, '-o', to, '--no-cache', '--quiet', '--profile', 'fast', '--strict', '--annotations', from);
  const again = JSON.parse(run(env.texmesh, 'dump', to, 'annotations', '--json')).annotations;
  check(JSON.stringify(again[2].position) === JSON.stringify(annotations[2].position), `${again[2].position} of ${annotations[2].position}`);
  await page.screenshot({path: path.join(pictures, 'notes-curator.png')});
}, {context: {acceptDownloads: true}}), {seconds: 90});

test('measuring: clicks on the object give a length with its error, in the unit of the package', () => onPage(noted('measure'), async (page) => {
  await settled(page, 1);
  const notes = layer(page);
  await notes.getByRole('button', {name: 'Measure'}).click();
  const box = await page.locator('texmesh-viewer').boundingBox();
  for (const share of [0.45, 0.55]) await page.mouse.click(box.x + box.width / 2, box.y + box.height * share);
  await page.waitForFunction(() => /±/.test(document.querySelector('texmesh-viewer').shadowRoot.querySelector('output').textContent));
  const said = await notes.locator('output').textContent();
  check(/^\d+\.\d+ cm ± 0\.\d+ cm \(S_\d+\)$/.test(said), said);
  check(Number.parseFloat(said) > 2 && Number.parseFloat(said) < 20, said);
  check(await notes.locator('circle').count() === 2, 'no points');
  await page.screenshot({path: path.join(pictures, 'measuring-element.png')});
  await notes.getByRole('button', {name: 'Clear'}).click();
  check(await notes.locator('circle').count() === 0, 'points stay');
  await page.mouse.click(box.x + 5, box.y + box.height / 2);
  check(await notes.locator('circle').count() === 0, 'a point beside the object');
}), {seconds: 60});

const kPhones = {
  iPhone: 'Mozilla/5.0 (iPhone; CPU iPhone OS 18_0 like Mac OS X) AppleWebKit/605.1.15 (KHTML, like Gecko) Version/18.0 Mobile/15E148 Safari/604.1',
  Android: 'Mozilla/5.0 (Linux; Android 14; Pixel 8) AppleWebKit/537.36 (KHTML, like Gecko) Chrome/130.0 Mobile Safari/537.36',
};
for (const [name, userAgent] of Object.entries(kPhones))
  test(`AR: ${name} is offered what it can open, on a page as large as a phone`, () => onPage(
    noted('ar ar-src="/packages/a b.glb" ios-src="/packages/a.usdz"', 'texmesh-viewer{height:420px}'), async (page, server) => {
      await settled(page, 1);
      const link = layer(page).locator('a.ar');
      await link.waitFor();
      const {x, y, width, height} = await link.boundingBox();
      check(width >= 44 && height >= 44 && x >= 0 && x + width <= 390 && y >= 0 && y + height <= 420, `${x} ${y} ${width} ${height}`);
      check(await link.evaluate((e) => e.children.length === 1 && e.firstElementChild.tagName === 'IMG' && e.textContent === ''), 'Quick Look wants one picture in the link');
      check(await link.locator('img').getAttribute('alt') === 'View in your room', 'no words');
      const href = await link.evaluate((e) => e.href);
      if (name === 'iPhone') check(href === `${server.url}/packages/a.usdz` && await link.getAttribute('rel') === 'ar', href);
      else check(href.startsWith(`intent://arvr.google.com/scene-viewer/1.2?file=${encodeURIComponent(`${server.url}/packages/a%20b.glb`)}&`) && await link.getAttribute('rel') === null, href);
      await page.screenshot({path: path.join(pictures, `ar-${name.toLowerCase()}.png`)});
    }, {context: {userAgent, viewport: {width: 390, height: 780}, deviceScaleFactor: 2, isMobile: true, hasTouch: true}}), {seconds: 60});

test('AR: a desktop is offered nothing, nor a phone without files', async () => {
  await onPage(noted('ar ar-src="/a.glb" ios-src="/a.usdz"'), async (page) => {
    await settled(page, 1);
    await layer(page).locator('.pin').first().waitFor();
    check(await layer(page).locator('.ar').count() === 0, 'a button that leads nowhere');
  });
  await onPage(noted('ar'), async (page) => {
    await settled(page, 1);
    await layer(page).locator('.pin').first().waitFor();
    check(await layer(page).locator('.ar').count() === 0, 'a button without a file');
  }, {context: {userAgent: kPhones.Android}});
}, {seconds: 60});

test('viewer: notes of a package, and measuring by a button', () => withViewer('?pkg=packages/noted.texmesh&time=1', async (page) => {
  await phase(page, 'done');
  const notes = page.locator('.tm-notes');
  await notes.locator('.pin').first().click();
  check(/The front/.test(await notes.locator('.card').textContent()), await notes.locator('.card').textContent());
  await shot(page, 'viewer-notes');
  await page.evaluate(axe);
  const {violations} = await page.evaluate(() => window.axe.run('.tm-notes', {resultTypes: ['violations']}));
  check(violations.length === 0, JSON.stringify(violations.map((v) => [v.id, v.nodes.map((n) => n.html)])));
  await page.keyboard.press('Escape');
  await page.locator('#measure').click();
  await notes.locator('output').waitFor();
  await page.locator('#view').focus();
  await page.keyboard.press('Enter');
  await page.keyboard.press('ArrowUp');
  await page.keyboard.press('Enter');
  check(/ cm ± /.test(await notes.locator('output').textContent()), await notes.locator('output').textContent());
  await shot(page, 'viewer-measuring');
  await page.locator('#measure').click();
  check(await notes.locator('output').count() === 0, 'measuring does not end');
}), {seconds: 60});

test('viewer: of a package without notes, no code for them comes until a button asks', () => withViewer('?pkg=packages/maps.texmesh&time=1', async (page, server) => {
  await phase(page, 'done');
  const scripts = () => server.requests.filter((r) => /notes.*\.js/.test(r.path)).length;
  check(scripts() === 0, `${scripts()} scripts`);
  await page.locator('#annotate').click();
  await page.locator('.tm-notes').waitFor({state: 'attached'});
  check(scripts() > 0, 'nothing came');
}), {seconds: 60});
