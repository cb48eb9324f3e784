// USDZ in a reader of others, three.js's, beside the GLB of the same content.
import {check, common, env, fs, here, listen, packages, path, pictures, run, serve} from './browser.mjs';
import {test} from './harness.mjs';

const folder = path.join(env.work, 'usdz');
const roots = {'/out/': folder, '/three-usd/': path.join(here, 'node_modules/three-usd'), '/': path.join(here, 'page')};

// Colours of vertices are left out: three.js's reader shows none.
for (const [name, textures] of [['maps', 3], ['webp', 1]])
  test(`a USDZ is drawn as its GLB: ${name}`, async () => {
    fs.mkdirSync(folder, {recursive: true});
    const files = [`${name}.glb`, `${name}.usdz`];
    run(env.texmesh, 'extract', path.join(packages, `${name}.texmesh`), '--scale', '0', '--plain', '-o', path.join(folder, files[0]));
    run(env.texmesh, 'extract', path.join(packages, `${name}.texmesh`), '--scale', '0', '-o', path.join(folder, files[1]));
    const bytes = files.map((f) => fs.statSync(path.join(folder, f)).size);
    check(bytes[1] <= 1.15 * bytes[0], `${bytes[1]} bytes, the plain GLB has ${bytes[0]}`);
    const [{browser}, server] = [await common(), await serve(roots, {})];
    const page = await browser.newPage({viewport: {width: 400, height: 400}});
    listen(page);
    try {
      await page.goto(`${server.url}/usdz.html`);
      await page.waitForFunction(() => window.ready);
      const drawn = [];
      for (const f of files) {
        drawn.push(await page.evaluate((u) => window.drawn(u), `${server.url}/out/${f}`));
        await page.screenshot({path: path.join(pictures, `usdz-${f}.png`)});
      }
      const [glb, usdz] = drawn;
      check(usdz.textures >= textures, `${usdz.textures} textures`);
      check(Math.abs(usdz.size / glb.size - 1) < 1e-5, `sizes ${glb.size} and ${usdz.size}`);
      const apart = (p) => usdz.pixels.reduce((sum, v, i) => sum + Math.abs(v - p(i)), 0) / usdz.pixels.length;
      const [d, none] = [apart((i) => glb.pixels[i]), apart((i) => [32, 192, 32, 255][i % 4])];
      check(d < 0.3 && none > 5, `apart by ${d.toFixed(3)} of 255 in the mean, from nothing by ${none.toFixed(3)}`);
      check(page.said.length === 0, page.said.join('\n'));
    } finally {
      await page.close();
      await server.close();
    }
  }, {seconds: 180});
