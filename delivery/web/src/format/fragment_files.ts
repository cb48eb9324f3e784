import { parseJson } from './json_fields';

/** A complete file of a fragment, in a tree that `unpack --fragments files` made. */
export interface FragmentFile {
  bytes: number;
  /** First 8 bytes of the file's SHA-256. */
  sha256: Uint8Array;
}
/** fragments.json: [plane][rung] by fragment. */
export type FragmentFiles = Map<number, FragmentFile>[][];

const file = 'fragments.json';
/** Reads fragments.json. FormatError where lists are not parallel, or a digest is none. */
export function readFragmentFiles(json: Uint8Array): FragmentFiles {
  const at = parseJson(json, file, 256 << 20);
  at.at('version').integer(1, 1);
  const planes: FragmentFiles = [];
  for (let p = 0, n = at.at('planes').array(0, 10000); p < n; ++p) {
    const plane = at.at('planes').at(p);
    const count = plane.at('order').array(0, 65535);
    const order = Array.from({ length: count }, (_, i) => plane.at('order').at(i).integer(0, 65535));
    const rungs: Map<number, FragmentFile>[] = [];
    for (let r = 0, m = plane.at('rungs').array(1, 100); r < m; ++r) {
      const rung = plane.at('rungs').at(r);
      rung.at('bytes').array(count, count);
      rung.at('sha256').array(count, count);
      const files = new Map<number, FragmentFile>();
      order.forEach((fragment, i) => {
        const bytes = rung.at('bytes').at(i).integer(0, 4294967296);
        const sha256 = rung.at('sha256').at(i).digest(8);
        if (bytes > 0) files.set(fragment, { bytes, sha256 });
      });
      rungs.push(files);
    }
    planes.push(rungs);
  }
  return planes;
}
