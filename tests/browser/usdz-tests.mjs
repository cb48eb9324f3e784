// USDZ in readers of others, three.js's and tinyusdz, beside the GLB of the same content.
import {PNG, check, common, env, fs, here, listen, packages, path, pictures, run, serve} from './browser.mjs';
import {test} from './harness.mjs';

const folder = path.join(env.work, 'usdz');
const roots = {'/tinyusdz/': path.join(here, 'node_modules/tinyusdz'), '/out/': folder, '/three-usd/': path.join(here, 'node_modules/three-usd'), '/': path.join(here, 'page')};

/** Rows as WebGL reads them, from the bottom. */
function save(pixels, file) {
  const side = Math.sqrt(pixels.length / 4), png = new PNG({width: side, height: side});
  for (let y = 0; y < side; ++y) png.data.set(pixels.slice(4 * side * (side - 1 - y), 4 * side * (side - y)), 4 * side * y);
  fs.writeFileSync(file, PNG.sync.write(png));
}

// Colours of vertices are left out: three.js's reader shows none. `metal` has no normals: glTF shows it flat, and a USDZ says that in
// more bytes.
for (const [name, textures, most] of [['maps', 3, 1.15], ['webp', 1, 1.15], ['metal', 1, 2]])
  test(`a USDZ is drawn as its GLB: ${name}`, async () => {
    fs.mkdirSync(folder, {recursive: true});
    const files = [`${name}.glb`, `${name}.usdz`];
    run(env.texmesh, 'extract', path.join(packages, `${name}.texmesh`), '--scale', '0', '--plain', '-o', path.join(folder, files[0]));
    run(env.texmesh, 'extract', path.join(packages, `${name}.texmesh`), '--scale', '0', '-o', path.join(folder, files[1]));
    const bytes = files.map((f) => fs.statSync(path.join(folder, f)).size);
    check(bytes[1] <= most * bytes[0], `${bytes[1]} bytes, the plain GLB has ${bytes[0]}`);
    const [{browser}, server] = [await common(), await serve(roots, {})];
    const page = await browser.newPage({viewport: {width: 400, height: 400}});
    listen(page);
    try {
      await page.goto(`${server.url}/usdz.html`);
      await page.waitForFunction(() => window.ready);
      const drawn = [];
      const shots = ['glb', 'usd', 'tiny'].map((reader) => path.join(pictures, `usdz-${name}-${reader}.png`));
      for (const [k, reader] of ['glb', 'usd', 'tiny'].entries()) {
        drawn.push(await page.evaluate(([u, r]) => window.drawn(u, r), [`${server.url}/out/${files[Math.min(k, 1)]}`, reader]));
        save(drawn[k].pixels, shots[k]);
      }
      const [glb, usd, tiny] = drawn;
      const none = glb.pixels.reduce((sum, v, i) => sum + Math.abs(v - [32, 192, 32, 255][i % 4]), 0) / glb.pixels.length;
      check(none > 5, `the GLB is apart from nothing by ${none.toFixed(3)}`);
      for (const usdz of [usd, tiny]) {
        check(usdz.textures >= textures, `${usdz.textures} textures`);
        check(Math.abs(usdz.size / glb.size - 1) < 1e-5, `sizes ${glb.size} and ${usdz.size}`);
      }
      const flip = run(path.join(path.dirname(env.compose), 'flip_pictures'), ...shots).trim().split('\n').map(Number);
      check(flip[0] < 0.002 && flip[1] < 0.002, `FLIP by three.js ${flip[0]}, by tinyusdz ${flip[1]}; bound .002`);
      check(page.said.length === 0, page.said.join('\n'));
    } finally {
      await page.close();
      await server.close();
    }
  }, {seconds: 180});
