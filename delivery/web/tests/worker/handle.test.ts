import { expect, it } from 'vitest';
import { FormatError } from '../../src/reader';
import { packError } from '../../src/worker';

it('errors keep their parts on the way from a worker', () => {
  expect(packError(new FormatError('f', 'p', 'e', 'x', 'K03'))?.parts).toEqual(['f', 'p', 'e', 'x', 'K03']);
  expect(packError(new Error('other'))?.message).toBe('other');
});
