// The example of delivery/web's README in an application that Vite serves and builds, with the library as npm installs it.
import {check, common, env, fs, listen, path, packages, serve} from './browser.mjs';
import {test} from './harness.mjs';

const kPage = '<!doctype html><link rel="icon" href="data:,"><body><script type="module" src="/main.ts"></script></body>';
const kBefore = `import {HemisphereLight, PerspectiveCamera, Scene, WebGLRenderer} from 'three';
const [renderer, scene, camera] = [new WebGLRenderer(), new Scene(), new PerspectiveCamera(45, 1, 0.01, 10)];
renderer.setSize(400, 400);
document.body.append(renderer.domElement);
scene.add(new HemisphereLight(0xffffff, 0xffffff, 3));
camera.position.z = 0.8;
camera.updateMatrixWorld();
`;

/** What the page `file` prints, as the application's module. */
function printed(file, block) {
  const [, example] = block.exec(fs.readFileSync(path.join(env.source, file), 'utf8'));
  const main = example.replace(/'[^']*\.texmesh'/, "'maps.texmesh'")
    .replace(/( *)renderer\.setAnimationLoop/, '$1window.model = model;\n$1model.done.then(() => { window.ended = true; });\n$&');
  check(/maps\.texmesh/.test(main) && /window\.model/.test(main), 'the example is another');
  return main;
}
const readme = () => kBefore + printed('delivery/web/README.md', /```ts\n([^]*?)```/);

/** The application in a folder of its own, and Vite. */
function application(main = readme()) {
  const root = path.join(env.work, 'application');
  const [web, viewer] = ['delivery/web', 'examples/viewer'].map((f) => path.join(env.work, 'work', f));
  fs.rmSync(root, {recursive: true, force: true});
  for (const folder of ['node_modules/texmesh', 'public']) fs.mkdirSync(path.join(root, folder), {recursive: true});
  for (const file of ['dist', 'package.json']) fs.cpSync(path.join(web, file), path.join(root, 'node_modules/texmesh', file), {recursive: true});
  fs.cpSync(path.join(viewer, 'node_modules/three'), path.join(root, 'node_modules/three'), {recursive: true});
  fs.cpSync(path.join(root, 'node_modules/three/examples/jsm/libs/draco/gltf'), path.join(root, 'public/draco'), {recursive: true});
  fs.copyFileSync(path.join(packages, 'alone/maps.texmesh'), path.join(root, 'public/maps.texmesh'));
  fs.writeFileSync(path.join(root, 'main.ts'), main);
  fs.writeFileSync(path.join(root, 'index.html'), kPage);
  fs.writeFileSync(path.join(root, 'package.json'), '{"type": "module", "dependencies": {"texmesh": "*", "three": "*"}}');
  return {root, vite: () => import(path.join(viewer, 'node_modules/vite/dist/node/index.js'))};
}

async function isShown(b, url) {
  const page = await b.browser.newPage();
  listen(page);
  try {
    await page.goto(url);
    await page.waitForFunction(() => window.ended, null, {timeout: 25000}).catch(() => check(false, `it does not end: ${page.said.join('\n')}`));
    const {planes, scale} = await page.evaluate(() => ({planes: window.model.state.planes.map((p) => [...p.rungs]), scale: window.model.state.scale}));
    check(scale >= 0 && planes.length > 0 && planes.every((rungs) => rungs.some((v) => v >= 0)), `textures stay previews: ${JSON.stringify(planes)}`);
    const said = page.said.filter((s) => !/404/.test(s)); // a server without ranges is asked for a tree beside the package
    check(said.length === 0, said.join('\n'));
  } finally { await page.close(); }
}

test("an application of Vite, built, at a server without ranges: README's example", async () => {
  const {root, vite} = application();
  await (await vite()).build({root, configFile: false, logLevel: 'error', build: {target: 'es2022'}});
  const [b, server] = [await common(), await serve({'/': path.join(root, 'dist')}, {ranges: false})];
  try {
    await isShown(b, `${server.url}/index.html`);
  } finally { await server.close(); }
}, {seconds: 90});

test("an application of Vite, built: the tutorial's example", async () => {
  const {root, vite} = application(printed('docs/tutorial.md', /```js\n([^]*?)```/));
  await (await vite()).build({root, configFile: false, logLevel: 'error', build: {target: 'es2022'}});
  const [b, server] = [await common(), await serve({'/': path.join(root, 'dist')})];
  try {
    await isShown(b, `${server.url}/index.html`);
  } finally { await server.close(); }
}, {seconds: 90});

test('an application of Vite that awaits at its top level, with the chunk that README names', async () => {
  const {root, vite} = application();
  const main = path.join(root, 'main.ts');
  const inside = fs.readFileSync(main, 'utf8').replace('async function show() {\n', '').replace('}\nvoid show();\n', 'await model.done;\n');
  check(!/show\(\)/.test(inside), 'the example is another');
  fs.writeFileSync(main, inside);
  const [, chunks] = /`build: ({.*manualChunks.*})`/.exec(fs.readFileSync(path.join(env.source, 'delivery/web/README.md'), 'utf8'));
  const build = new Function(`return ${chunks}`)();
  await (await vite()).build({root, configFile: false, logLevel: 'error', build: {...build, target: 'es2022'}});
  const [b, server] = [await common(), await serve({'/': path.join(root, 'dist')})];
  try {
    await isShown(b, `${server.url}/index.html`);
  } finally { await server.close(); }
}, {seconds: 90});

test("an application of Vite's dev server: README's example", async () => {
  const {root, vite} = application();
  const server = await (await vite()).createServer({root, configFile: false, logLevel: 'error', server: {port: 0, host: '127.0.0.1'}, optimizeDeps: {exclude: ['texmesh']}});
  try {
    await server.listen();
    await isShown(await common(), `http://127.0.0.1:${server.httpServer.address().port}/`);
  } finally { await server.close(); }
}, {seconds: 90});
