import type { Mesh, Object3D } from 'three';
import { isAbort } from '../format/errors';
import { type ManifestScale, hasGlb } from '../format/manifest';
import type { PackageReader } from '../http/package_reader';
import type { WorkerPool } from '../worker/pool';
import type { LoadOptions } from './api';
import { type MaterialSet, type ParsedGltf, type Slot, disposeGeometries, meshesOf,
  parseScale } from './scale_parts';
import type { SplitShapes } from './split_shape';

/** A scale on its way. */
export interface ScaleLoad {
  /** All bytes are there, or as many that a request that is made now is answered when the last one comes. */
  arrived: Promise<void>;
  shape: Promise<Object3D>;
}

/** The parts of a load that a ScaleSource works with. */
export interface ScaleSourceParts {
  reader: PackageReader;
  options: LoadOptions;
  materials: MaterialSet;
  pool: WorkerPool;
  signal: AbortSignal;
  /** Hears of every slot of a material that has a texture of the package. */
  added: (slot: Slot) => void;
  /** Bytes that the link brings between a request and its answer. */
  leadBytes: () => number;
  /** Hears of a problem for which there is another way. */
  problem: (error: unknown, what: string) => void;
}

/** The scales of a model as objects: GLBs or splits. Without its stream, the next finer GLB stands in. */
export class ScaleSource {
  private readonly shapes_ = new Map<number, Object3D>();
  private readonly offGpu_ = new Set<Object3D>(); // scales that were there and are not drawn
  private readonly underWay_ = new Map<number, ScaleLoad>();
  private splits_?: SplitShapes;
  private opening_?: Promise<void>;
  private streamUsable_ = false;
  /** The GLB of the coarsest scale, which has the materials and their textures. */
  private first_?: ParsedGltf;

  constructor(private readonly parts_: ScaleSourceParts) {}

  /** Asks for what decisions about scales and textures are made from. */
  fetchDocuments(withMesh = false): Promise<unknown> {
    const { reader, signal } = this.parts_;
    const documents = reader.prefetchDocuments(signal, withMesh);
    this.openStream().catch(() => undefined); // whoever wants scales of the stream hears of it
    return documents;
  }
  /** Reads the head of the vertex-split stream once, where the stream is to be used. */
  openStream(): Promise<void> {
    return (this.opening_ ??= this.openStream_());
  }
  private async openStream_(): Promise<void> {
    const { reader, options, pool, materials, added, leadBytes, signal, problem } = this.parts_;
    const { meshes } = options;
    // A tree's stream comes as a whole file.
    const cheap = meshes === 'stream' || (meshes !== 'glb' && reader.form !== 'files');
    if (!reader.manifest.stream || reader.manifest.scales.length < 2 || !cheap) return;
    try {
      const { openSplitShapes } = await import('./split_shape');
      this.splits_ = await openSplitShapes(reader, pool, materials, added, leadBytes, signal);
      this.streamUsable_ = true;
    } catch (error) {
      if (isAbort(error)) throw error;
      if (!pool.isUnavailable) problem(error, 'vertex splits'); // GLB files do, too
    }
  }
  /** Bytes that a scale still costs. */
  bytesOf(scale: number): number {
    if (this.shapes_.has(scale)) return 0;
    return this.usesStream_(scale) ? this.streamBytes_(scale) : this.glbBytes_(scale);
  }
  /** Loads a scale; `passed` hears of coarser scales that are complete on the way. */
  load(scale: number, passed: (scale: number) => void): ScaleLoad {
    const asked = this.underWay_.get(scale);
    if (asked) return asked;
    let resolveArrived = (): void => undefined;
    const arrived = new Promise<void>((done) => (resolveArrived = done));
    const load = { arrived, shape: this.read_(scale, resolveArrived, passed) };
    this.underWay_.set(scale, load);
    const end = (): void => {
      this.underWay_.delete(scale);
      resolveArrived();
    };
    load.shape.then(end, end);
    return load;
  }
  /** A scale that is there, to be shown. */
  shape(scale: number): Object3D | undefined {
    const shape = this.shapes_.get(scale);
    if (shape) this.offGpu_.delete(shape);
    return shape;
  }
  /** All scales that are on the GPU, or may be. */
  all(): Object3D[] {
    // the stream's coarsest scale has taken the place of the GLB's
    const shapes = [...this.shapes_.values(), ...(this.first_ ? [this.first_.scene] : [])];
    return [...new Set(shapes)].filter((shape) => !this.offGpu_.has(shape));
  }
  /** Takes all scales off the GPU; those that are drawn get there again. */
  leaveGpu(): void {
    for (const shape of this.all()) {
      disposeGeometries(shape); // of a lost context they are gone already
      if (!shape.parent) this.offGpu_.add(shape);
    }
  }
  dispose(): void {
    this.shapes_.forEach(disposeGeometries);
    if (this.first_) disposeGeometries(this.first_.scene);
    this.splits_?.dispose();
    this.shapes_.clear();
    this.first_ = undefined;
  }

  /** The coarsest scale with a file that is no coarser than this one. */
  private fileFor_(scale: number): ManifestScale {
    return this.parts_.reader.manifest.scales.filter((s) => s.scale <= scale && hasGlb(s)).at(-1)!;
  }
  private glbBytes_(scale: number): number {
    const file = this.fileFor_(scale);
    return this.shapes_.has(file.scale) ? 0 : file.glb.bytes;
  }
  private streamBytes_(scale: number): number {
    return this.streamUsable_ ? this.splits_!.bytesOf(scale) : Infinity;
  }
  private usesStream_(scale: number): boolean {
    const most = this.parts_.options.meshes === 'stream' ? Number.MAX_VALUE : this.glbBytes_(scale);
    return this.streamBytes_(scale) <= most;
  }
  private async read_(scale: number, arrived: () => void,
      passed: (scale: number) => void): Promise<Object3D> {
    const known = this.shapes_.get(scale);
    if (known) return known;
    if (this.first_ && this.usesStream_(scale))
      try {
        return await this.readSplits_(scale, this.first_, arrived, passed);
      } catch (error) {
        if (isAbort(error)) throw error;
        this.streamUsable_ = false;
        this.parts_.problem(error, 'vertex splits');
      }
    return this.readGlb_(scale, arrived);
  }
  private readSplits_(scale: number, first: ParsedGltf, arrived: () => void,
      passed: (scale: number) => void): Promise<Object3D> {
    const coarsest = this.parts_.reader.manifest.scales.at(-1)!.scale;
    return this.splits_!.load(scale, first, this.parts_.signal, arrived, (s, mesh: Mesh) => {
      if (this.shapes_.has(s) && s !== coarsest) return;
      this.shapes_.set(s, mesh);
      if (s !== scale) passed(s);
    });
  }
  private async readGlb_(scale: number, arrived: () => void): Promise<Object3D> {
    const { reader, options, materials, signal, added, leadBytes } = this.parts_;
    const { scale: file, glb: { bytes } } = this.fileFor_(scale);
    const known = this.shapes_.get(file);
    if (known) {
      this.shapes_.set(scale, known);
      return known;
    }
    const onBytes = (received: number): void => {
      if (bytes - received <= leadBytes()) arrived();
    };
    const glb = await reader.scaleGlb(file, { signal, onBytes });
    arrived();
    const placeholders = this.first_ !== undefined;
    await reader.decoded(signal, 'requireSelfContained', glb, placeholders);
    const gltf = await parseScale(options.gltfLoader(), glb, placeholders);
    this.first_ ??= gltf;
    materials.shareMaterials(gltf, meshesOf(gltf.scene), added);
    for (const s of [file, scale]) this.shapes_.set(s, gltf.scene);
    return gltf.scene;
  }
}
