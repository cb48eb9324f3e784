import { describe, expect, it } from 'vitest';
import { FormatError, InputError } from '../../src/reader';

describe('places that do not exist', async () => {
  it('errors have names that survive bundling', () => {
    expect(new InputError('f', 'p', 'e', 'x').name).toBe('InputError');
    expect(new FormatError('f', 'p', 'e', 'x').message).toBe('f: p: expected e, found x');
    expect(new FormatError('f', 'p', 'e', 'x', 'K03').message).toBe('f: p: expected e, found x [K03]');
    expect(new FormatError('', 'p', '', 'x').message).toBe('p: found x');
  });
});
