import { describe, expect, it, vi } from 'vitest';
import { FormatError, PackageReader, TexmeshError } from '../../src/reader';
import { FaultKind, fakeServer } from '../support/fake_server';
import { golden } from '../support/files';

// Pages whose server does not give the part for servers without ranges, perhaps because it is what fails.
let asked = 0;
vi.mock('../../src/http/without_ranges', () => {
  ++asked;
  throw new Error('not there');
});

const container = golden('v2.0-scan');
const url = 'http://host/a/scan.texmesh';
const open = (fault?: FaultKind, from = 0, ranges = true): Promise<PackageReader> => {
  const server = fakeServer({ '/a/scan.texmesh': container },
    { ranges, fault: ({ number, range }) => {
      const isSpared = number < from || (fault === 'flip' && range?.[0] === 0); // it is the same package
      return (!isSpared && fault) || false;
    } });
  return PackageReader.openUrl(url,
    { fetch: server.fetch, startBytes: 16384, retryDelayS: 0.001, stallTimeoutS: 0.05 });
};
const rejection = (what: Promise<unknown>): Promise<Error> =>
  what.then(() => { throw new Error('it should have failed'); }, (error: Error) => error);

describe('without the part for servers without ranges', () => {
  it('all is read from a server that is well, and nobody asks for it', async () => {
    const reader = await open();
    await reader.prefetchDocuments();
    expect((await reader.data()).tables.length).toBe(reader.manifest.planeCount);
    await reader.scaleGlb(0);
    await reader.planeFiles(0);
    expect(asked).toBe(0);
  });
  const told: [FaultKind, string][] = [['status-500', 'status 500'], ['refused', 'connection refused'],
    ['stall', 'no byte'], ['whole', 'status 200'], ['page', 'status 200']];
  for (const [fault, words] of told)
    for (const from of [0, 1])
      it(`${fault} from request ${from} on is told for what it is`, async () => {
        const error = await rejection(open(fault, from).then((r) => r.scaleGlb(0)));
        expect(error).toBeInstanceOf(TexmeshError);
        expect(error.message).toContain(words);
      });
  it('so are damaged bytes', async () => {
    const error = await rejection(open('flip', 1).then((r) => r.scaleGlb(0)));
    expect(error).toBeInstanceOf(FormatError);
    expect(error.message).toContain('SHA-256');
  });
  it('mirrors are read as long as the first one is well', async () => {
    const server = fakeServer({ '/a/scan.texmesh': container });
    const reader = await PackageReader.openUrl(url, { fetch: server.fetch, startBytes: 16384,
      retryDelayS: 0.001, mirrors: ['http://other/a/scan.texmesh'] });
    expect((await reader.textures()).length).toBe(reader.manifest.planeCount);
  });
});
