import { describe, expect, it } from 'vitest';
import { FormatError, joinFragment } from '../../src/reader';

describe('small parts', () => {
  it('joins fragments of every codec', () => {
    const soi = [0xff, 0xd8];
    const eoi = [0xff, 0xd9];
    const bytes = (...b: number[]): Uint8Array => new Uint8Array(b);
    expect([...joinFragment('jpeg', bytes(...soi, 1, ...eoi), [bytes(...soi, 2, ...eoi)])])
      .toEqual([...soi, 1, 2, ...eoi]);
    const scans = [bytes(7), bytes(8)];
    expect([...joinFragment('jpeg-progressive', bytes(...soi, 1, ...eoi), scans)])
      .toEqual([...soi, 1, 7, 8, ...eoi]);
    expect(() => joinFragment('jpeg-progressive', bytes(...soi, 1, ...eoi), [bytes(0xff)]))
      .toThrow(FormatError);
    expect(() => joinFragment('jpeg', bytes(1, 2, 3, 4), [bytes(...soi, ...eoi)])).toThrow(FormatError);
    expect(() => joinFragment('jpeg', bytes(...soi, ...eoi), scans)).toThrow(FormatError);
    expect(() => joinFragment('webp', bytes(), [bytes(1, 2, 3)])).toThrow(FormatError);
  });
});
