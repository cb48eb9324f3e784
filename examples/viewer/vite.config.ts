import { copyFileSync, mkdirSync } from 'node:fs';
import { createRequire } from 'node:module';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { defineConfig } from 'vite';
import type { Plugin } from 'vite';

const kDraco = ['draco_decoder.wasm', 'draco_wasm_wrapper.js'];

/** Draco's decoder, out of three's package into the build's draco/. */
function dracoDecoder(): Plugin {
  let out = '';
  return {
    name: 'draco-decoder',
    apply: 'build',
    configResolved: (config) => { out = join(config.build.outDir, 'draco'); },
    closeBundle() {
      const three = dirname(dirname(createRequire(import.meta.url).resolve('three')));
      mkdirSync(out, { recursive: true });
      for (const file of kDraco)
        copyFileSync(join(three, 'examples/jsm/libs/draco/gltf', file), join(out, file));
    },
  };
}

// Relative paths: the build works from any folder of any server.
export default defineConfig({
  base: './',
  plugins: [dracoDecoder()],
  resolve: {
    // The library beside this example; other applications `npm install texmesh` instead.
    alias: Object.fromEntries([['texmesh/notes', 'notes.js'], ['texmesh', 'texmesh.js']].map(([name, file]) =>
      [name, fileURLToPath(new URL(`../../delivery/web/dist/${file}`, import.meta.url))])),
    dedupe: ['three'],
  },
  worker: { format: 'es' },
  build: { target: 'es2022', sourcemap: false, chunkSizeWarningLimit: 900, assetsInlineLimit: 0 },
});
