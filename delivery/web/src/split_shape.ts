import { BufferAttribute, BufferGeometry, Material, Mesh } from 'three';
import { FormatError, InputError } from './errors';
import { concat } from './http';
import type { PackageReader } from './package_reader';
import { MaterialSet, ParsedGltf, Slot, materialFor } from './scale_parts';
import type { WorkerPool } from './worker_pool';
import type { SplitInfo, SplitUpdate } from './worker_protocol';

/** Bytes behind the head that its request brings along. */
const withHeadBytes = 12 << 10;
/** Scales that stand together within so many bytes are fetched by one request. */
const leastRequestBytes = 32 << 10;

const attributeNames = { uv0: 'uv', uv1: 'uv1', normal: 'normal', colour: 'color' } as const;
let streamCount = 0;

/** The scales of a model out of its vertex-split stream: one set of buffers that is appended to, an index per scale. */
export class SplitShapes {
  private info_?: SplitInfo;
  private known_: Uint8Array = new Uint8Array(0); // bytes that came with the head
  private readonly key_ = ++streamCount;
  private decoded_ = 0; // bytes, head included
  private readonly attributes_ = new Map<string, BufferAttribute>();
  private capacity_ = 0;
  private readonly meshes_ = new Map<number, Mesh>();
  private turn_: Promise<unknown> = Promise.resolve();

  constructor(
    private readonly reader_: PackageReader,
    private readonly pool_: WorkerPool,
    private readonly materials_: MaterialSet,
    private readonly added_: (slot: Slot) => void,
  ) {}

  /** Reads the head; what it says of scales is known from then on. */
  async open(signal: AbortSignal): Promise<void> {
    const ref = this.reader_.manifest.stream;
    if (!ref) throw new InputError(this.reader_.store.name, 'mesh/stream.bin', 'a stream of vertex splits', 'none');
    this.known_ = (await this.reader_.splitStreamStart(withHeadBytes, signal))!;
    this.info_ = await this.pool_.openSplits(this.key_, this.known_.subarray(0, ref.headBytes));
    this.decoded_ = this.info_.headBytes;
  }
  /** Bytes that a scale still costs; Infinity while the head is not known or the stream does not pass it. */
  bytesOf(scale: number): number {
    const s = this.info_?.scales.find((k) => k.scale === scale);
    if (!s) return Infinity;
    return Math.max(0, s.end - Math.max(this.decoded_, this.known_.length));
  }

  /**
   * Fetches and decodes up to a scale. `arrived` when its bytes are there; `passed` hears of every scale on the way,
   * the one asked for included.
   */
  load(
    scale: number,
    gltf: ParsedGltf,
    signal: AbortSignal,
    arrived: () => void,
    passed: (scale: number, mesh: Mesh) => void,
  ): Promise<Mesh> {
    const run = async (): Promise<Mesh> => {
      const known = this.meshes_.get(scale);
      if (known) {
        arrived();
        return known;
      }
      const info = this.info_!;
      const wanted = info.scales.filter((s) => s.end > this.decoded_ && s.scale >= scale);
      const requests = this.requests_(wanted, signal);
      Promise.all(requests.map((r) => r.bytes)).then(arrived, arrived);
      for (const { bytes, scales } of requests) {
        const got = await bytes;
        let at = 0;
        for (const s of scales) {
          const size = s.end - this.decoded_;
          const update = await this.pool_.addSplits(this.key_, got.subarray(at, at + size));
          at += size;
          this.decoded_ = s.end;
          passed(s.scale, await this.add_(s.scale, update, gltf));
        }
      }
      return this.meshes_.get(scale)!;
    };
    const turn = this.turn_.then(run);
    this.turn_ = turn.catch(() => undefined);
    return turn;
  }

  /** Scales joined to requests of a useful size; all are made at once. */
  private requests_(
    wanted: SplitInfo['scales'],
    signal: AbortSignal,
  ): { scales: SplitInfo['scales']; bytes: Promise<Uint8Array> }[] {
    const groups: SplitInfo['scales'][] = [];
    let begin = this.decoded_;
    for (const s of wanted) {
      const last = groups[groups.length - 1];
      if (last && s.end - begin <= leastRequestBytes) last.push(s);
      else {
        begin = last ? last[last.length - 1].end : begin;
        groups.push([s]);
      }
    }
    let from = this.decoded_;
    return groups.map((scales) => {
      const at = from;
      from = scales[scales.length - 1].end;
      return { scales, bytes: this.bytes_(at, from, signal) };
    });
  }
  private async bytes_(from: number, to: number, signal: AbortSignal): Promise<Uint8Array> {
    const verify = (got: Uint8Array): Promise<void> => this.pool_.checkSplits(this.key_, from, got);
    const known = this.known_.subarray(from, to);
    if (known.length > 0)
      try {
        const rest = to - from - known.length;
        const more = rest > 0 ? await this.reader_.splitStream(from + known.length, rest, { signal }) : known.subarray(0, 0);
        const all = concat([known, more], to - from);
        await verify(all);
        return all;
      } catch (error) {
        if (!(error instanceof FormatError)) throw error; // damaged on the way, perhaps with the head
      }
    return this.reader_.splitStream(from, to - from, { signal, verify });
  }
  private async add_(scale: number, update: SplitUpdate, gltf: ParsedGltf): Promise<Mesh> {
    this.append_('position', 3, update.positions, update);
    this.info_!.attributes.forEach((a, k) => this.append_(attributeNames[a.kind], a.components, update.attributes[k], update));
    this.capacity_ = Math.max(this.capacity_, update.to);
    for (const mesh of this.meshes_.values()) this.share_(mesh.geometry);
    const geometry = new BufferGeometry();
    this.share_(geometry);
    geometry.setIndex(new BufferAttribute(update.index, 1));
    const mesh = await this.dress_(geometry, update, gltf);
    mesh.name = `S_${scale}`;
    this.meshes_.set(scale, mesh);
    return mesh;
  }
  private share_(geometry: BufferGeometry): void {
    for (const [name, attribute] of this.attributes_)
      if (geometry.getAttribute(name) !== attribute) geometry.setAttribute(name, attribute);
  }
  /** Appends values to a buffer; one that is too small is replaced by one with room for more. */
  private append_(name: string, components: number, values: Float32Array, { from, to }: SplitUpdate): void {
    let attribute = this.attributes_.get(name);
    if (!attribute || attribute.count < to) {
      const grown = new BufferAttribute(new Float32Array(components * Math.max(to, Math.min(2 * from, this.most_))), components);
      if (attribute) grown.array.set(attribute.array.subarray(0, components * from));
      attribute = grown;
      this.attributes_.set(name, grown);
    } else attribute.addUpdateRange(components * from, components * (to - from));
    attribute.array.set(values, components * from);
    attribute.needsUpdate = true;
  }
  private get most_(): number {
    const { scales } = this.info_!;
    return scales[scales.length - 1].wedges;
  }
  /** Materials by group, those of the GLB; neighbours of one material are drawn together. */
  private async dress_(geometry: BufferGeometry, update: SplitUpdate, gltf: ParsedGltf): Promise<Mesh> {
    const materials: Material[] = [];
    let at = 0;
    let last = -1;
    for (const [g, { material }] of this.info_!.groups.entries()) {
      const count = 3 * update.groupTriangles[g];
      if (count === 0) continue;
      if (material === last) geometry.groups[geometry.groups.length - 1].count += count;
      else {
        const mesh = await materialFor(gltf, material, geometry);
        this.materials_.adopt(gltf, [mesh], this.added_);
        geometry.addGroup(at, count, materials.push(mesh.material as Material) - 1);
      }
      last = material;
      at += count;
    }
    geometry.boundingBox = null;
    geometry.computeBoundingSphere();
    return new Mesh(geometry, materials.length === 1 ? materials[0] : materials);
  }

  dispose(): void {
    this.pool_.closeSplits(this.key_);
    for (const mesh of this.meshes_.values()) mesh.geometry.dispose();
    this.meshes_.clear();
    this.attributes_.clear();
    this.known_ = new Uint8Array(0);
  }
}
