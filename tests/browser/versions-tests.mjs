// The oldest and a new three.js that the library is said to work with. Only in full runs: each is installed first.
import {execFileSync} from 'node:child_process';
import {check, common, env, fs, lab, labPage, labRoots, path, serve} from './browser.mjs';
import {test} from './harness.mjs';
import {comparePlane, kEverything, kTopQuality, loaded} from './loads.mjs';

function installed(version) {
  const folder = path.join(env.work, `three-${version}`);
  const three = path.join(folder, 'node_modules/three');
  if (!fs.existsSync(path.join(three, 'build'))) {
    fs.mkdirSync(folder, {recursive: true});
    fs.writeFileSync(path.join(folder, 'package.json'), '{"private": true}');
    execFileSync('npm', ['install', '--no-audit', '--no-fund', '--loglevel=error', '--ignore-scripts', `three@${version}`], {cwd: folder, stdio: 'inherit'});
  }
  return three;
}

for (const version of ['0.160.0', '0.187.0'])
  test(`three.js ${version}: textures and meshes are those of the compiler`, async ({skip}) => {
    if (!env.full) skip('only with TEXMESH_FULL=1');
    const b = await common();
    const server = await serve({...labRoots, '/three/': installed(version)});
    const page = await labPage(b.browser, server.url);
    try {
      await lab(page, () => window.lab.start({size: 256}));
      check(await lab(page, () => window.__THREE__) === version.split('.')[1], `revision ${await lab(page, () => window.__THREE__)}`);
      for (const meshes of ['glb', 'stream']) {
        const r = await loaded(null, page, `${server.url}/packages/maps.texmesh`, {load: {...kEverything, meshes}});
        check(!r.error && r.events.every((e) => e.name !== 'error'), JSON.stringify([r.error, r.events.filter((e) => e.name === 'error')]));
        check(r.state.planes.length === 3, `${r.state.planes.length} planes`);
        for (const p of r.state.planes) {
          const d = await comparePlane(page, r.id, p.base, 'maps', kTopQuality);
          check(d.n > 0 && d.most <= 3, `${p.role}: differs by ${d.most}`);
        }
        const d = await lab(page, ([i, u]) => window.lab.compareMesh(i, u), [r.id, `${server.url}/packages/maps/mesh/s00.glb`]);
        check(d.unmatched === 0 && d.triangles[0] > 1000, JSON.stringify(d));
        await lab(page, (i) => window.lab.dispose(i), r.id);
      }
      check(page.said.length === 0, page.said.join('\n'));
    } finally {
      await page.close();
      await server.close();
    }
  }, {seconds: 180});
