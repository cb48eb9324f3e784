import type { BytesIn } from './bytes_in';
import { formatMajor, otherMajor } from './manifest';

/** Magic word (another breaks `rule`) and version, with which index.bin and tables.bin begin; gives the minor version. */
export function readEntryStart(input: BytesIn, magic: string, rule: string): number {
  input.expect(magic, rule);
  const major = input.u16();
  if (major !== formatMajor) input.fail(`version ${formatMajor}`, otherMajor(major), 'W03');
  return input.u16();
}
