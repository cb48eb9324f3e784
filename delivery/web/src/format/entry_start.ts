import type { BytesIn } from './bytes_in';
import { formatMajor, otherMajor } from './manifest';

/** Magic word and version, with which index.bin and tables.bin begin; gives the minor version. */
export function readEntryStart(input: BytesIn, magic: string): number {
  input.expect(magic);
  const major = input.u16();
  if (major !== formatMajor) input.fail(`major version ${formatMajor}`, otherMajor(major));
  return input.u16();
}
