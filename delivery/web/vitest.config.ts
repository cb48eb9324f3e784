import { defineConfig } from 'vitest/config';

// The viewer's choices are tested from here, too: beyond this folder.
export default defineConfig({ server: { fs: { strict: false } }, test: { include: ['tests/**/*.test.ts'], environment: 'node', testTimeout: 20000 } });
