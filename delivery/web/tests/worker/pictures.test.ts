import { describe, expect, it } from 'vitest';
import { imageSize } from '../../src/format/image_size';
import { FormatError } from '../../src/reader';
import { handle } from '../../src/worker';
import type { WorkerRequest } from '../../src/worker/protocol';
import { rejection } from '../support/scan';

describe('pictures', () => {
  it('that are larger than their fragment are refused', async () => {
    const bomb = Uint8Array.from([0xff, 0xd8, 0xff, 0xc0, 0, 17, 8, 0xff, 0xff, 0xff, 0xff, 3]);
    expect(imageSize(bomb)).toEqual([65535, 65535]);
    const none = new Uint8Array(0);
    const request = { op: 'decode', codec: 'jpeg', tables: none, streams: [bomb], digests: [], complete: true,
      levels: 1, most: [128, 128] } as const;
    expect(await rejection(handle(request as unknown as WorkerRequest))).toBeInstanceOf(FormatError);
  });
});
