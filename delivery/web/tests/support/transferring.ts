import { samePrefix, sha256 } from '../../src/format/sha256';
import { FormatError, type FragmentList, PackageReader, fragmentList, fullSize } from '../../src/reader';
import { Transfers, type Wish } from '../../src/scene/transfers';
import { WorkerPool } from '../../src/worker/pool';
import type { TimePlanOptions } from '../../src/decide/harmonic_time';
import type { WorkerRequest } from '../../src/worker/protocol';
import { type Fault, fakeServer } from './fake_server';
import { golden } from './files';

// Transfers of the golden scan's fragments, without workers and without a scene.

export const url = 'http://host/scan.texmesh';

/** The guard over a link of 100 kB/s without latency. */
export const defaultTimePlan: TimePlanOptions = { policy: 'guard', order: 'credit', timeLimitS: 5,
  initialBytesS: 1e5, rttS: 0 };

/** Instead of a worker: checks digests, decodes nothing. */
export async function decode(request: WorkerRequest): Promise<[unknown, Transferable[]]> {
  if (request.op !== 'decode') throw new Error('not asked for here');
  for (const [i, digest] of request.digests.entries())
    if (!samePrefix(await sha256(request.streams[i]), digest))
      throw new FormatError('fragment', '', 'a digest', 'another');
  return [[{ streams: request.streams.length }], []];
}

/** Transfers whose planes are prepared, and what becomes of wishes. */
export async function setUp(fault?: Fault) {
  const server = fakeServer({ '/scan.texmesh': golden('v2.0-scan') }, { fault });
  const reader = await PackageReader.openUrl(url,
    { fetch: server.fetch, startBytes: 16384, retryDelayS: 0.001, retries: 1 });
  await reader.prefetchDocuments();
  const data = await reader.data();
  const decoded: Wish[] = [];
  const lost: Wish[] = [];
  const transfers = new Transfers(reader, data.textures, new WorkerPool({ decode }), {
    decoded: (wish) => decoded.push(wish),
    lost: (wish) => lost.push(wish),
  });
  await transfers.prepare(data.textures.map((_, p) => p));
  await reader.tableStream(0, 0);
  const list = fragmentList(data, fullSize(data.textures), { scale: 0 });
  const settled = async (): Promise<void> => {
    while (transfers.pending > 0) await new Promise((go) => setTimeout(go, 1));
  };
  return { server, reader, data, transfers, decoded, lost, list, settled };
}
export const wishesOf = (list: FragmentList, rung: number): Wish[] =>
  list.fragments.map((f, offer) => ({ ...f, rung: Math.min(rung, list.offers[offer].bytes.length - 1),
    offer }));
