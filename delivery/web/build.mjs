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
 * Gzip bytes that an application may have to load, three.js apart and the worker with the decoders by itself: before the first
 * picture; in all, from a server that answers ranges, over https or on this machine; where something is missing.
 */
const most = { first: 11.2 * 1024, all: 24.9 * 1024, fallback: 13.0 * 1024, texmesh: 27.4 * 1024, texmeshAll: 36.3 * 1024, worker: 17.5 * 1024 };

/** TypeScript as it stands; the parts of an application's first minutes joined to one. */
const typescript = (joined) => ({
  name: 'typescript',
  resolveId: (id, importer) => (importer && /^\.\.?\//.test(id) && !id.endsWith('.js') ? join(dirname(importer), `${id}.ts`) : null),
  resolveDynamicImport: (id, importer) => {
    if (typeof id !== 'string') return null;
    const later = joined && /^\.\/(split_shape|texture_load)$/.test(id);
    return later ? source('scene/later') : join(dirname(importer), `${id}.ts`);
  },
  load: async (id) => {
    if (!id.endsWith('.ts')) return null;
    const { code, map } = await transform(readFileSync(id, 'utf8'), { loader: 'ts', target: 'es2022', sourcemap: 'external', sourcefile: id });
    // Declarations of one kind are joined; of the same length, so that maps stay right. No text of ours has that word.
    return { code: code.replace(/\bconst (?=[\w${[])/g, 'let   '), map };
  },
});

/**
 * Members of what texmesh/open keeps to itself: neither in its types, nor in JSON, nor told to workers, nor three.js's or the DOM's.
 * `texmesh` and `texmesh/reader` offer some of them.
 */
const internal = [
  'adopt', 'advance', 'afterMesh', 'alive', 'allBytes', 'allSeconds', 'bytesLeft', 'bytesOf', 'coarsest', 'creditS',
  'decided', 'doneS', 'elapsedS', 'elsewhere', 'endS', 'estimate', 'estimator', 'expectedBytes', 'extraFile', 'filesOf', 'filled',
  'finerPlanes', 'finished', 'gainPerByte', 'gapBytes', 'hardLimits', 'highRung', 'initialBytesS', 'isUsed', 'issuedS',
  'lastS', 'leastInFlight', 'limitS', 'linkBytesS', 'loss', 'lostScale', 'lowRung', 'lowestRung', 'meanBytesS', 'mostBytes',
  'mostInFlight', 'noRanges', 'offers', 'openSplits', 'openStream', 'owedBytes', 'plannedBytes', 'prepare', 'previewLoss', 'priceKappa',
  'qualityHigh', 'qualityLow', 'recentBytesS', 'refineSome', 'residualS', 'scaleFor', 'showScale', 'shownScale', 'skips', 'slope', 'slots',
  'smallBytes', 'spacingS', 'startsS', 'targetBytes', 'textureAt', 'textureDssim', 'thetaS', 'timeLimitS', 'timedPart', 'tooLong',
  'totalWeight', 'updateMips', 'uploadFragment', 'waitS', 'ways', 'wish',
];

/** Private members end in _; nobody else names them. One chunk after the other, so that all give them the same names. */
function minified(names) {
  const options = {
    module: true, ecma: 2022, nameCache: {}, sourceMap: true,
    // Not unsafe_comps, which knows no NaN.
    compress: { passes: 6, hoist_funs: true, lhs_constants: false, unsafe: true, unsafe_arrows: true, unsafe_methods: true },
    mangle: { properties: { regex: new RegExp(`_$|^(${names.join('|')})$`) } },
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
    format: 'es', sourcemap: true, dir: dist, plugins: [minified(entry === 'open' ? internal : ['_'])], bundle,
    inlineDynamicImports: entry === 'worker', // which may be served from anywhere
    // A few lines that several parts share are no file of their own.
    ...(entry === 'open' && {
      manualChunks: (id) =>
        /\/(open|tables|textures|throughput|layout|errors|bytes|digests|sha256)\.ts$/.test(id) ? entry
          : /\/(documents|manifest|json_fields|entry_paths)\.ts$/.test(id) ? 'documents' : null,
    }),
    entryFileNames: '[name].js', chunkFileNames: `${entry}-[name].js`,
  };
}

/** Gzip sizes of what an entry loads at once, soon, and only where something is missing. */
async function sizesOf(entry) {
  const { bundle, ...output } = await bundled(entry);
  const { output: chunks } = await bundle.generate(output);
  await bundle.close();
  const sizes = { first: 0, later: 0, fallback: 0 };
  const isFallback = (name) => /tree_store|sha256_js|enlarge|documents|rare_reads|entry_paths|codec/.test(name);
  for (const c of chunks.filter((chunk) => chunk.type === 'chunk')) {
    const kind = c.isEntry ? 'first' : isFallback(c.name) ? 'fallback' : 'later';
    // What is imported is loaded, whatever it is counted as.
    if (kind !== 'fallback' && c.imports.some((name) => /-/.test(name) && isFallback(name))) throw new Error(`${c.fileName} imports ${c.imports}`);
    sizes[kind] += gzipSync(c.code.replace(/\n\/\/# sourceMapping.*\n?$/, ''), { level: 9 }).length;
  }
  return sizes;
}

if (process.argv.includes('--check-size')) {
  const kb = (bytes) => (bytes / 1024).toFixed(1);
  let good = true;
  const say = (what, bytes, limit) => {
    console.log(`${what.padEnd(66)} ${kb(bytes).padStart(5)} KB gzip of ${kb(limit)}`);
    good &&= bytes <= limit;
  };
  const [open, texmesh, worker] = [await sizesOf('open'), await sizesOf('texmesh'), await sizesOf('worker')];
  say('texmesh/open: open() and load() until the first picture', open.first, most.first);
  say('  and what loads while it comes', open.first + open.later, most.all);
  say('  and only where ranges, WebCrypto, workers or a GPU are missing', open.first + open.later + open.fallback, most.all + most.fallback);
  say('texmesh, with every decision, until the first picture', texmesh.first, most.texmesh);
  say('  and what loads while it comes', texmesh.first + texmesh.later, most.texmeshAll);
  say('worker: the decoders', worker.first + worker.later + worker.fallback, most.worker);
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
for (const entry of entries) {
  const { bundle, ...output } = await bundled(entry);
  await bundle.write(output);
  await bundle.close();
}
