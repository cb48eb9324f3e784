import { describe, expect, it } from 'vitest';
import { readSplitHead } from '../../../src/format/splits/split_stream';
import { FormatError, PackageReader } from '../../../src/reader';
import { golden } from '../../support/files';
import { problem } from '../../support/scan';

describe('split stream', async () => {
  const reader = await PackageReader.openBytes(golden('v2.0-scan'), 'golden');
  const head = (await reader.splitStreamHead())!;
  it('every truncation of the head is told', async () => {
    for (let n = 0; n < head.length; ++n)
      expect(await problem(() => readSplitHead(head.slice(0, n))), `${n} bytes`).toBeInstanceOf(FormatError);
  });
  it('flipped bytes give no other error', async () => {
    for (let at = 0; at < head.length; ++at) {
      const copy = head.slice();
      copy[at] ^= 1 << at % 8;
      const error = await problem(() => readSplitHead(copy));
      if (error !== undefined) expect(error, `byte ${at}`).toBeInstanceOf(FormatError);
    }
  });
});
