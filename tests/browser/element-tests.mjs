// <texmesh-viewer> as pages use it: what it says before the click, whose the object is, attributes and slots as <model-viewer> has them.
import {check, env, fs, near, path} from './browser.mjs';
import {test} from './harness.mjs';
import {covered, html, onPage, settled} from './page-tests.mjs';

const one = (attributes, inside = '', name = 'maps') => html(`<texmesh-viewer src="/packages/${name}.texmesh" ${attributes}>${inside}</texmesh-viewer>`);
const element = (page) => page.locator('texmesh-viewer');
const inside = (page, selector, read) => element(page).evaluate((e, [s, r]) => new Function('part', `return ${r}`)(e.shadowRoot.querySelector(s)), [selector, read]);
/** Degrees round the vertical axis and from it, and radii from the object's middle. */
const orbit = (page) => element(page).evaluate((e) => {
  const {model: {camera, package: {manifest: {boundsMin: a, boundsMax: b}}}} = e;
  const [x, y, z] = ['x', 'y', 'z'].map((axis, k) => camera.position[axis] - (a[k] + b[k]) / 2);
  const away = Math.hypot(x, y, z);
  return [Math.atan2(x, z), Math.acos(y / away)].map((r) => r * 180 / Math.PI).concat(away);
});
const loaded = (page) => page.waitForFunction(() => document.querySelector('texmesh-viewer').loaded, null, {timeout: 30000});

for (const [file, count] of [['README.md', 1], ['docs/tutorial.md', 2]])
  test(`the element: the page of ${file} shows its objects`, async () => {
    const [, shown] = /```html\n([^]*?)```/.exec(fs.readFileSync(path.join(env.source, file), 'utf8'));
    const text = shown.replaceAll('src="viewer/', 'src="/viewer/').replaceAll(/src="packages\/[^"]*"/g, 'src="/packages/maps.texmesh"');
    await onPage(`<link rel="icon" href="data:,">${text}`, async (page) => {
      await settled(page, count);
      check(await covered(page, 0, `printed-${count}`) > 0.02, 'nothing is shown');
    });
  });

test('the element: attribution and licence stand beside the object, as text whatever they hold', async () => {
  await onPage(one('alt="a statue"', '', 'told'), async (page) => {
    await settled(page, 1);
    const rights = element(page).locator('.rights');
    await page.waitForFunction(() => document.querySelector('texmesh-viewer').shadowRoot.querySelector('.rights').textContent !== '');
    check(await rights.textContent() === '<img src=x onerror=alert(1)> Museum of Casts · CC-BY-4.0', await rights.textContent());
    check(await rights.isVisible() && await rights.locator('img').count() === 0, 'no text, or more than text');
    const link = rights.locator('a');
    check(await link.getAttribute('rel') === 'license noopener', 'another relation');
    check(/^https:\/\/(spdx|creativecommons)\.org\//.test(await link.getAttribute('href')), await link.getAttribute('href'));
    await element(page).evaluate((e) => e.setAttribute('src', '/packages/maps.texmesh'));
    await loaded(page);
    check(await rights.textContent() === '', 'the rights of another object stay');
  });
});

test('the element: where nobody has said the bytes, the server is asked for them alone; the time is that of the page\'s own files', async () => {
  await onPage(one('reveal="manual" camera-controls'), async (page, server) => {
    const offer = () => inside(page, 'button small', 'part.textContent');
    await page.waitForFunction(() => /in all/.test(document.querySelector('texmesh-viewer').shadowRoot.querySelector('button small').textContent));
    check(/^45 kB, .*second.*; up to [\d.]+ [kM]B in all$/.test(await offer()), await offer());
    const asked = server.requests.filter((r) => /texmesh$/.test(r.path));
    check(asked.length === 1 && asked[0].method === 'HEAD', JSON.stringify(asked));
    await element(page).evaluate((e) => e.dismissPoster());
    await loaded(page);
    check(await inside(page, 'button.box', 'part.hidden'), 'the offer stays');
  }, {before: () => Object.defineProperty(navigator, 'connection', {value: undefined})});
});

test('the element: camera-orbit, auto-rotate, rotation-per-second and disable-zoom mean what they mean to model-viewer', async () => {
  await onPage(one('camera-controls auto-rotate rotation-per-second="-90deg" camera-orbit="30deg 60deg 150%"'), async (page) => {
    await loaded(page);
    const [turning, up, away] = await orbit(page);
    near(up, 60, 0.01, 'degrees from the vertical axis');
    await page.waitForTimeout(500);
    const turned = ((turning - (await orbit(page))[0]) % 360 + 360) % 360;
    check(turned > 15 && turned < 90, `${turned} degrees in half a second and a little more, to the left`);
    const set = (name, value) => element(page).evaluate((e, [n, v]) => (v === null ? e.removeAttribute(n) : e.setAttribute(n, v)), [name, value]);
    await set('auto-rotate', null);
    await set('camera-orbit', '0.5rad 90deg 75%');
    near((await orbit(page))[0], 0.5 * 180 / Math.PI, 0.01, 'degrees round the vertical axis');
    near((await orbit(page))[2], away / 2, 1e-6 * away, 'half as far');
    await element(page).evaluate((e) => e.shadowRoot.querySelector('canvas').focus());
    await page.keyboard.press('+');
    check((await orbit(page))[2] < 0.49 * away, 'plus comes no nearer');
    await page.keyboard.press('Home');
    await set('disable-zoom', '');
    await page.keyboard.press('+');
    await page.mouse.move(200, 100);
    await page.mouse.wheel(0, -200);
    near((await orbit(page))[2], away / 2, 1e-6 * away, 'zoomed all the same');
    await page.keyboard.press('ArrowLeft');
    near((await orbit(page))[0], 0.5 * 180 / Math.PI - 6, 0.01, 'a key turns it');
  });
});

test('the element: slots for poster and progress, a class of its own for who cannot turn it', async () => {
  await onPage(one('alt="a statue" touch-action="none"', '<b slot="poster">a poster</b><i slot="progress-bar">a bar</i><em>more</em>'), async (page) => {
    const shown = (selector) => page.locator(selector).evaluate((e) => e.assignedSlot?.name ?? 'none');
    check(await shown('b') === 'poster' && await shown('i') === 'progress-bar' && await shown('em') === '', 'a slot is missing');
    check(await inside(page, '.bar', 'getComputedStyle(part).display') === 'none' || await inside(page, '.bar', 'part.getClientRects().length') === 0, 'the bar stands beside the one in its place');
    await loaded(page);
    check(await inside(page, '.poster', 'part.classList.contains("gone")'), 'the poster stays');
    check(await inside(page, 'canvas', 'part.style.touchAction') === 'none', 'touch-action');
    // What can only be looked at stops no key and promises none.
    check(await inside(page, 'canvas', 'part.hasAttribute("tabindex") || part.hasAttribute("aria-describedby")') === false, 'keys lead to a picture that does nothing');
    await element(page).evaluate((e) => e.setAttribute('camera-controls', ''));
    check(await inside(page, 'canvas', 'part.tabIndex') === 0, 'no key leads to it');
    check(await covered(page, 0, 'element-slots') > 0.05, 'nothing is seen');
  });
});
