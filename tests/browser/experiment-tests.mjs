// texmesh-lab experiment: the page that judges see, simulated judges who use it, and the fit of what they answer.
import {check, common, env, fs, listen, near, path, pictures, run, serve} from './browser.mjs';
import {test} from './harness.mjs';

const root = path.join(env.work, 'experiment');
const kPost = 'https://judges.test/results';
const kDesktop = {viewport: {width: 1280, height: 800}};
const kPhone = {viewport: {width: 390, height: 844}, deviceScaleFactor: 3, hasTouch: true, isMobile: true};

/** A folder of that experiment, made once, and its design. */
function experiment(name, ...options) {
  const folder = path.join(root, name);
  fs.rmSync(folder, {recursive: true, force: true});
  fs.mkdirSync(root, {recursive: true});
  run(env.lab, 'experiment', 'make', '-o', folder, ...options);
  return {folder, design: JSON.parse(fs.readFileSync(path.join(folder, 'design.json')))};
}

/** Serves an experiment and opens its page; `said` and `wentTo` as listen() keeps them. */
async function opened({folder}, {context = kDesktop, judge, prepare} = {}) {
  const [{browser}, server] = [await common(), await serve({'/': folder})];
  const own = await browser.newContext(context);
  const page = await own.newPage();
  listen(page);
  if (prepare) await prepare(page);
  await page.goto(`${server.url}/index.html`);
  await page.waitForSelector('#welcome:not([hidden])');
  if (judge) await page.fill('#judge', judge);
  return {page, server, close: async () => { await own.close(); await server.close(); }};
}

/** Agrees and measures the screen: `cssPxPerMm` is what the card would show. */
async function begin({page}, cssPxPerMm = 96 / 25.4) {
  await page.check('#agree');
  await page.click('#start button[type=submit]');
  await measure({page}, cssPxPerMm);
}

async function measure({page}, cssPxPerMm) {
  await page.waitForSelector('#display:not([hidden])');
  const upright = /short/.test(await page.textContent('#edge'));
  await page.evaluate((px) => {
    const slider = document.getElementById('width');
    slider.value = px;
    slider.dispatchEvent(new Event('input'));
  }, Math.round(cssPxPerMm * (upright ? 53.98 : 85.6)));
  await page.click('#measured');
}

const shown = (page, count) => page.waitForFunction(
  (text) => document.getElementById('count').textContent.startsWith(`${text} of`) && !document.getElementById('table').classList.contains('blank'), count);

/** What stands on the table: names of the three pictures. */
const names = (page) => page.evaluate(() => [...document.querySelectorAll('#table img')].map((image) => image.src.split('/').pop()));

/** The share of right answers of a judge with that threshold, without lapses. */
const shareRight = (threshold, level) => 0.5 + 0.5 / (1 + (threshold / level) ** 5);

/**
 * A judge whose threshold at D px is `thresholdAt(D)`. Chance is spread evenly over the trials of a level (steps of the golden
 * ratio), so that few trials come close to the share that many would have.
 */
function simulatedJudge(design, thresholdAt, number) {
  const seen = new Map();
  return ([, left, right]) => {
    const trial = design.trials.find((t) => [left, right].includes(t.changed) && [left, right].includes(t.same));
    const size = design.conditions[trial.condition].displayed_px;
    const key = `${size} ${trial.level}`;
    const k = seen.get(key) ?? 0;
    seen.set(key, k + 1);
    const chance = (0.25 * number + 0.1 * trial.level * size + (k + 0.5) * 0.6180339887498949) % 1;
    const sees = trial.catch || chance < shareRight(thresholdAt(size), trial.level);
    return (trial.same === left) === sees ? 'left' : 'right';
  };
}

const kWays = {
  keys: (page, side) => page.keyboard.press(side === 'left' ? 'ArrowLeft' : 'ArrowRight'),
  mouse: (page, side) => page.click(`#${side}`),
  touch: (page, side) => page.tap(`#${side}`),
};

/** Judges every trial, and saves the answers to a file. */
async function judged(e, {context, way, judge, decide, post}) {
  const sent = [];
  const at = await opened(e, {context, judge, prepare: (page) => page.route(kPost, (route) => {
    sent.push(route.request().postData());
    return route.fulfill({status: 200, headers: {'Access-Control-Allow-Origin': '*', 'Access-Control-Allow-Headers': '*'}, body: ''});
  })});
  const {page} = at;
  // A screen like a phone's is finer.
  await begin(at, context.deviceScaleFactor ? 6.2 : undefined);
  const trials = e.design.orders[0].length;
  for (let k = 1; k <= trials; ++k) {
    await shown(page, k);
    await page.waitForTimeout(160);
    await kWays[way](page, decide(await names(page)));
  }
  await page.waitForSelector('#done:not([hidden])');
  const [download] = await Promise.all([page.waitForEvent('download'), page.click('#file')]);
  const file = path.join(root, download.suggestedFilename());
  await download.saveAs(file);
  if (post) {
    await page.click('#send');
    await page.waitForFunction(() => /have been sent/.test(document.getElementById('sent').textContent));
    check(sent.filter(Boolean).length === 1 && sent.find(Boolean) === fs.readFileSync(file, 'utf8'), 'other answers were sent');
  }
  const strange = page.wentTo.filter((url) => !url.startsWith(at.server.url) && !url.startsWith('blob:') && url !== kPost);
  check(strange.length === 0, `the page went to ${strange}`);
  check(page.said.length === 0, page.said.join('\n'));
  await at.close();
  return file;
}

const kSizes = ['--sizes', '40,80', '--views', '2', '--objects', '2', '--pause', '0'];

test('experiment: simulated judges get their thresholds back', async () => {
  const e = experiment('distance', '--stimuli', 'quadrics', ...kSizes, '--repeats', '10', '--levels', '.03,.05,.07,.1,.14,.2,.28', '--post', kPost);
  const threshold = {40: 0.14, 80: 0.07}; // as 1 / D
  const judges = [['keys', kDesktop], ['mouse', kDesktop], ['touch', kPhone], ['keys', kDesktop]];
  const files = await Promise.all(judges.map(([way, context], k) => judged(e, {
    way, context, judge: `judge-${k}`, post: k === 0, decide: simulatedJudge(e.design, (px) => threshold[px], k),
  })));
  const profile = path.join(root, 'jnd-profile.json');
  const pageFile = path.join(root, 'fit.html');
  const fit = JSON.parse(run(env.lab, 'experiment', 'fit', ...files, '--design', e.folder, '-o', profile, '--page', pageFile, '--json'));
  check(fit.judges.every((j) => j.verdict === 'kept' && j.answers === e.design.trials.length), JSON.stringify(fit.judges));
  for (const c of fit.conditions) {
    console.log(`         ${c.displayed_px} px: ${c.threshold.value} (${c.threshold.low} to ${c.threshold.high}), of ${threshold[c.displayed_px]}`);
    near(c.threshold.value, threshold[c.displayed_px], 0.05 * threshold[c.displayed_px], `threshold at ${c.displayed_px} px`);
    check(c.threshold.low < threshold[c.displayed_px] && c.threshold.high > threshold[c.displayed_px], 'the bounds miss it');
  }
  near(fit.measured_exponent.value, 1, 0.1, 'exponent of distance');
  const written = JSON.parse(fs.readFileSync(profile));
  near(written.jnd, Math.sqrt(0.14 * 0.07), 0.05 * Math.sqrt(0.14 * 0.07), 'jnd of the profile');
  near(written.distance_exponent, 1, 0.1, 'exponent of the profile');
  check(written.reference_px === 57, `reference of ${written.reference_px} px`);
  const {browser} = await common();
  const page = await browser.newPage({viewport: {width: 1000, height: 900}});
  await page.goto(`file://${pageFile}`);
  await page.screenshot({path: path.join(pictures, 'experiment-fit.png'), fullPage: true});
  await page.close();
}, {seconds: 300});

test('experiment: a judge moves an object until both look alike', async () => {
  const e = experiment('move', '--move', '--stimuli', 'quadrics', '--sizes', '120', '--views', '3', '--objects', '1', '--repeats', '1', '--catches', '2',
    '--levels', '.05,.1,.2', '--pause', '0');
  const frames = e.design.conditions.map((c) => c.frame_px);
  for (const [context, cssPxPerMm] of [[kDesktop, 96 / 25.4], [kPhone, 6.2]]) {
    const at = await opened(e, {context, judge: 'mover'});
    const {page} = at;
    check(/Move the right one/.test(await page.innerText('#welcome')) && !/on top/.test(await page.innerText('#welcome')), 'another task is explained');
    await begin(at, cssPxPerMm);
    for (let k = 1; k <= e.design.orders[0].length; ++k) {
      await shown(page, k);
      await page.waitForTimeout(160);
      const [reference, , moved] = await names(page);
      const trial = e.design.trials.find((t) => t.moved.includes(moved));
      const began = trial.moved.indexOf(moved);
      check(trial.reference === reference && (began === 0 || began === frames.length - 1), `it begins at place ${began}`);
      for (let place = began; place !== 4;) {
        await page.keyboard.press(place < 4 ? 'ArrowRight' : 'ArrowLeft');
        place += place < 4 ? 1 : -1;
      }
      check((await names(page))[2] === trial.moved[4], 'the keys do not move it');
      const [box, image] = await page.evaluate(() => ['#right', '#right img'].map((s) => document.querySelector(s).getBoundingClientRect().toJSON()));
      near(image.height / box.height, frames[4] / frames[0], 0.001, 'size at the fifth place');
      near(image.y + image.height / 2, box.y + box.height / 2, 2, 'middle of the picture');
      if (k === 1) await page.screenshot({path: path.join(pictures, `experiment-move-${context === kPhone ? 'phone' : 'desktop'}.png`)});
      if (k % 2) await page.keyboard.press('Enter');
      else await page.click('#alike');
    }
    await page.waitForSelector('#done:not([hidden])');
    const kept = await page.evaluate(() => JSON.parse(Object.values(localStorage)[0]));
    check(kept.places_px.length === frames.length && kept.answers.every((a) => a.place === 4 && !('side' in a)), JSON.stringify(kept.answers));
    check(new Set(kept.answers.map((a) => a.began)).size === 2, 'all objects begin at one place');
    check(page.said.length === 0, page.said.join('\n'));
    await at.close();
  }
}, {seconds: 120});

test('experiment: pictures tell nothing by their names or sizes', async () => {
  const e = experiment('names', '--stimuli', 'ellipsoids', '--sizes', '40', '--views', '3', '--repeats', '4');
  const files = fs.readdirSync(path.join(e.folder, 'stimuli'));
  check(files.every((f) => /^[0-9a-f]{16}\.png$/.test(f)), files.join(' '));
  const all = files.map((f) => fs.readFileSync(path.join(e.folder, 'stimuli', f)));
  check(new Set(all.map((b) => b.length)).size === 1, 'files of other lengths');
  check(new Set(all.map((b) => b.toString('latin1'))).size === all.length, 'two files are equal');
  const size = (b) => [b.readUInt32BE(16), b.readUInt32BE(20)];
  check(all.every((b) => `${size(b)}` === `${[3 * e.design.conditions[0].frame_px, e.design.conditions[0].frame_px]}`), 'other sides');
});

test('experiment: after the time limit nothing turns, and the judge has to choose', async () => {
  const e = experiment('late', '--stimuli', 'ellipsoids', '--sizes', '40', '--views', '4', '--repeats', '1', '--catches', '0', '--time-limit', '0.5', '--pause', '0');
  const at = await opened(e);
  const {page} = at;
  await begin(at);
  await shown(page, 1);
  await page.keyboard.press('ArrowUp');
  check(await page.inputValue('#turn') === '1', 'the key does not turn');
  const offsets = await page.evaluate(() => [...document.querySelectorAll('#table img')].map((i) => i.style.left));
  check(new Set(offsets).size === 1 && offsets[0].startsWith('-'), `turned by ${offsets}`);
  await page.waitForFunction(() => /Time is up/.test(document.getElementById('say').textContent));
  await page.keyboard.press('ArrowUp');
  await page.waitForTimeout(1200);
  check(await page.inputValue('#turn') === '1' && await page.isDisabled('#turn'), 'it turns after the limit');
  // A choice at once was meant for the trial before: the page itself makes it, or a busy machine would make it too late.
  await page.evaluate(() => {
    const table = document.getElementById('table');
    new MutationObserver((_, observer) => {
      if (table.classList.contains('blank')) return;
      observer.disconnect();
      document.dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowLeft'}));
      window.chosenAtOnce = true;
    }).observe(table, {attributes: true});
  });
  await page.click('#left');
  await shown(page, 2);
  check(await page.evaluate(() => window.chosenAtOnce), 'no choice at once');
  const kept = await page.evaluate(() => JSON.parse(Object.values(localStorage)[0]));
  check(kept.answers.length === 1 && kept.answers[0].late === true && kept.answers[0].ms >= 500, JSON.stringify(kept.answers));
  await page.waitForTimeout(200);
  await page.keyboard.press('ArrowLeft');
  await shown(page, 3);
  // Who comes back goes on.
  await page.reload();
  await page.waitForSelector('#resume:not([hidden])');
  await page.check('#agree');
  await page.click('#resume');
  await measure(at, 96 / 25.4);
  await shown(page, 3);
  check(page.said.length === 0, page.said.join('\n'));
  await at.close();
});

test('experiment: the card decides about zoom, distance and room', async () => {
  const e = experiment('display', '--stimuli', 'ellipsoids', '--sizes', '112', '--views', '1', '--repeats', '1', '--catches', '0', '--objects', '1', '--pause', '0');
  const frame = e.design.conditions[0].frame_px;
  for (const [context, cssPxPerMm, wanted] of [
    [kDesktop, 96 / 25.4, {zoom: 1, distance: 606, layout: 'stacked'}],
    [{viewport: {width: 1280, height: 400}}, 96 / 25.4, {zoom: 1, distance: 606, layout: 'row'}],
    [{...kDesktop, deviceScaleFactor: 2}, 5, {zoom: 2, distance: 458, layout: 'stacked'}],
    [kPhone, 6.2, {zoom: 3, distance: 370, layout: 'stacked'}],
  ]) {
    const at = await opened(e, {context});
    await begin(at, cssPxPerMm);
    await shown(at.page, 1);
    const scale = context.deviceScaleFactor ?? 1;
    const box = await at.page.locator('#left').boundingBox();
    near(box.width, (frame * wanted.zoom) / scale, 0.01, 'width of a picture');
    const room = await at.page.evaluate(() => [document.documentElement.scrollWidth - innerWidth, document.documentElement.scrollHeight - innerHeight]);
    check(room[0] <= 0, `the page is ${room[0]} px too wide`);
    for (const side of ['reference', 'left', 'right']) {
      const {x, y, width, height} = await at.page.locator(`#${side}`).boundingBox();
      check(x >= 0 && y >= 0 && x + width <= context.viewport.width && y + height <= context.viewport.height, `${side} is cut off`);
    }
    check((await at.page.getAttribute('#table', 'class')).includes('row') === (wanted.layout === 'row'), 'another layout');
    await at.page.waitForTimeout(160);
    await at.page.keyboard.press('ArrowLeft');
    await shown(at.page, 2);
    const {display} = await at.page.evaluate(() => JSON.parse(Object.values(localStorage)[0]));
    check(display.zoom === wanted.zoom && display.layout === wanted.layout, JSON.stringify(display));
    near(display.distance_mm, wanted.distance, 8, 'distance');
    await at.close();
  }
  const at = await opened(e, {context: {viewport: {width: 300, height: 300}}});
  await at.page.check('#agree');
  await at.page.click('#start button[type=submit]');
  await at.page.waitForFunction(() => /this window has 300 x 300/.test(document.getElementById('misfit').textContent));
  check(await at.page.isDisabled('#measured'), 'it starts on a screen that is too small');
  await at.close();
});

/** WCAG 2: contrast of an element's text with the first background behind it. */
const contrast = (page, selector) => page.evaluate((s) => {
  const light = (text) => {
    const [r, g, b] = text.match(/[\d.]+/g).map(Number).map((v) => v / 255).map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const element = document.querySelector(s);
  let behind = element;
  while (behind && /, 0\)|transparent/.test(getComputedStyle(behind).backgroundColor)) behind = behind.parentElement;
  const [a, b] = [light(getComputedStyle(element).color), light(getComputedStyle(behind ?? document.body).backgroundColor)];
  return (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
}, selector);

test('experiment: the page on desktop and phone, by day and by night', async () => {
  const e = experiment('look', '--stimuli', 'quadrics', '--sizes', '120', '--views', '4', '--repeats', '1', '--levels', '.1,.2,.3', '--objects', '3', '--title', 'Which one is <the> same?');
  for (const [name, context, cssPxPerMm] of [['desktop', kDesktop, 96 / 25.4], ['phone', kPhone, 6.2]])
    for (const colorScheme of ['light', 'dark']) {
      const at = await opened(e, {context: {...context, colorScheme}});
      const {page} = at;
      const picture = (what) => page.screenshot({path: path.join(pictures, `experiment-${name}-${colorScheme}-${what}.png`)});
      const readable = async (...selectors) => {
        for (const s of selectors) {
          const ratio = await contrast(page, s);
          check(ratio >= 4.5, `${s} has a contrast of ${ratio.toFixed(2)} (${colorScheme})`);
        }
      };
      check(await page.textContent('#welcome h1') === 'Which one is <the> same?', 'the title is markup');
      check(await page.evaluate(() => document.activeElement.tagName) === 'H1', 'the heading has not the focus');
      await readable('#welcome h1', '#consent p', 'label', '#start button[type=submit]', '#judge');
      await picture('welcome');
      await page.check('#agree');
      await page.click('#start button[type=submit]');
      await page.waitForSelector('#display:not([hidden])');
      await readable('#display p', '#measured');
      await picture('display');
      await measure(at, cssPxPerMm);
      await shown(page, 1);
      await readable('#trial h1', name === 'phone' ? '.taps' : '.keys', '#count');
      await picture('trial');
      const small = await page.evaluate(() => [...document.querySelectorAll('button, input')].filter((b) => {
        const {width, height} = b.getBoundingClientRect();
        return width > 0 && (width < 24 || height < 22);
      }).map((b) => b.id));
      check(small.length === 0, `too small to touch: ${small}`);
      for (let k = 1; k <= e.design.orders[0].length; ++k) {
        await shown(page, k);
        await page.waitForTimeout(160);
        await page.keyboard.press('ArrowRight');
      }
      await page.waitForSelector('#done:not([hidden])');
      await readable('#summary', '#file', '#forget');
      await picture('done');
      check(page.said.length === 0, page.said.join('\n'));
      await at.close();
    }
}, {seconds: 120});
