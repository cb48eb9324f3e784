// Bundles the library: dist/texmesh.js (everything; three.js stays outside), dist/open.js (to show packages), dist/reader.js
// (without three.js), dist/worker.js. Each entry stands alone: what it loads later is in parts of its own.
//   node build.mjs               builds
//   node build.mjs --types       after tsc: names files in full in dist/types, as Node.js resolves them
//   node build.mjs --license     copies the project's LICENSE here, for npm pack
//   node build.mjs --check-size  builds in memory; fails where an application would pay more than it may
import { transform } from 'esbuild';
import { copyFileSync, existsSync, mkdirSync, readFileSync, readdirSync, rmSync, writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { gzipSync } from 'node:zlib';
import { rollup } from 'rollup';
import { minify } from 'terser';

const here = dirname(fileURLToPath(import.meta.url));
const dist = join(here, 'dist');
const source = (name) => join(here, 'src', `${name}.ts`);
const entries = ['texmesh', 'open', 'reader', 'worker'];
const fileOf = { texmesh: 'index' };
/**
 * Gzip bytes that an application may have to load of texmesh/open, three.js and the worker with the decoders apart: before the first
 * picture, and in all from a server that answers ranges, over https or on this machine.
 */
const most = { first: 20 * 1024, all: 40 * 1024, worker: 11 * 1024 };

/** TypeScript as it stands; the parts of an application's first minutes joined to one. */
const typescript = (joined) => ({
  name: 'typescript',
  resolveId: (id, importer) => (importer && id.startsWith('./') && !id.endsWith('.js') ? join(dirname(importer), `${id}.ts`) : null),
  resolveDynamicImport: (id, importer) => {
    if (typeof id !== 'string') return null;
    const later = joined && /^\.\/(documents|split_shape|texture_load)$/.test(id);
    return later ? source('later') : join(dirname(importer), `${id}.ts`);
  },
  load: async (id) => {
    if (!id.endsWith('.ts')) return null;
    const { code, map } = await transform(readFileSync(id, 'utf8'), { loader: 'ts', target: 'es2022', sourcemap: 'external', sourcefile: id });
    return { code, map };
  },
});

/** Private members end in _; nobody else names them. One chunk after the other, so that all give them the same names. */
function minified() {
  const options = {
    module: true, ecma: 2022, nameCache: {}, sourceMap: true,
    compress: { passes: 3, unsafe_arrows: true, unsafe_methods: true },
    mangle: { properties: { regex: /_$/ } },
  };
  let turn = Promise.resolve();
  const next = (code) => (turn = turn.then(() => minify(code, options)).then(({ code: small, map }) => ({ code: small, map })));
  return { name: 'minified', renderChunk: next };
}

async function bundled(entry) {
  const bundle = await rollup({
    input: { [entry]: source(fileOf[entry] ?? entry) },
    external: [/^three($|\/)/],
    plugins: [typescript(entry === 'open')],
    preserveEntrySignatures: 'allow-extension', // no file more that only passes names on
    onwarn: (warning) => { throw new Error(warning.message); },
  });
  return {
    format: 'es', sourcemap: true, dir: dist, plugins: [minified()], bundle,
    inlineDynamicImports: entry === 'worker', // which may be served from anywhere
    entryFileNames: '[name].js', chunkFileNames: `${entry}-[name].js`,
  };
}

/** Gzip sizes of what an entry loads at once, soon, and only where something is missing. */
async function sizesOf(entry) {
  const { bundle, ...output } = await bundled(entry);
  const { output: chunks } = await bundle.generate(output);
  await bundle.close();
  const sizes = { first: 0, later: 0, fallback: 0 };
  for (const c of chunks.filter((chunk) => chunk.type === 'chunk')) {
    const kind = c.isEntry ? 'first' : /store_files|sha256_js/.test(c.name) ? 'fallback' : 'later';
    sizes[kind] += gzipSync(c.code.replace(/\n\/\/# sourceMapping.*\n?$/, ''), { level: 9 }).length;
  }
  return sizes;
}

if (process.argv.includes('--check-size')) {
  const kb = (bytes) => (bytes / 1024).toFixed(1);
  const [open, worker] = [await sizesOf('open'), await sizesOf('worker')];
  const [all, decoders] = [open.first + open.later, worker.first + worker.later + worker.fallback];
  console.log(`open() and load() until the first picture: ${kb(open.first)} KB gzip of ${kb(most.first)}`);
  console.log(`with what loads while it comes: ${kb(all)} KB of ${kb(most.all)}; fallbacks: ${kb(open.fallback)} KB`);
  console.log(`worker with the decoders: ${kb(decoders)} KB of ${kb(most.worker)}`);
  process.exit(open.first <= most.first && all <= most.all && decoders <= most.worker ? 0 : 1);
}

if (process.argv.includes('--types')) {
  const types = join(dist, 'types');
  for (const name of readdirSync(types).filter((n) => n.endsWith('.d.ts'))) {
    const text = readFileSync(join(types, name), 'utf8');
    writeFileSync(join(types, name), text.replace(/((?:from|import\() ?|^import )(['"])(\.\/[\w/]+)\2/gm, '$1$2$3.js$2'));
  }
  process.exit(0);
}
if (process.argv.includes('--license')) {
  const license = join(here, '..', '..', 'LICENSE');
  if (existsSync(license)) copyFileSync(license, join(here, 'LICENSE'));
  process.exit(existsSync(join(here, 'LICENSE')) ? 0 : 1);
}

rmSync(dist, { recursive: true, force: true });
mkdirSync(dist);
for (const entry of entries) {
  const { bundle, ...output } = await bundled(entry);
  await bundle.write(output);
  await bundle.close();
}
