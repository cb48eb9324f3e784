import { BufferAttribute, BufferGeometry, Material, Mesh } from 'three';
import { sumOf } from '../decide/numbers';
import { concat } from '../format/sha256';
import { FormatError } from '../format/errors';
import type { PackageReader } from '../http/package_reader';
import type { WorkerPool } from '../worker/pool';
import type { SplitInfo, SplitUpdate } from '../worker/protocol';
import type { MadeTangents } from '../worker/tangents';
import { type MaterialSet, type ParsedGltf, type Slot, meshesOf, tangentTexcoords } from './scale_parts';

/** Bytes behind the head that the request for the head brings along. */
const withHeadBytes = 12 << 10;
/** Scales that stand together within so many bytes are fetched by one request. */
const leastRequestBytes = 32 << 10;

let streamCount = 0;

/** Reads the stream's head. `added` hears of slots that no GLB had; see ScaleSourceParts for `leadBytes`. */
export async function openSplitShapes(reader: PackageReader, pool: WorkerPool, materials: MaterialSet,
    added: (slot: Slot) => void, leadBytes: () => number, signal: AbortSignal): Promise<SplitShapes> {
  const key = ++streamCount;
  // the head, and some bytes that came with it
  const known = (await reader.splitStreamStart(withHeadBytes, signal))!;
  const info = await pool.openSplits(key, known.subarray(0, reader.manifest.stream!.headBytes));
  return new SplitShapes(reader, pool, materials, added, leadBytes, key, known, info);
}

/** Scales that are fetched by one request. */
interface ScaleRun {
  from: number;
  scales: SplitInfo['scales'];
}

/** The scales of a vertex-split stream: one set of buffers that grows, and an index for each scale. */
export class SplitShapes {
  private readonly attributes_ = new Map<string, BufferAttribute>();
  private readonly meshes_ = new Map<number, Mesh>();
  private decoded_: number; // bytes of the stream
  private lastLoad_: Promise<unknown> = Promise.resolve();

  constructor(private readonly reader_: PackageReader, private readonly pool_: WorkerPool,
      private readonly materials_: MaterialSet, private readonly added_: (slot: Slot) => void,
      private readonly leadBytes_: () => number, private readonly key_: number,
      private readonly known_: Uint8Array, private readonly info_: SplitInfo) {
    this.decoded_ = info_.headBytes;
  }

  /** Bytes that a scale still costs; Infinity where the stream does not pass the scale. */
  bytesOf(scale: number): number {
    const s = this.info_.scales.find((k) => k.scale === scale);
    return s ? Math.max(0, s.end - Math.max(this.decoded_, this.known_.length)) : Infinity;
  }
  /** Fetches and decodes up to a scale. `arrived`: all but `leadBytes` are there; `passed`: each scale. */
  load(scale: number, gltf: ParsedGltf, signal: AbortSignal, arrived: () => void, passed: (scale: number,
      mesh: Mesh) => void): Promise<Mesh> {
    const mesh = this.lastLoad_.then(() => this.loadNow_(scale, gltf, signal, arrived, passed));
    this.lastLoad_ = mesh.catch(() => undefined);
    return mesh;
  }
  dispose(): void {
    this.pool_.closeSplits(this.key_);
    this.meshes_.forEach((mesh) => mesh.geometry.dispose());
  }

  private async loadNow_(scale: number, gltf: ParsedGltf, signal: AbortSignal, arrived: () => void,
      passed: (scale: number, mesh: Mesh) => void): Promise<Mesh> {
    const runs = this.runsUpTo_(scale);
    const left = runs.map(() => Infinity);
    const come = (run: number, bytes: number): void => {
      left[run] = bytes;
      if (sumOf(left) <= this.leadBytes_()) arrived();
    };
    // all are made at once
    const requests = runs.map(({ from, scales }, i) =>
      this.bytes_(from, scales.at(-1)!.end, signal, (bytes) => come(i, bytes)));
    Promise.all(requests).then(arrived, arrived);
    for (const [i, { from, scales }] of runs.entries()) {
      const got = await requests[i];
      for (const { scale: passing, end } of scales) {
        const update = await this.pool_.addSplits(this.key_, got.subarray(this.decoded_ - from, end - from),
          tangentTexcoords(gltf.parser.json));
        this.decoded_ = end;
        passed(passing, await this.add_(passing, update, gltf));
      }
    }
    return this.meshes_.get(scale)!;
  }
  /** Scales that are still to come, joined to requests of a useful size. */
  private runsUpTo_(scale: number): ScaleRun[] {
    const runs: ScaleRun[] = [];
    for (const s of this.info_.scales) {
      if (s.end <= this.decoded_ || s.scale < scale) continue;
      const last = runs.at(-1);
      if (last && s.end - last.from <= leastRequestBytes) last.scales.push(s);
      else runs.push({ from: last ? last.scales.at(-1)!.end : this.decoded_, scales: [s] });
    }
    return runs;
  }
  /** `left` hears of the bytes that are still to come. */
  private async bytes_(from: number, to: number, signal: AbortSignal,
      left: (bytes: number) => void): Promise<Uint8Array> {
    const verify = (got: Uint8Array): Promise<void> => this.pool_.checkSplits(this.key_, from, got);
    const first = this.known_.subarray(from, to);
    const rest = to - from - first.length;
    left(rest);
    const onBytes = (received: number): void => left(rest - received);
    if (first.length > 0)
      try {
        const all = rest > 0
          ? concat([first, await this.reader_.splitStream(to - rest, rest, { signal, onBytes })]) : first;
        await verify(all);
        return all;
      } catch (error) {
        if (!(error instanceof FormatError)) throw error; // damaged on the way, perhaps with the head
      }
    return this.reader_.splitStream(from, to - from, { signal, verify, onBytes });
  }

  private async add_(scale: number, update: SplitUpdate, gltf: ParsedGltf): Promise<Mesh> {
    for (const { name, components, values } of update.attributes)
      this.append_(name, components, values, update);
    const geometry = new BufferGeometry();
    this.attributes_.forEach((attribute, name) => geometry.setAttribute(name, attribute));
    if (update.tangents) this.setTangents_(geometry, update.tangents, update.to);
    geometry.setIndex(new BufferAttribute(update.index, 1));
    const chosen: Material[] = [];
    for (const { material, start, count } of update.draws)
      geometry.addGroup(start, count, chosen.push(await this.materialOf_(gltf, material, geometry)) - 1);
    const mesh = new Mesh(geometry, chosen.length === 1 ? chosen[0] : chosen);
    mesh.name = `S_${scale}`;
    this.meshes_.set(scale, mesh);
    return mesh;
  }
  /** Tangents of this scale alone. Where wedges were added for them its other buffers are its own, too. */
  private setTangents_(geometry: BufferGeometry, { values, added }: MadeTangents, wedges: number): void {
    if (added.length > 0)
      for (const [name, { array, itemSize }] of this.attributes_) {
        const own = new Float32Array(itemSize * (wedges + added.length));
        own.set(array.subarray(0, itemSize * wedges) as Float32Array);
        added.forEach((w, i) =>
          own.set(array.subarray(itemSize * w, itemSize * (w + 1)) as Float32Array, itemSize * (wedges + i)));
        geometry.setAttribute(name, new BufferAttribute(own, itemSize));
      }
    geometry.setAttribute('tangent', new BufferAttribute(values, 4, true));
  }
  /** Appends values to a buffer; a buffer that is too small is replaced by a larger one. */
  private append_(name: string, components: number, values: Float32Array, { from, to }: SplitUpdate): void {
    let attribute = this.attributes_.get(name);
    if (!attribute || attribute.count < to) {
      const most = this.info_.scales.at(-1)!.wedges;
      const grown = new BufferAttribute(new Float32Array(components * Math.max(to, Math.min(2 * from, most))),
        components);
      const before = attribute;
      if (before) grown.array.set(before.array.subarray(0, components * from));
      this.attributes_.set(name, (attribute = grown));
      for (const { geometry } of this.meshes_.values()) {
        if (geometry.getAttribute(name) !== before) continue;
        geometry.dispose(); // three.js frees the buffers of attributes that a geometry still has, no others
        geometry.setAttribute(name, grown);
      }
    } else attribute.addUpdateRange(components * from, components * (to - from));
    attribute.array.set(values, components * from);
    attribute.needsUpdate = true;
  }
  /** The material of a mesh of this geometry: the GLB's with this number, or its first. */
  private async materialOf_(gltf: ParsedGltf, index: number, geometry: BufferGeometry): Promise<Material> {
    const { parser, scene } = gltf;
    const there = index < (parser.json.materials ?? []).length;
    const chosen = there ? ((await parser.getDependency('material', index)) as Material)
      : (meshesOf(scene)[0]?.material as Material | undefined);
    if (!chosen) throw new FormatError('mesh', '', `material ${index}`, '', 'S23');
    const mesh = new Mesh(geometry, chosen);
    parser.assignFinalMaterial(mesh);
    this.materials_.shareMaterials(gltf, [mesh], this.added_);
    return mesh.material as Material;
  }
}
