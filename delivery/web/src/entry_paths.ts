// Paths that only documents and trees of files ask for.

/** texture/3/r07/0123.jpg, in trees made with `unpack --fragments files` only. */
export const fragmentFilePath = (plane: number, rung: number, fragment: number, extension: string): string =>
  `texture/${plane}/r${String(rung).padStart(2, '0')}/${String(fragment).padStart(4, '0')}.${extension}`;

/** A relative path of a-z 0-9 . _ - and /, without empty parts, "." and "..". */
export function isValidEntryPath(path: string): boolean {
  return (
    path.length <= 200 &&
    path.split('/').every((part) => /^[a-z0-9._-]+$/.test(part) && part !== '.' && part !== '..')
  );
}
