// Compiles src/blocks/encoder to WASM by Debian's clang and lld, for build.mjs and for the tests.
import { execFileSync } from 'node:child_process';
import { mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, symlinkSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const folder = join(dirname(fileURLToPath(import.meta.url)), 'src', 'blocks', 'encoder');
let compiled;

/** The encoder, base64. */
function encoder() {
  if (compiled) return compiled;
  const scratch = mkdtempSync(join(tmpdir(), 'texmesh-encoder-'));
  const out = join(scratch, 'encoder.wasm');
  // Includes count from the project's root, which is not there where this folder alone was copied.
  mkdirSync(join(scratch, 'delivery/web/src/blocks'), { recursive: true });
  symlinkSync(folder, join(scratch, 'delivery/web/src/blocks/encoder'));
  const sources = readdirSync(folder).filter((name) => name.endsWith('.cpp')).sort().map((name) => join(folder, name));
  const flags = [`-I${scratch}`, '--target=wasm32', '-std=c++20', '-O3', '-flto', '-msimd128', '-mbulk-memory', '-nostdlib', '-ffreestanding', '-fno-exceptions', '-fno-rtti',
    '-fno-math-errno', '-Wall', '-Wextra', '-Werror', '-Wl,--no-entry', '-Wl,--strip-all', '-Wl,--export=__heap_base', '-Wl,-z,stack-size=65536'];
  try {
    execFileSync(process.env.TEXMESH_CLANG ?? 'clang++', [...flags, '-o', out, ...sources], { stdio: ['ignore', 'ignore', 'pipe'], encoding: 'utf8' });
    return (compiled = readFileSync(out).toString('base64'));
  } catch (error) {
    throw new Error(`the encoder of textures needs clang++ and wasm-ld (Debian: apt-get install clang lld): ${error.stderr ?? ''}${error.message}`);
  } finally {
    rmSync(scratch, { recursive: true, force: true });
  }
}

/** For Rollup, Vite and Vitest: the module 'encoder.wasm'. */
export const encoderModule = {
  name: 'encoder',
  resolveId: (id) => (id === 'encoder.wasm' ? '\0encoder.wasm' : null),
  load: (id) => (id === '\0encoder.wasm' ? `export default '${encoder()}';` : null),
};
