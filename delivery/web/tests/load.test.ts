import { describe, expect, it } from 'vitest';
import { PackageReader } from '../src/reader';
import { fakeServer } from './fake_server';
import { loading, until } from './loading';
import { golden } from './support';

const container = golden('v1.1-scan');
const url = 'http://host/a/scan.texmesh';
const files = { '/a/scan.texmesh': container };
const reader = await PackageReader.openBytes(container, 'golden');
const planes = await reader.textures();

describe('a load', () => {
  it('shows everything that there is', async () => {
    const l = await loading(url, fakeServer(files));
    await l.model.done;
    expect(l.count('error')).toBe(0);
    expect(l.model.state.planes.length).toBe(planes.filter((p) => p.mip === 0).length);
    expect(l.count('fragment')).toBe(l.uploads.length);
    expect(l.model.state.scale).toBe(0);
    l.dispose();
  });
});
