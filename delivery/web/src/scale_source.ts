import type { Mesh, Object3D } from 'three';
import type { LoadOptions } from './api';
import { isAbort, nowS } from './http';
import type { PackageReader } from './package_reader';
import { MaterialSet, ParsedGltf, Slot, disposeGeometries, meshesOf, parseScale } from './scale_parts';
import type { SplitShapes } from './split_shape';
import type { WorkerPool } from './worker_pool';

/** A download that tells when it is nearly complete. */
interface Coarsest {
  /** So little is missing that the next request may be made: its answer follows without a pause. */
  almostThere: Promise<void>;
  bytes: Promise<Uint8Array>;
}
/** A scale on its way. */
export interface ScaleLoad {
  /** All bytes are there. */
  arrived: Promise<void>;
  shape: Promise<Object3D>;
}

/** The scales of a model as objects, each loaded once: as GLB, or out of the vertex-split stream. */
export class ScaleSource {
  private readonly shapes_ = new Map<number, Object3D>();
  private readonly underWay_ = new Map<number, ScaleLoad>();
  private splits_?: SplitShapes;
  private splitsOpen_ = false;
  private coarsestFile_?: Promise<Uint8Array>;
  /** That of the coarsest scale: it has the materials and their textures. */
  private firstGltf_?: ParsedGltf;

  constructor(
    private readonly reader_: PackageReader,
    private readonly options_: LoadOptions,
    private readonly materials_: MaterialSet,
    private readonly pool_: WorkerPool,
    private readonly added_: (slot: Slot) => void,
    private readonly problem_: (error: unknown, what: string) => void,
  ) {}

  coarsest(signal: AbortSignal): Coarsest {
    const { scale, glb } = this.coarsestScale_;
    let near: () => void = () => undefined;
    const almostThere = new Promise<void>((done) => (near = done));
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
    this.coarsestFile_ = bytes;
    return { almostThere, bytes };
  }
  private get coarsestScale_() {
    const { scales } = this.reader_.manifest;
    return scales[scales.length - 1];
  }

  /** Reads the head of the vertex-split stream, where it is to be used. */
  async openStream(signal: AbortSignal): Promise<void> {
    const { manifest, form } = this.reader_;
    const { meshes } = this.options_;
    // A tree's stream comes as a whole file.
    const cheap = meshes === 'stream' || (meshes !== 'glb' && form !== 'files');
    if (!manifest.stream || manifest.scales.length < 2 || !cheap) return;
    try {
      const { splitShapes } = await import('./split_shape');
      this.splits_ = await splitShapes(this.reader_, this.pool_, this.materials_, this.added_, signal);
      this.splitsOpen_ = true;
    } catch (error) {
      if (isAbort(error)) throw error;
      if (!this.pool_.none) this.problem_(error, 'vertex splits'); // GLB files do, too
    }
  }
  private glbBytes_(scale: number): number {
    return this.reader_.manifest.scales.find((s) => s.scale === scale)?.glb.bytes ?? 0;
  }
  private usesStream_(scale: number): boolean {
    if (!this.splits_ || !this.splitsOpen_) return false;
    const bytes = this.splits_.bytesOf(scale);
    return Number.isFinite(bytes) && (this.options_.meshes === 'stream' || bytes <= this.glbBytes_(scale));
  }
  /** Bytes that a scale still costs. */
  bytesOf(scale: number): number {
    if (this.shapes_.has(scale)) return 0;
    return this.usesStream_(scale) ? this.splits_!.bytesOf(scale) : this.glbBytes_(scale);
  }

  /** Loads a scale; `passed` hears of coarser ones that are complete on the way. */
  load(scale: number, signal: AbortSignal, passed: (scale: number) => void): ScaleLoad {
    const known = this.shapes_.get(scale);
    if (known) return { arrived: Promise.resolve(), shape: Promise.resolve(known) };
    const asked = this.underWay_.get(scale);
    if (asked) return asked;
    let arrive: () => void = () => undefined;
    const arrived = new Promise<void>((done) => (arrive = done));
    const shape = this.load_(scale, signal, arrive, passed);
    const load = { arrived, shape };
    this.underWay_.set(scale, load);
    const end = (): void => {
      this.underWay_.delete(scale);
      arrive();
    };
    shape.then(end, end);
    return load;
  }
  private async load_(
    scale: number,
    signal: AbortSignal,
    arrived: () => void,
    passed: (scale: number) => void,
  ): Promise<Object3D> {
    if (this.usesStream_(scale) && this.firstGltf_) {
      try {
        return await this.splits_!.load(scale, this.firstGltf_, signal, arrived, (s, mesh: Mesh) => {
          if (this.shapes_.has(s) && s !== this.coarsestScale_.scale) return;
          this.shapes_.set(s, mesh);
          if (s !== scale) passed(s);
        });
      } catch (error) {
        if (isAbort(error)) throw error;
        this.splitsOpen_ = false;
        this.problem_(error, 'vertex splits');
      }
    }
    const coarsest = scale === this.coarsestScale_.scale && this.coarsestFile_;
    const glb = await (coarsest || this.reader_.scaleGlb(scale, { signal }));
    arrived();
    await this.reader_.decoded(signal, 'requireOwnBytes', glb);
    const gltf = await parseScale(this.options_.gltfLoader(), glb, this.firstGltf_ !== undefined);
    this.firstGltf_ ??= gltf;
    this.materials_.adopt(gltf, meshesOf(gltf.scene), this.added_);
    this.shapes_.set(scale, gltf.scene);
    return gltf.scene;
  }
  /** A scale that is there. */
  shape(scale: number): Object3D | undefined {
    return this.shapes_.get(scale);
  }

  dispose(): void {
    for (const shape of this.shapes_.values()) disposeGeometries(shape);
    for (const mesh of this.firstGltf_ ? meshesOf(this.firstGltf_.scene) : []) mesh.geometry.dispose();
    this.splits_?.dispose();
    this.shapes_.clear();
    this.coarsestFile_ = undefined;
    this.firstGltf_ = undefined;
  }
}
