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
  private readonly shapes_ = new Map<number, Promise<Object3D>>();
  private readonly files_ = new Map<number, Promise<Uint8Array>>();
  private readonly made_: Object3D[] = [];
  /** That of the coarsest scale: it has the materials and their textures. */
  private firstGltf_?: ParsedGltf;

  constructor(
    private readonly reader_: PackageReader,
    private readonly options_: LoadOptions,
    private readonly materials_: MaterialSet,
    private readonly pool_: WorkerPool,
    private readonly added_: (slot: Slot) => void,
  ) {
    void this.pool_;
  }

  coarsest(signal: AbortSignal): Coarsest {
    const { scale, glb } = this.reader_.manifest.scales[this.reader_.manifest.scales.length - 1];
    let near: () => void = () => undefined;
    const almost = new Promise<void>((done) => (near = done));
    let first = 0;
    const bytes = this.reader_.scaleGlb(scale, {
      signal,
      onBytes: (received) => {
        const now = nowS();
        first ||= now;
        const flying = now > first ? (received / (now - first)) * this.reader_.client.rttS : 0;
        if (glb.bytes - received <= Math.max(4096, flying)) near();
      },
    });
    bytes.then(near, near);
    this.files_.set(scale, bytes);
    return { almostThere: almost, bytes };
  }

  /** Bytes that a scale costs. */
  bytesOf(scale: number): number {
    return this.reader_.manifest.scales.find((s) => s.scale === scale)?.glb.bytes ?? 0;
  }

  /** Fetches and decodes a scale, so that get() gives it at once. */
  async prepare(scale: number, signal: AbortSignal): Promise<void> {
    if (!this.files_.has(scale)) {
      const file = this.reader_.scaleGlb(scale, { signal });
      this.files_.set(scale, file);
      file.catch(() => this.files_.delete(scale));
    }
    await this.get(scale);
  }

  get(scale: number): Promise<Object3D> {
    let shape = this.shapes_.get(scale);
    if (!shape) {
      shape = this.make_(scale);
      this.shapes_.set(scale, shape);
      shape.catch(() => this.shapes_.delete(scale));
    }
    return shape;
  }
  private async make_(scale: number): Promise<Object3D> {
    const glb = await this.files_.get(scale)!;
    const gltf = await parseScale(this.options_.gltfLoader(), glb, this.firstGltf_ !== undefined);
    this.firstGltf_ ??= gltf;
    this.materials_.adopt(gltf, this.added_);
    this.made_.push(gltf.scene);
    this.files_.set(scale, Promise.resolve(new Uint8Array(0))); // the object stands for it
    return gltf.scene;
  }

  /** Gives all objects that were made, for their geometries to be disposed of. */
  dispose(): Object3D[] {
    this.shapes_.clear();
    this.files_.clear();
    return this.made_.splice(0);
  }
}
