// Bundles the library: dist/texmesh.js (three.js stays outside), dist/reader.js (without three.js) and dist/worker.js.
//   node build.mjs               builds
//   node build.mjs --check-size  fails where dist is larger than it may be
import { build } from 'esbuild';
import { existsSync, readFileSync, rmSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { gzipSync } from 'node:zlib';

const here = dirname(fileURLToPath(import.meta.url));
const dist = join(here, 'dist');
const mostGzipBytes = 25 * 1024;

if (process.argv.includes('--check-size')) {
  let total = 0;
  for (const name of ['texmesh.js', 'worker.js']) {
    const bytes = gzipSync(readFileSync(join(dist, name)), { level: 9 }).length;
    console.log(`${name}: ${(bytes / 1024).toFixed(1)} KB gzip`);
    total += bytes;
  }
  console.log(`together: ${(total / 1024).toFixed(1)} KB gzip of ${mostGzipBytes / 1024}`);
  process.exit(total <= mostGzipBytes ? 0 : 1);
}

rmSync(dist, { recursive: true, force: true });
const common = {
  bundle: true,
  format: 'esm',
  target: 'es2022',
  minify: true,
  mangleProps: /_$/, // private members, which nobody else names
  sourcemap: true,
  external: ['three', 'three/*'],
  logLevel: 'warning',
};
const entries = { texmesh: 'src/index.ts', reader: 'src/reader.ts', worker: 'src/worker.ts' };
for (const [name, file] of Object.entries(entries))
  if (existsSync(join(here, file)))
    await build({ ...common, entryPoints: [join(here, file)], outfile: join(dist, `${name}.js`) });
