// Debian's chromium, headless, drawing with SwiftShader; and the folders that `run` has made ready.
import {execFileSync, spawn} from 'node:child_process';
import fs from 'node:fs';
import {createRequire} from 'node:module';
import path from 'node:path';
import {chromium} from 'playwright-core';
import {PNG} from 'pngjs';
import {fileURLToPath} from 'node:url';
import {serve} from './static-server.mjs';

const here = path.dirname(fileURLToPath(import.meta.url));
export const env = {
  texmesh: process.env.TEXMESH_BINARY, lab: process.env.TEXMESH_LAB_BINARY, makeScan: process.env.TEXMESH_MAKE_SCAN, compose: process.env.TEXMESH_COMPOSE_PLANE,
  exportEnvironment: process.env.TEXMESH_EXPORT_ENVIRONMENT,
  work: process.env.TEXMESH_BROWSER_WORK, viewer: process.env.TEXMESH_VIEWER, full: process.env.TEXMESH_FULL === '1',
  data: process.env.TEXMESH_DATA ?? '', source: process.env.TEXMESH_SOURCE,
};
export const packages = path.join(env.work, 'packages');
export const pictures = path.join(env.work, 'pictures');
fs.mkdirSync(pictures, {recursive: true});

/** Looks at a page's names, roles, labels and contrasts. */
export const axe = fs.readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');
export const kDesktop = {width: 1280, height: 800};
export const kPhone = {width: 390, height: 844};

/** Folders of the laboratory page; packages stand under /packages/ wherever they are served. */
export const labRoots = {
  '/packages/': packages, '/three/': path.join(env.work, 'work/examples/viewer/node_modules/three'),
  '/texmesh/': path.join(env.work, 'work/delivery/web/dist'), '/': path.join(here, 'page'),
};
export const viewerRoots = {'/some/where/packages/': packages, '/some/where/': env.viewer};

export const launch = () => chromium.launch({
  executablePath: process.env.TEXMESH_CHROMIUM ?? '/usr/bin/chromium', timeout: 60000,
  args: ['--headless=new', '--no-sandbox', '--disable-quic', '--no-first-run', '--disable-background-networking', '--disable-component-update',
    '--disable-sync', '--host-resolver-rules=MAP plain.test 127.0.0.1', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist',
    '--enable-precise-memory-info', '--js-flags=--expose-gc', '--disable-dev-shm-usage'],
});

/** A page of the laboratory; what the console says is kept in `page.said`. `before` runs in the page before anything else. */
export async function labPage(browser, origin, before) {
  const page = await browser.newPage({viewport: {width: 920, height: 920}, ignoreHTTPSErrors: true});
  listen(page);
  if (before) await page.addInitScript(before);
  await page.goto(`${origin}/index.html`);
  await page.waitForFunction('window.ready', null, {timeout: 20000}).catch((e) => { throw new Error(`${e.message}\n${page.said.join('\n')}`); });
  return page;
}

export function listen(page) {
  page.said = [];
  page.wentTo = [];
  page.on('console', (m) => {
    const text = m.text();
    if ((m.type() === 'error' || m.type() === 'warning') && !/GPU stall|GL Driver|swiftshader|GroupMarkerNotSet/i.test(text)) page.said.push(text);
  });
  page.on('pageerror', (e) => page.said.push(String(e)));
  page.on('request', (r) => page.wentTo.push(r.url()));
}

/** `texmesh view PKG` as a process; {url, stop}. */
export async function startView(target) {
  const child = spawn(env.texmesh, ['view', target, '--viewer', env.viewer, '--json'], {stdio: ['ignore', 'pipe', 'inherit']});
  const line = await new Promise((done, fail) => {
    let text = '';
    child.stdout.on('data', (d) => { text += d; if (text.includes('\n')) done(text.split('\n')[0]); });
    child.on('exit', (code) => fail(new Error(`texmesh view ended with ${code}`)));
  });
  return {url: JSON.parse(line).url, stop: () => { child.removeAllListeners('exit'); child.kill('SIGTERM'); }};
}

export const run = (command, ...args) => execFileSync(command, args, {encoding: 'utf8', maxBuffer: 1 << 28});
export const lab = (page, f, ...args) => page.evaluate(f, ...args);
export {PNG, serve, fs, path, here};

export function check(condition, message) {
  if (!condition) throw new Error(message);
}
export function near(value, wanted, within, what) {
  check(Math.abs(value - wanted) <= within, `${what}: ${value}, expected ${wanted} within ${within}`);
}

let shared;
/** One browser and one good server for all cases. */
export function common() {
  return (shared ??= (async () => {
    const [browser, server] = [await launch(), await serve({...labRoots})];
    return {browser, url: server.url, server};
  })());
}
export async function closeCommon() {
  const b = await shared;
  await b?.browser.close();
  await b?.server.close();
}

/** Of each request: how many, itself counted, began one after the other before it had ended. */
function depths(requests) {
  const depth = requests.map(() => 0);
  const order = requests.map((_, i) => i).sort((a, c) => requests[a].started - requests[c].started);
  for (const i of order)
    depth[i] = 1 + Math.max(0, ...order.filter((j) => requests[j].ended <= requests[i].started).map((j) => depth[j]));
  return depth;
}

/** What a picture that stood `at` had to wait for. Other requests may go on beside those that it is made of; what one of those waited for counts. */
export function waitedFor(requests, at) {
  const made = ['manifest', 'first-picture', 'mesh', 'preview'];
  const before = requests.filter((q) => q.ended <= at);
  const depth = depths(before);
  // Of what was still coming, the share that its time makes likely.
  const share = (q) => (q.ended <= at ? 1 : Math.max(0, Math.min(1, (at - q.firstByte) / (q.ended - q.firstByte))));
  return {
    roundTrips: Math.max(0, ...depth.filter((_, i) => made.includes(before[i].kind))),
    bytes: requests.reduce((sum, q) => sum + (q.started < at ? share(q) * q.received : 0), 0),
  };
}
