// Meshes that gltfpack makes of a model: for every number of triangles one file, within 1 % of it where gltfpack
// reaches it. Numbers that it misses by more than 2 % get no file, and a line says so.
//
//   node make-peers.mjs SOURCE.glb OUTPUT-FOLDER 40000 20000 10000
import { spawnSync } from 'node:child_process';
import { closeSync, mkdirSync, openSync, readSync, rmSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const [source, folder, ...counts] = process.argv.slice(2);
const gltfpack = join(dirname(fileURLToPath(import.meta.url)), 'node_modules/gltfpack/cli.js');

/** Triangles of a GLB, from its JSON. */
function trianglesOf(file) {
  const handle = openSync(file);
  const head = Buffer.alloc(20);
  readSync(handle, head, 0, 20, 0);
  const text = Buffer.alloc(head.readUInt32LE(12));
  readSync(handle, text, 0, text.length, 20);
  closeSync(handle);
  const gltf = JSON.parse(text.toString());
  const primitives = (gltf.meshes ?? []).flatMap((mesh) => mesh.primitives);
  return primitives.reduce((sum, p) => sum + gltf.accessors[p.indices].count / 3, 0);
}

function simplified(file, ratio) {
  const args = [gltfpack, '-i', source, '-o', file, '-noq', '-kn', '-km', '-si', String(ratio), '-se', '1'];
  if (spawnSync('node', args, { stdio: 'ignore' }).status !== 0) throw new Error('gltfpack failed');
  return trianglesOf(file);
}

mkdirSync(folder, { recursive: true });
const trial = join(folder, 'trial.tmp.glb');
const total = simplified(trial, 1);
rmSync(trial);
for (const wanted of counts.map(Number)) {
  const file = join(folder, `${wanted}.glb`);
  let low = 0, high = 1, ratio = Math.min(wanted / total, 1), got = simplified(file, ratio);
  for (let i = 0; i < 8 && Math.abs(got - wanted) > 0.01 * wanted; ++i) {
    if (got > wanted) high = ratio;
    else low = ratio;
    const next = got > 0 ? (ratio * wanted) / got : 0;
    ratio = next > low && next < high ? next : (low + high) / 2;
    got = simplified(file, ratio);
  }
  const missed = Math.abs(got - wanted) > 0.02 * wanted;
  if (missed) rmSync(file);
  console.log(`${wanted} triangles: ${missed ? 'not reached, ' : ''}${got}`);
}
