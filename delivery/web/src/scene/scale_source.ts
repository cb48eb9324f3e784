import type { Mesh, Object3D } from 'three';
import { isAbort } from '../format/errors';
import type { PackageReader } from '../http/package_reader';
import type { WorkerPool } from '../worker/pool';
import type { LoadOptions } from './api';
import { MaterialSet, ParsedGltf, Slot, disposeGeometries, meshesOf, parseScale } from './scale_parts';
import type { SplitShapes } from './split_shape';

/** A scale on its way. */
export interface ScaleLoad {
  /** All bytes are there. */
  arrived: Promise<void>;
  shape: Promise<Object3D>;
}
/** See scaleSource. */
export type ScaleSource = ReturnType<typeof scaleSource>;

/** The scales of a model as objects, each loaded once: as GLB, or out of the vertex-split stream. */
export function scaleSource(
  reader: PackageReader,
  options: LoadOptions,
  materials: MaterialSet,
  pool: WorkerPool,
  signal: AbortSignal,
  added: (slot: Slot) => void,
  problem: (error: unknown, what: string) => void,
) {
  const { manifest, form } = reader;
  const shapes = new Map<number, Object3D>();
  const underWay = new Map<number, ScaleLoad>();
  let splits: SplitShapes | undefined;
  let usable = false; // the stream
  /** That of the coarsest scale: it has the materials and their textures. */
  let first: ParsedGltf | undefined;

  const glbBytes = (scale: number): number => manifest.scales.find((s) => s.scale === scale)?.glb.bytes ?? 0;
  const streamBytes = (scale: number): number => (usable ? splits!.bytesOf(scale) : Infinity);
  const usesStream = (scale: number): boolean => streamBytes(scale) <= (options.meshes === 'stream' ? Number.MAX_VALUE : glbBytes(scale));

  async function read(scale: number, arrived: () => void, passed: (scale: number) => void): Promise<Object3D> {
    const known = shapes.get(scale);
    if (known) return known;
    if (first && usesStream(scale))
      try {
        return await splits!.load(scale, first, signal, arrived, (s, mesh: Mesh) => {
          if (shapes.has(s) && s !== manifest.scales.at(-1)!.scale) return;
          shapes.set(s, mesh);
          if (s !== scale) passed(s);
        });
      } catch (error) {
        if (isAbort(error)) throw error;
        usable = false;
        problem(error, 'vertex splits');
      }
    const glb = await reader.scaleGlb(scale, { signal });
    arrived();
    await reader.decoded(signal, 'requireSelfContained', glb);
    const gltf = await parseScale(options.gltfLoader(), glb, first !== undefined);
    first ??= gltf;
    materials.adopt(gltf, meshesOf(gltf.scene), added);
    shapes.set(scale, gltf.scene);
    return gltf.scene;
  }

  return {
    /** Reads the head of the vertex-split stream, where it is to be used. */
    async openStream(): Promise<void> {
      const { meshes } = options;
      // A tree's stream comes as a whole file.
      const cheap = meshes === 'stream' || (meshes !== 'glb' && form !== 'files');
      if (!manifest.stream || manifest.scales.length < 2 || !cheap) return;
      try {
        const { splitShapes } = await import('./split_shape');
        splits = await splitShapes(reader, pool, materials, added, signal);
        usable = true;
      } catch (error) {
        if (isAbort(error)) throw error;
        if (!pool.none) problem(error, 'vertex splits'); // GLB files do, too
      }
    },
    /** Bytes that a scale still costs. */
    bytesOf: (scale: number): number => (shapes.has(scale) ? 0 : usesStream(scale) ? streamBytes(scale) : glbBytes(scale)),
    /** Loads a scale; `passed` hears of coarser ones that are complete on the way. */
    load(scale: number, passed: (scale: number) => void): ScaleLoad {
      const asked = underWay.get(scale);
      if (asked) return asked;
      let tellArrived = (): void => undefined;
      const arrived = new Promise<void>((done) => (tellArrived = done));
      const load = { arrived, shape: read(scale, tellArrived, passed) };
      underWay.set(scale, load);
      const end = (): void => {
        underWay.delete(scale);
        tellArrived();
      };
      load.shape.then(end, end);
      return load;
    },
    /** A scale that is there. */
    shape: (scale: number): Object3D | undefined => shapes.get(scale),
    dispose(): void {
      shapes.forEach(disposeGeometries);
      if (first) disposeGeometries(first.scene);
      splits?.dispose();
      shapes.clear();
      first = undefined;
    },
  };
}
