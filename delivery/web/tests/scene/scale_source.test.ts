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
  const { scales, stream } = reader.manifest;
  scales.at(-1)!.scale = 9;
  scales.splice(1, 0, { ...scales[0], scale: 4, glb: { ...scales[0].glb, offset: stream!.offset, path: stream!.path } });
  const problems: unknown[] = [];
  const options = { meshes: 'glb', gltfLoader: () => ({ register: () => undefined, parseAsync: () => Promise.resolve(fakeGltf()) }) };
  const source = new ScaleSource({
    reader, options: options as unknown as LoadOptions, materials: new MaterialSet(), pool: {} as WorkerPool, signal: new AbortController().signal,
    added: () => undefined, problem: (error) => problems.push(error),
  });
  await source.openStream();
  expect(scales.map(hasGlb)).toEqual([true, false, true]);
  const first = await source.load(9, () => undefined).shape;
  expect(source.bytesOf(4)).toBe(scales[0].glb.bytes);
  const between = await source.load(4, () => undefined).shape;
  expect(between).not.toBe(first);
  expect([source.bytesOf(4), source.bytesOf(0)]).toEqual([0, 0]);
  expect(await source.load(0, () => undefined).shape).toBe(between);
  expect(reader.bytesByKind.mesh).toBeLessThanOrEqual(scales[0].glb.bytes + scales[2].glb.bytes);
  expect(problems).toEqual([]);
  expect(await rejection(reader.scaleGlb(4))).toBeInstanceOf(InputError);
});
