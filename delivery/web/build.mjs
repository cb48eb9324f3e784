// Bundles the library: dist/texmesh.js (everything; three.js stays outside), dist/open.js (to show packages), dist/page.js
// (many on one page), dist/reader.js (without three.js), dist/thesis.js (chapter 4 as printed, thesis.bin), dist/notes.js (notes and measuring), dist/worker.js, dist/viewer/
// (an element by one script tag, with three.js inside). Each entry stands alone: the parts that an entry loads by import()
// belong to that entry.
//   node build.mjs               builds
//   node build.mjs --types       after tsc: names files in full in dist/types, as Node.js resolves them
//   node build.mjs --license     copies the project's LICENSE here, for npm pack
//   node build.mjs --check-size  builds in memory; fails where an application would pay more than it may
import { build, transform } from 'esbuild';
import { copyFileSync, existsSync, mkdirSync, readFileSync, readdirSync, rmSync, writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { createRequire } from 'node:module';
import { gzipSync } from 'node:zlib';
import { rollup } from 'rollup';
import { encoderModule } from './encoder.mjs';

const here = dirname(fileURLToPath(import.meta.url));
const dist = join(here, 'dist');
/** Source files of the entries. */
const entries = {
  texmesh: 'index', open: 'open', page: 'page', reader: 'reader', thesis: 'thesis', notes: 'notes', worker: 'worker',
  blocks: 'blocks',
};
/**
 * Gzip bytes of texmesh/open that an application may have to load, three.js and the worker apart: before the first picture; with
 * every part that is ever loaded. Then the same of `texmesh`, and the worker with the decoders.
 */
const most = { first: 20 * 1024, all: 47.5 * 1024, texmesh: 37 * 1024, texmeshAll: 55 * 1024, page: 24.5 * 1024, pageAll: 52.5 * 1024, viewer: 183.5 * 1024, worker: 23 * 1024, blocks: 18 * 1024, printed: 3.5 * 1024, notes: 9 * 1024 };

/**
 * Workers decode documents. Where there are none, the page itself loads the workers' file, which has mostly come already: nothing is
 * shipped twice. The reader stands without that file.
 */
const documentsOfWorkers = {
  name: 'documents-of-workers',
  resolveId: (id, importer) => (id === './documents' && importer?.endsWith('document_decoder.ts') ? { id: './worker.js', external: true } : null),
};

/** Private names, which end in _, and short ones: the same in every chunk. */
const sources = readdirSync(join(here, 'src'), { recursive: true }).filter((name) => name.endsWith('.ts'));
const privateNames = new Set(sources.flatMap((name) => readFileSync(join(here, 'src', name), 'utf8').match(/\b[a-z]\w*_(?!\w)/gi) ?? []));
const mangled = { mangleProps: /^[a-z]\w*_$/i, mangleCache: Object.fromEntries([...privateNames].sort().map((name, i) => [name, `_${i.toString(36)}`])) };

/** Sources have the shared numbers that they name as their own: else every part would ask the first one for its numbers. */
const numbers = new Map([...readFileSync(join(here, 'src/format/shared_numbers.ts'), 'utf8').matchAll(/^export const (\w+) = ([^;]+);/gm)]
  .map(([, name, value]) => [name, value]));
const withNumbers = (text) => text.replace(/^import \{([^}]*)\} from '[./\w]*\/shared_numbers';$/m, (_, names) =>
  names.match(/\w+/g).map((name) => `const ${name} = ${numbers.get(name)};`).join(' '));
const sourceOf = (file) => withNumbers(readFileSync(file, 'utf8'));

/** TypeScript by esbuild: types taken away from each file, each chunk minified. */
const typescript = {
  name: 'typescript',
  resolveId: (id, importer) => (importer && /^\.\.?\//.test(id) ? join(dirname(importer), `${id}.ts`) : null),
  load: (file) =>
    file.endsWith('.ts') ? transform(sourceOf(file), { loader: 'ts', target: 'es2022', sourcemap: 'external', sourcefile: file }) : null,
  renderChunk: (code) => transform(code, { minify: true, format: 'esm', target: 'es2022', sourcemap: 'external', ...mangled }),
};

/** The element with three.js and its decoders inside: dist/viewer/. Gives the outputs by their names. */
async function viewer(write) {
  const worker = { name: 'documents-of-workers', setup: (b) => b.onResolve({ filter: /^\.\/documents$/ }, () => ({ path: './worker.js', external: true })) };
  const shared = { name: 'shared-numbers', setup: (b) => b.onLoad({ filter: /src\/.*\.ts$/ }, ({ path }) => ({ contents: sourceOf(path), loader: 'ts' })) };
  const { outputFiles, metafile } = await build({
    entryPoints: { 'texmesh-viewer': join(here, 'src', 'viewer.ts') }, outdir: join(dist, 'viewer'), chunkNames: 'viewer-[name]-[hash]',
    bundle: true, splitting: true, format: 'esm', minify: true, target: 'es2022', legalComments: 'linked', write: false, metafile: true,
    absWorkingDir: here, plugins: [worker, shared], ...mangled,
  });
  if (write) {
    const to = join(dist, 'viewer');
    mkdirSync(join(to, 'draco'), { recursive: true });
    for (const { path, contents } of outputFiles) writeFileSync(path, contents);
    for (const file of ['worker.js', 'blocks.js']) copyFileSync(join(dist, file), join(to, file));
    const three = dirname(dirname(createRequire(import.meta.url).resolve('three')));
    for (const file of ['draco_decoder.wasm', 'draco_wasm_wrapper.js', 'draco_decoder.js']) copyFileSync(join(three, 'examples/jsm/libs/draco/gltf', file), join(to, 'draco', file));
  }
  return { outputFiles, metafile };
}
/** Gzip bytes that the element needs before it can show anything. */
async function viewerSize() {
  const { outputFiles, metafile } = await viewer(false);
  const bytesOf = (name) => gzipSync(outputFiles.find(({ path }) => path.endsWith(`/${name}`)).contents, { level: 9 }).length;
  const atOnce = new Set(['texmesh-viewer.js']);
  for (const name of atOnce)
    for (const { path, kind } of metafile.outputs[`dist/viewer/${name}`].imports) if (kind === 'import-statement' && !path.endsWith('worker.js')) atOnce.add(path.split('/').at(-1));
  return [...atOnce].reduce((sum, name) => sum + bytesOf(name), 0);
}

async function bundled(entry) {
  const bundle = await rollup({
    input: { [entry]: join(here, 'src', `${entries[entry]}.ts`) },
    external: [/^three($|\/)/],
    plugins: [encoderModule, ...(entry === 'reader' || entry === 'worker' ? [] : [documentsOfWorkers]), typescript],
    preserveEntrySignatures: 'allow-extension', // no file more that only passes names on
    onwarn: (warning) => { throw new Error(warning.message); },
  });
  return {
    format: 'es', sourcemap: true, dir: dist, bundle,
    inlineDynamicImports: entry === 'worker', // which may be served from anywhere
    entryFileNames: '[name].js', chunkFileNames: `${entry}-[name].js`,
  };
}

/** Parts that no ordinary load takes: where memory asks for compressed textures, for the policy thesis, and for a JND. */
const beside = /-compression\.js$/, printed = /-thesis_list\.js$/;
/** Gzip bytes of what an entry loads at once, of everything that it may load, and of what stands beside that. */
async function sizesOf(entry) {
  const { bundle, ...output } = await bundled(entry);
  const { output: files } = await bundle.generate(output);
  await bundle.close();
  const chunks = new Map(files.filter((file) => file.type === 'chunk').map((chunk) => [chunk.fileName, chunk]));
  const bytesOf = ({ code }) => gzipSync(code, { level: 9 }).length;
  const atOnce = new Set([`${entry}.js`]);
  for (const name of atOnce) for (const imported of chunks.get(name).imports) if (chunks.has(imported)) atOnce.add(imported);
  const sum = (names) => [...names].reduce((bytes, name) => bytes + bytesOf(chunks.get(name)), 0);
  const sumOf = (wanted) => sum([...chunks.keys()].filter(wanted));
  return { first: sum(atOnce), all: sumOf((name) => !beside.test(name) && !printed.test(name)), beside: sumOf((name) => beside.test(name)), printed: sumOf((name) => printed.test(name)) };
}

if (process.argv.includes('--check-size')) {
  const kb = (bytes) => (bytes / 1024).toFixed(1);
  let good = true;
  const say = (what, bytes, limit) => {
    console.log(`${what.padEnd(66)} ${kb(bytes).padStart(5)} KB gzip of ${kb(limit)}`);
    good &&= bytes <= limit;
  };
  const [open, texmesh, page, worker] = [await sizesOf('open'), await sizesOf('texmesh'), await sizesOf('page'), await sizesOf('worker')];
  const blocks = await sizesOf('blocks');
  say('texmesh/open: open() and load() until the first picture', open.first, most.first);
  say('  and every part that is ever loaded', open.all, most.all);
  say('texmesh, with every decision, until the first picture', texmesh.first, most.texmesh);
  say('  and every part that is ever loaded', texmesh.all, most.texmeshAll);
  say('texmesh/page, until the first pictures', page.first, most.page);
  say('  and every part that is ever loaded', page.all, most.pageAll);
  say('the element, three.js inside', await viewerSize(), most.viewer);
  say('worker: the decoders', worker.all, most.worker);
  say('beside these: chapter 4 as printed, a JND of one\'s own', open.printed, most.printed);
  say('beside these: notes, measuring', (await sizesOf('notes')).all, most.notes);
  say('beside these: the encoder, where memory asks for compressed textures', blocks.all + open.beside, most.blocks);
  process.exit(good ? 0 : 1);
}

if (process.argv.includes('--types')) {
  const types = join(dist, 'types');
  for (const name of readdirSync(types, { recursive: true }).filter((n) => n.endsWith('.d.ts'))) {
    const text = readFileSync(join(types, name), 'utf8');
    writeFileSync(join(types, name), text.replace(/((?:from|import\() ?|^import )(['"])(\.\.?\/[\w/.]+)\2/gm, '$1$2$3.js$2'));
  }
  process.exit(0);
}
if (process.argv.includes('--license')) {
  const license = join(process.env.TEXMESH_ROOT ?? join(here, '..', '..'), 'LICENSE');
  if (existsSync(license)) copyFileSync(license, join(here, 'LICENSE'));
  process.exit(existsSync(join(here, 'LICENSE')) ? 0 : 1);
}

rmSync(dist, { recursive: true, force: true });
mkdirSync(dist);
for (const entry of Object.keys(entries)) {
  const { bundle, ...output } = await bundled(entry);
  await bundle.write(output);
  await bundle.close();
}
await viewer(true);
