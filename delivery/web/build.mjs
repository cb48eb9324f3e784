// Bundles the library: dist/texmesh.js (everything; three.js stays outside), dist/open.js (to show packages; loads what
// comes after the first picture later), dist/reader.js (without three.js), the parts that they share, dist/worker.js.
//   node build.mjs               builds
//   node build.mjs --check-size  fails where an application would pay more than it may
import { build } from 'esbuild';
import { rmSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { gzipSync } from 'node:zlib';

const here = dirname(fileURLToPath(import.meta.url));
const dist = join(here, 'dist');
/** What an application that opens and shows packages has to load before the first picture, gzip. */
const mostFirstBytes = 25 * 1024;

const common = {
  bundle: true,
  format: 'esm',
  target: 'es2022',
  minify: true,
  mangleProps: /_$/, // private members, which nobody else names
  external: ['three', 'three/*'],
  logLevel: 'warning',
  absWorkingDir: here,
  outdir: dist,
  chunkNames: 'part-[hash]', // beside texmesh.js: parts find worker.js by their own URL
};

/** Gzip sizes of what an entry loads at once, and later. */
async function sizesOf(contents) {
  const stdin = { contents, resolveDir: here, sourcefile: 'entry.js' };
  const { outputFiles, metafile } = await build({ ...common, stdin, splitting: true, write: false, metafile: true });
  const name = (path) => path.split('/').pop();
  const outputs = Object.fromEntries(Object.entries(metafile.outputs).map(([path, o]) => [name(path), o]));
  const first = new Set();
  const visit = (file) => {
    if (first.has(file)) return;
    first.add(file);
    for (const i of outputs[file].imports) if (i.kind === 'import-statement' && !i.external) visit(name(i.path));
  };
  visit(Object.keys(outputs).find((file) => outputs[file].entryPoint));
  const size = (files) => files.reduce((sum, f) => sum + gzipSync(f.contents, { level: 9 }).length, 0);
  const isFirst = (f) => first.has(name(f.path));
  return { first: size(outputFiles.filter(isFirst)), later: size(outputFiles.filter((f) => !isFirst(f))) };
}

if (process.argv.includes('--check-size')) {
  const kb = (bytes) => (bytes / 1024).toFixed(1);
  const { first, later } = await sizesOf("export { open } from './src/open.ts'");
  const worker = await sizesOf("export { handle } from './src/worker.ts'");
  console.log(`open() and load() until the first picture: ${kb(first)} KB gzip of ${kb(mostFirstBytes)}`);
  console.log(`loaded while it comes: ${kb(later)} KB; worker with the decoders: ${kb(worker.first + worker.later)} KB`);
  process.exit(first <= mostFirstBytes ? 0 : 1);
}

rmSync(dist, { recursive: true, force: true });
const entryPoints = { texmesh: 'src/index.ts', open: 'src/open.ts', reader: 'src/reader.ts' };
await build({ ...common, entryPoints, splitting: true, sourcemap: true });
await build({ ...common, entryPoints: { worker: 'src/worker.ts' }, sourcemap: true });
