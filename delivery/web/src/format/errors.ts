import { formatMajor } from './shared_numbers';

/**
 * Every texmesh error carries the file (or URL), the place in the file, what was expected and what was found,
 * and the rule of format/SPEC.md that is broken. Any of these may be empty; the message joins those that are
 * not and ends with the rule: "[K03]".
 */
export class TexmeshError extends Error {
  constructor(readonly file: string, readonly place: string, readonly expected: string, readonly found = '',
      readonly rule = '') {
    const facts = [expected && `expected ${expected}`, found && `found ${found}`].filter(Boolean).join(', ');
    super([file, place, facts].filter(Boolean).join(': ') + (rule && ` [${rule}]`));
  }
}

/** A server or a caller does not give what is needed: no answer, no such file, an option out of range. */
export class InputError extends TexmeshError {
  override readonly name = 'InputError'; // in letters: bundlers rename classes
}

/** The bytes of a package do not follow the format, or are not those that their digests promise. */
export class FormatError extends TexmeshError {
  override readonly name = 'FormatError';
}

/** What a cancelled call throws. */
export function abortError(): Error {
  return new DOMException('The load was cancelled', 'AbortError');
}
/** Whether an error says that somebody cancelled. */
export function isAbort(error: unknown): boolean {
  return (error as Partial<Error>)?.name === 'AbortError';
}
/** Throws an AbortError where a signal says so. */
export function throwIfAborted(signal?: AbortSignal): void {
  if (signal?.aborted) throw abortError();
}

/** What a reader says that has found another major version. */
export const otherMajor = (major: number): string =>
  `${major}, which ${major < formatMajor ? 'is no longer read: compile the model again'
    : 'a later reader is for'}`;
