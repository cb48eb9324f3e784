import { BufferAttribute, BufferGeometry, Material, Mesh } from 'three';
import { concat } from '../format/bytes';
import { FormatError } from '../format/errors';
import type { PackageReader } from '../http/package_reader';
import type { WorkerPool } from '../worker/pool';
import type { SplitInfo, SplitUpdate } from '../worker/protocol';
import { MaterialSet, ParsedGltf, Slot, meshesOf } from './scale_parts';

/** Bytes behind the head that its request brings along. */
const withHeadBytes = 12 << 10;
/** Scales that stand together within so many bytes are fetched by one request. */
const leastRequestBytes = 32 << 10;

let streamCount = 0;

/** The scales of a model out of its vertex-split stream: one set of buffers that is appended to, an index per scale. */
export type SplitShapes = Awaited<ReturnType<typeof splitShapes>>;

/** Reads the head of a package's stream of vertex splits. `added` hears of materials' slots that no GLB had. */
export async function splitShapes(
  reader: PackageReader,
  pool: WorkerPool,
  materials: MaterialSet,
  added: (slot: Slot) => void,
  openSignal: AbortSignal,
) {
  const key = ++streamCount;
  const known = (await reader.splitStreamStart(withHeadBytes, openSignal))!; // the head, and some bytes that came with it
  const info = await pool.openSplits(key, known.subarray(0, reader.manifest.stream!.headBytes));
  const most = info.scales.at(-1)!.wedges;
  const attributes = new Map<string, BufferAttribute>();
  const meshes = new Map<number, Mesh>();
  let decoded = info.headBytes; // up to there
  let turn: Promise<unknown> = Promise.resolve();

  async function bytes(from: number, to: number, signal: AbortSignal): Promise<Uint8Array> {
    const verify = (got: Uint8Array): Promise<void> => pool.checkSplits(key, from, got);
    const first = known.subarray(from, to);
    const rest = to - from - first.length;
    if (first.length > 0)
      try {
        const all = rest > 0 ? concat([first, await reader.splitStream(to - rest, rest, { signal })]) : first;
        await verify(all);
        return all;
      } catch (error) {
        if (!(error instanceof FormatError)) throw error; // damaged on the way, perhaps with the head
      }
    return reader.splitStream(from, to - from, { signal, verify });
  }
  /** Appends values to a buffer; one that is too small is replaced by one with room for more. */
  function append(name: string, components: number, values: Float32Array, { from, to }: SplitUpdate): void {
    let attribute = attributes.get(name);
    if (!attribute || attribute.count < to) {
      const grown = new BufferAttribute(new Float32Array(components * Math.max(to, Math.min(2 * from, most))), components);
      if (attribute) grown.array.set(attribute.array.subarray(0, components * from));
      attributes.set(name, (attribute = grown));
      for (const { geometry } of meshes.values()) geometry.setAttribute(name, grown);
    } else attribute.addUpdateRange(components * from, components * (to - from));
    attribute.array.set(values, components * from);
    attribute.needsUpdate = true;
  }
  /** The material that a mesh of this geometry gets: that of the GLB with this number, or its first. */
  async function materialOf(gltf: ParsedGltf, index: number, geometry: BufferGeometry): Promise<Material> {
    const { parser, scene } = gltf;
    const there = index < (parser.json.materials ?? []).length;
    const chosen = there ? ((await parser.getDependency('material', index)) as Material) : (meshesOf(scene)[0]?.material as Material | undefined);
    if (!chosen) throw new FormatError('mesh', '', `material ${index}`, 'none');
    const mesh = new Mesh(geometry, chosen);
    parser.assignFinalMaterial(mesh);
    materials.adopt(gltf, [mesh], added);
    return mesh.material as Material;
  }
  async function add(scale: number, update: SplitUpdate, gltf: ParsedGltf): Promise<Mesh> {
    for (const { name, components, values } of update.attributes) append(name, components, values, update);
    const geometry = new BufferGeometry();
    attributes.forEach((attribute, name) => geometry.setAttribute(name, attribute));
    geometry.setIndex(new BufferAttribute(update.index, 1));
    const chosen: Material[] = [];
    for (const { material, start, count } of update.draws) geometry.addGroup(start, count, chosen.push(await materialOf(gltf, material, geometry)) - 1);
    const mesh = new Mesh(geometry, chosen.length === 1 ? chosen[0] : chosen);
    mesh.name = `S_${scale}`;
    meshes.set(scale, mesh);
    return mesh;
  }

  return {
    /** Bytes that a scale still costs; Infinity where the stream does not pass it. */
    bytesOf(scale: number): number {
      const s = info.scales.find((k) => k.scale === scale);
      return s ? Math.max(0, s.end - Math.max(decoded, known.length)) : Infinity;
    },
    /**
     * Fetches and decodes up to a scale. `arrived` when its bytes are there; `passed` hears of every scale on the way,
     * the one asked for included.
     */
    load(scale: number, gltf: ParsedGltf, signal: AbortSignal, arrived: () => void, passed: (scale: number, mesh: Mesh) => void): Promise<Mesh> {
      const run = async (): Promise<Mesh> => {
        // Scales joined to requests of a useful size; all are made at once.
        const groups: { from: number; scales: SplitInfo['scales'] }[] = [];
        for (const s of info.scales) {
          if (s.end <= decoded || s.scale < scale) continue;
          const last = groups.at(-1);
          if (last && s.end - last.from <= leastRequestBytes) last.scales.push(s);
          else groups.push({ from: last ? last.scales.at(-1)!.end : decoded, scales: [s] });
        }
        const requests = groups.map(({ from, scales }) => bytes(from, scales.at(-1)!.end, signal));
        Promise.all(requests).then(arrived, arrived);
        for (const [i, { from, scales }] of groups.entries()) {
          const got = await requests[i];
          for (const { scale: passing, end } of scales) {
            const update = await pool.addSplits(key, got.subarray(decoded - from, end - from));
            decoded = end;
            passed(passing, await add(passing, update, gltf));
          }
        }
        return meshes.get(scale)!;
      };
      const mesh = turn.then(run);
      turn = mesh.catch(() => undefined);
      return mesh;
    },
    dispose(): void {
      pool.closeSplits(key);
      meshes.forEach((mesh) => mesh.geometry.dispose());
    },
  };
}
