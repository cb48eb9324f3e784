import { fileURLToPath } from 'node:url';
import { defineConfig } from 'vitest/config';
import { encoderModule } from './encoder.mjs';

// Functions of the viewer are tested from here, too: their files stand beyond this folder and import the
// library by its name.
export default defineConfig({
  plugins: [encoderModule],
  resolve: { alias: { texmesh: fileURLToPath(new URL('src/index.ts', import.meta.url)) } },
  server: { fs: { strict: false } },
  test: { include: ['tests/**/*.test.ts'], environment: 'node', testTimeout: 20000 },
});
