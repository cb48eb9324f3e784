import { type OpenOptions, PackageReader } from '../../src/reader';
import { type FakeServer, type Fault, fakeServer } from './fake_server';
import { golden } from './files';

// The golden scan on a server in memory, and what tests do with promises.

export const container = golden('v2.0-scan');
export const url = 'http://host/a/scan.texmesh';
export const files = { '/a/scan.texmesh': container };
/** Options of a client that gives up soon, and whose first request does not bring half of the scan. */
export const quick: OpenOptions = { startBytes: 16384, retryDelayS: 0.001, stallTimeoutS: 0.05, retries: 1 };
/** A server with ranges. */
export const range = (fault?: Fault): FakeServer => fakeServer(files, { fault });
export const openAt = (server: FakeServer, options: OpenOptions = {}): Promise<PackageReader> =>
  PackageReader.openUrl(url, { fetch: server.fetch, ...quick, ...options });
/** As openAt, with a retry more. */
export const openRetrying = (server: FakeServer, options: OpenOptions = {}): Promise<PackageReader> =>
  openAt(server, { retries: 2, ...options });

/** What something fails with that has to fail. */
export const rejection = (what: Promise<unknown>): Promise<Error> =>
  what.then(() => { throw new Error('it should have failed'); }, (error: Error) => error);
/** What reading ends with: undefined when it is well. */
export async function problem(read: () => unknown): Promise<unknown> {
  try {
    await read();
    return undefined;
  } catch (error) {
    return error;
  }
}
/** Lets what is under way go on. */
export const turns = (ms = 5): Promise<void> => new Promise((go) => setTimeout(go, ms));
