import { describe, expect, it } from 'vitest';
import type { LoadContext } from '../../src/scene/load_context';
import { ProxyOnTheWay } from '../../src/scene/load';
import type { ShownProxy } from '../../src/scene/shown_proxy';
import '../../src/scene/texture_load'; // or the first test would wait for it

// Documents of a megabyte over 100 kB/s: scales come late, the larger proxy after half a second.
const glb = (offset: number, bytes: number) => ({ path: '', offset, bytes, sha256: new Uint8Array(32) });
const proxy = (offset: number, bytes: number, flip: number) =>
  ({ glb: glb(offset, bytes), triangles: 100, vertices: 300, texturePx: 64, flip: [flip], flipP95: [1] });
const manifest = {
  proxySizesPx: [1000], proxies: [proxy(3000, 20000, 0.9), proxy(100000, 50000, 0.5)],
  index: glb(30000, 1000), tables: glb(1e6, 20000),
  provenance: glb(2e6, 2000),
  scales: [{ scale: 0, glb: glb(1.2e6, 90000), displayPxFlip: 1e9, vertices: 5000, triangles: 9000 },
    { scale: 5, glb: glb(40000, 30000), displayPxFlip: 100, vertices: 500, triangles: 900 }],
  steps: [{ upToPx: 100, scale: 5 }, { upToPx: 1e9, scale: 0 }],
};

/** What happens in a load whose first picture stands, in its order. */
async function stepped(change: object = {}, broken = false): Promise<string[]> {
  const said: string[] = [];
  const load = {
    reader: { manifest, client: { latencyS: 0.04 }, requests: [] }, view: { display: { heightPx: 1000 } },
    options: { beta0BytesS: 1e5 }, override: {},
    limitS: 20, elapsedS: () => 0.5, memoryBytes: Infinity, expectedBytesS: 0,
    untilLimit: (wait: () => unknown) => wait(),
    fail: (_: unknown, what: string) => said.push(`failed: ${what}`), ...change,
  } as unknown as LoadContext;
  const shown = {
    shown: -1,
    async fetch(k: number): Promise<void> {
      if (broken && k > 0) throw new Error('broken');
      said.push(`${k} arrived`);
    },
    async show(k: number, bytes: Promise<void>): Promise<void> {
      await bytes;
      await new Promise((go) => setTimeout(go, 100));
      this.shown = k;
      said.push(`${k} shown`);
    },
  };
  const choice =
    new ProxyOnTheWay(load, shown as unknown as ShownProxy, async () => void said.push('documents'));
  await choice.showFirst();
  await choice.showStep();
  return said;
}

describe('a larger proxy on the way', () => {
  it('is fetched while the first is decoded, and documents while it is', async () => {
    expect(await stepped()).toEqual(['0 arrived', '1 arrived', 'documents', '0 shown', '1 shown']);
  });
  it('waits for the turn where somebody gives turns', async () => {
    expect(await stepped({ options: { beta0BytesS: 1e5, turn: () => undefined } }))
      .toEqual(['0 arrived', '0 shown', '1 arrived', 'documents', '1 shown']);
  });
  const none = ['0 arrived', 'documents', '0 shown'];
  it('is left out where it does not pay, fit or suit the choice by hand', async () => {
    expect(await stepped({ options: { beta0BytesS: 1e8 } })).toEqual(none);
    expect(await stepped({ limitS: 0.6 })).toEqual(none);
    expect(await stepped({ memoryBytes: 1000 })).toEqual(none);
    expect(await stepped({ override: { scale: 0 } })).toEqual(none);
    expect(await stepped({ options: { beta0BytesS: 1e5, policy: 'thesis' } })).toEqual(none);
  });
  it('that is broken leaves the smaller one', async () => {
    expect(await stepped({}, true)).toEqual(['0 arrived', 'documents', '0 shown', 'failed: proxy']);
  });
});
