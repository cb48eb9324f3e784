import { describe, expect, it } from 'vitest';
import { sha256, sha256Js, toHex } from '../../src/reader';

describe('small parts', () => {
  it('both SHA-256 agree', async () => {
    for (const n of [0, 1, 55, 56, 63, 64, 65, 119, 120, 1000]) {
      const bytes = Uint8Array.from({ length: n }, (_, i) => (i * 37) & 255);
      expect(toHex(sha256Js(bytes)), `${n} bytes`).toBe(toHex(await sha256(bytes)));
    }
  });
});
