import type { Object3D } from 'three';
import type { LoadOptions } from './api';
import { nowS } from './http';
import type { PackageReader } from './package_reader';
import { MaterialSet, ParsedGltf, Slot, parseScale } from './scale_parts';
import type { WorkerPool } from './worker_pool';

/** A download that tells when it is nearly complete. */
interface Coarsest {
  /** So little is missing that the next request may be made: its answer follows without a pause. */
  almostThere: Promise<void>;
  bytes: Promise<Uint8Array>;
}

/** The scales of a model as objects, each loaded once. */
export class ScaleSource {
  private readonly shapes = new Map<number, Promise<Object3D>>();
  private readonly files = new Map<number, Promise<Uint8Array>>();
  private readonly made: Object3D[] = [];
  /** That of the coarsest scale: it has the materials and their textures. */
  private firstGltf?: ParsedGltf;

  constructor(
    private readonly reader: PackageReader,
    private readonly options: LoadOptions,
    private readonly materials: MaterialSet,
    private readonly pool: WorkerPool,
    private readonly added: (slot: Slot) => void,
  ) {
    void this.pool;
  }

  coarsest(signal: AbortSignal): Coarsest {
    const { scale, glb } = this.reader.manifest.scales[this.reader.manifest.scales.length - 1];
    let near: () => void = () => undefined;
    const almost = new Promise<void>((done) => (near = done));
    let first = 0;
    const bytes = this.reader.scaleGlb(scale, {
      signal,
      onBytes: (received) => {
        const now = nowS();
        first ||= now;
        const flying = now > first ? (received / (now - first)) * this.reader.client.rttS : 0;
        if (glb.bytes - received <= Math.max(4096, flying)) near();
      },
    });
    bytes.then(near, near);
    this.files.set(scale, bytes);
    return { almostThere: almost, bytes };
  }

  /** Bytes that a scale costs. */
  bytesOf(scale: number): number {
    return this.reader.manifest.scales.find((s) => s.scale === scale)?.glb.bytes ?? 0;
  }

  /** Fetches and decodes a scale, so that get() gives it at once. */
  async prepare(scale: number, signal: AbortSignal): Promise<void> {
    if (!this.files.has(scale)) {
      const file = this.reader.scaleGlb(scale, { signal });
      this.files.set(scale, file);
      file.catch(() => this.files.delete(scale));
    }
    await this.get(scale);
  }

  get(scale: number): Promise<Object3D> {
    let shape = this.shapes.get(scale);
    if (!shape) {
      shape = this.make(scale);
      this.shapes.set(scale, shape);
      shape.catch(() => this.shapes.delete(scale));
    }
    return shape;
  }
  private async make(scale: number): Promise<Object3D> {
    const glb = await this.files.get(scale)!;
    const gltf = await parseScale(this.options.gltfLoader(), glb, this.firstGltf !== undefined);
    this.firstGltf ??= gltf;
    this.materials.adopt(gltf, this.added);
    this.made.push(gltf.scene);
    this.files.set(scale, Promise.resolve(new Uint8Array(0))); // the object stands for it
    return gltf.scene;
  }

  /** Gives all objects that were made, for their geometries to be disposed of. */
  dispose(): Object3D[] {
    this.shapes.clear();
    this.files.clear();
    return this.made.splice(0);
  }
}
