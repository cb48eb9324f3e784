// The same six levels as make-chain.mjs makes them, by what a user types: for every level gltfpack, `gltf-transform
// webp` and `gltf-transform draco`, with their defaults, each a process of its own that npx starts.
//
//   node type-chain.mjs SOURCE.glb OUTPUT-FOLDER
import { spawnSync } from 'node:child_process';
import { mkdirSync, rmSync } from 'node:fs';
import { dirname, join, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';

const [source, folder] = process.argv.slice(2).map((path) => resolve(path));
const here = dirname(fileURLToPath(import.meta.url));
const LEVELS = 6;

function type(...args) {
  if (spawnSync('npx', ['--no-install', ...args], { cwd: here, stdio: 'inherit' }).status !== 0)
    throw new Error(`${args.slice(0, 2).join(' ')} failed`);
}

mkdirSync(folder, { recursive: true });
const [simplified, coded] = ['simplified', 'coded'].map((name) => join(folder, `${name}.tmp.glb`));
for (let level = 0; level < LEVELS; ++level) {
  type('gltfpack', '-i', source, '-o', simplified, '-noq', '-kn', '-km', '-si', String(0.5 ** level), '-se', '0.1');
  type('gltf-transform', 'webp', simplified, coded);
  type('gltf-transform', 'draco', coded, join(folder, `level-${level}.glb`));
}
for (const file of [simplified, coded]) rmSync(file);
