import { Material, Mesh, Object3D, Texture } from 'three';
import type { GltfLoaderLike } from './api';

/** The parts of GLTFLoader's result and parser that this library uses. */
export interface ParsedGltf {
  scene: Object3D;
  parser: {
    json: GltfJson;
    associations: Map<object, { materials?: number; textures?: number; nodes?: number } | undefined>;
    getDependency(kind: string, index: number): Promise<unknown>;
    assignFinalMaterial(mesh: Mesh): void;
  };
}
interface GltfJson {
  images?: { name?: string }[];
  textures?: { source?: number; sampler?: number; extensions?: Record<string, { source?: number }> }[];
  materials?: GltfMaterial[];
  meshes?: { primitives?: { attributes?: Record<string, number> }[] }[];
}
interface GltfMaterial {
  normalTexture?: { texCoord?: number };
  extensions?: {
    KHR_materials_clearcoat?: { clearcoatNormalTexture?: { texCoord?: number } };
    KHR_materials_anisotropy?: { anisotropyTexture?: { texCoord?: number } };
  };
}

/**
 * By material: the texture coordinates along which scales of the stream need tangents (G12); -1 = none. They
 * need them where the file has some.
 */
export function tangentTexcoords({ meshes = [], materials = [] }: GltfJson): number[] {
  const some = meshes.some((m) => m.primitives?.some((p) => p.attributes?.TANGENT! >= 0));
  return materials.map(({ normalTexture, extensions: e }) => {
    const texture = normalTexture ?? e?.KHR_materials_anisotropy?.anisotropyTexture ??
      e?.KHR_materials_clearcoat?.clearcoatNormalTexture;
    return some && texture ? texture.texCoord ?? 0 : -1;
  });
}

/** Number of the package's image of that name; -1: none. */
const imageNumber = (name = ''): number => Number(/^texture\/(\d+)$/.exec(name)?.[1] ?? -1);

/** Number of the source image that a texture of a GLB shows; -1 when it is none of the package's. */
function imageOfTexture(json: GltfJson, index: number | undefined): number {
  const def = json.textures?.[index ?? -1];
  const source = def?.source ??
    Object.values(def?.extensions ?? {}).find((e) => e.source !== undefined)?.source;
  return imageNumber(json.images?.[source ?? -1]?.name);
}

/** A texture in a material, by the name of the slot. */
export interface Slot {
  material: Material;
  name: string;
  image: number;
}

/** A material seen as its textures by the name of their slot. */
export const texturesIn = (material: Material) =>
  material as unknown as Record<string, Texture | null | undefined>;

/** Textures of a material by the name of their slot. */
export function texturesOf(material: Material): [string, Texture][] {
  return Object.entries(material).filter((entry): entry is [string, Texture] => entry[1] instanceof Texture);
}

/** Disposes of a texture and closes its picture, which GLTFLoader decoded and nobody else closes. */
export function disposeTexture(texture: Texture): void {
  texture.dispose();
  (texture.image as Partial<ImageBitmap> | null | undefined)?.close?.();
}

/** Parses a scale. Later scales have placeholders for previews, since materials are shared. */
export async function parseScale(loader: GltfLoaderLike, glb: Uint8Array,
    placeholders: boolean): Promise<ParsedGltf> {
  if (placeholders)
    loader.register((parser: { json: GltfJson }) => ({
      name: 'TEXMESH_placeholders',
      loadTexture: (index: number) => {
        const texture = new Texture();
        const image = imageOfTexture(parser.json, index);
        if (image < 0) return null;
        texture.name = `texture/${image}`;
        return Promise.resolve(texture);
      },
    }));
  return (await loader.parseAsync(glb.slice().buffer, '')) as ParsedGltf;
}

/** All meshes beneath an object. */
export function meshesOf(object: Object3D): Mesh[] {
  const meshes: Mesh[] = [];
  object.traverse((o) => {
    if ((o as Mesh).isMesh) meshes.push(o as Mesh);
  });
  return meshes;
}

/** About `most` triangles of a model, by their corners' places in the attributes. */
export function sampleTriangles(object: Object3D, most: number, use: (mesh: Mesh, corners: [number, number,
    number]) => void): void {
  const meshes = meshesOf(object);
  const cornersOf = ({ geometry: { index, attributes } }: Mesh): number =>
    (index ?? attributes.position)?.count ?? 0;
  const step = 3 * Math.ceil(meshes.reduce((sum, mesh) => sum + cornersOf(mesh), 1) / (3 * most));
  for (const mesh of meshes) {
    const corner = (k: number): number => mesh.geometry.index?.getX(k) ?? k;
    for (let k = 0; k + 2 < cornersOf(mesh); k += step) use(mesh, [corner(k), corner(k + 1), corner(k + 2)]);
  }
}

/** Materials of all scales: scales share the materials of the first scale that has them. */
export class MaterialSet {
  readonly slots: Slot[] = [];
  private readonly byKey_ = new Map<string, Material>();

  get all(): Material[] {
    return [...this.byKey_.values()];
  }

  /** Gives meshes the shared materials. `added` hears of every slot with a texture of the package. */
  shareMaterials(gltf: ParsedGltf, meshes: readonly Mesh[], added: (slot: Slot) => void): void {
    for (const mesh of meshes) mesh.material = this.shared_(gltf, mesh.material as Material, added);
  }
  private shared_(gltf: ParsedGltf, material: Material, added: (slot: Slot) => void): Material {
    const { parser } = gltf;
    const index = parser.associations.get(material)?.materials ?? -1;
    const m = material as Material & { flatShading?: boolean; normalScale?: { y: number } };
    const key = [index, m.vertexColors, m.flatShading ?? false, (m.normalScale?.y ?? 0) < 0, m.type].join();
    const known = this.byKey_.get(key);
    if (known) {
      if (known !== material) {
        for (const [, texture] of texturesOf(material)) texture.dispose();
        material.dispose();
      }
      return known;
    }
    this.byKey_.set(key, material);
    for (const [name, texture] of texturesOf(material)) {
      const named = imageNumber(texture.name);
      const image = named < 0 ? imageOfTexture(parser.json, parser.associations.get(texture)?.textures)
        : named;
      if (image < 0) continue;
      const slot = { material, name, image };
      this.slots.push(slot);
      added(slot);
    }
    return material;
  }
  dispose(): void {
    for (const material of this.byKey_.values()) {
      for (const [, texture] of texturesOf(material)) disposeTexture(texture);
      material.dispose();
    }
    this.byKey_.clear();
    this.slots.length = 0;
  }
}

/** All materials beneath an object, each once. */
export const materialsOf = (object: Object3D): Material[] =>
  [...new Set(meshesOf(object).flatMap((mesh) => mesh.material))];

/** Frees the geometries beneath an object. */
export function disposeGeometries(object: Object3D): void {
  for (const mesh of meshesOf(object)) mesh.geometry.dispose();
}
