import { expect, it } from 'vitest';
import { hasGlb } from '../../src/format/manifest';
import { InputError } from '../../src/reader';
import type { LoadOptions } from '../../src/scene/api';
import { MaterialSet } from '../../src/scene/scale_parts';
import { ScaleSource } from '../../src/scene/scale_source';
import type { WorkerPool } from '../../src/worker/pool';
import { fakeGltf } from '../support/loading';
import { openAt, range, rejection } from '../support/scan';

it('a scale that the stream alone has is the next finer file where the stream is not read', async () => {
  const reader = await openAt(range());
  const { scales } = reader.manifest;
  const [finest, between, coarsest] = scales.map((s) => s.scale);
  const problems: unknown[] = [];
  const options = { meshes: 'glb',
    gltfLoader: () => ({ register: () => undefined, parseAsync: () => Promise.resolve(fakeGltf()) }) };
  const source = new ScaleSource({
    reader, options: options as unknown as LoadOptions, materials: new MaterialSet(), pool: {} as WorkerPool,
    signal: new AbortController().signal,
    added: () => undefined, leadBytes: () => 0, problem: (error) => problems.push(error),
  });
  await source.openStream();
  expect(scales.map(hasGlb)).toEqual([true, false, true]);
  const first = await source.load(coarsest, () => undefined).shape;
  expect(source.bytesOf(between)).toBe(scales[0].glb.bytes);
  const shape = await source.load(between, () => undefined).shape;
  expect(shape).not.toBe(first);
  expect([source.bytesOf(between), source.bytesOf(finest)]).toEqual([0, 0]);
  expect(await source.load(finest, () => undefined).shape).toBe(shape);
  expect(reader.bytesByKind.mesh).toBeLessThanOrEqual(scales[0].glb.bytes + scales[2].glb.bytes);
  expect(problems).toEqual([]);
  expect(await rejection(reader.scaleGlb(between))).toBeInstanceOf(InputError);
});

it('a scale has arrived when no more is missing than comes while a request is on its way', async () => {
  for (const [lead, early] of [[1e6, true], [0, false]] as const) {
    const reader = await openAt(range());
    const { scale, glb: { bytes } } = reader.manifest.scales.at(-1)!;
    let release = (): void => undefined;
    const released = new Promise<void>((go) => (release = go));
    const read = reader.scaleGlb.bind(reader);
    reader.scaleGlb = async (s, how) => {
      const got = await read(s);
      how?.onBytes?.(bytes - 10);
      await released;
      return got;
    };
    const options = { meshes: 'glb',
      gltfLoader: () => ({ register: () => undefined, parseAsync: () => Promise.resolve(fakeGltf()) }) };
    const source = new ScaleSource({
      reader, options: options as unknown as LoadOptions, materials: new MaterialSet(),
      pool: {} as WorkerPool, signal: new AbortController().signal,
      added: () => undefined, leadBytes: () => lead, problem: () => undefined,
    });
    const { arrived, shape } = source.load(scale, () => undefined);
    let said = false;
    void arrived.then(() => (said = true));
    await new Promise((go) => setTimeout(go, 50));
    expect(said).toBe(early);
    release();
    await shape;
    await arrived;
  }
});
