import { InputError } from '../format/errors';
import type { PackageDocuments } from '../http/package_documents';
import { readThesis } from '../http/read_thesis';

// A client's own just-noticeable difference (thesis 7.2, 7.5), loaded where somebody asks for it.

/** Of a load. */
interface OwnJnd {
  reader: PackageDocuments;
  options: { jnd?: number; policy?: string };
  signal?: AbortSignal;
}

/**
 * By scale of the package, the coarsest scale of it that nobody with this JND can tell from that one: by the
 * 95th percentile of distances, with the policy thesis by the mean of rho against the vertex that is left.
 * InputError: the JND is out of its range, or the package has no perceptual values.
 */
export async function coarsestAlike(
  { reader, options: { jnd = 0, policy }, signal }: OwnJnd,
): Promise<(scale: number) => number> {
  if (!(jnd > 0 && jnd <= 1)) throw new InputError('options', 'jnd', '0 < jnd <= 1', String(jnd));
  const table = (await readThesis(reader, signal))?.perceptual;
  if (!table) throw new InputError('options', 'jnd', 'a package with perceptual values', 'one without');
  const { scale: chain } = table, n = chain.length;
  const values = policy === 'thesis' ? table.chainAverage : table.p95;
  const kept = reader.manifest.scales.map((s) => s.scale);
  return (wanted) => {
    const row = chain.indexOf(wanted), pairs = row * (2 * n - row - 1) / 2 - row - 1; // of (row, 0)
    if (row < 0) return wanted; // nothing is said of it
    let last = row;
    while (last + 1 < n && values[pairs + last + 1]! < jnd) ++last;
    return Math.max(wanted, ...kept.filter((k) => k <= chain[last]!));
  };
}
