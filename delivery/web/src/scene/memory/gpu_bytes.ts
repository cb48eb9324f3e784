import {
  type BufferAttribute, type CompressedTexture, type InterleavedBufferAttribute, LinearFilter, type Material, type Object3D, RGB_ETC2_Format, RGB_S3TC_DXT1_Format, type Texture,
} from 'three';
import { type GpuTexels, textureBytes } from '../../decide/memory/gpu_size';
import { meshesOf, texturesOf } from '../scale_parts';

/** How a texture's texels are stored. */
function texelsOf({ isCompressedTexture, format }: Partial<CompressedTexture>): GpuTexels {
  if (!isCompressedTexture) return 'rgba8';
  return format === RGB_S3TC_DXT1_Format || format === RGB_ETC2_Format ? 'block8' : 'block16';
}

/** Bytes that shapes, and the textures of materials and of composed planes, take on the GPU once they have been drawn. What is shared counts once. */
export function gpuBytes(shapes: readonly Object3D[], materials: readonly Material[], planes: readonly { textures: readonly Texture[] }[]): number {
  const arrays = new Set<{ byteLength: number }>();
  for (const { geometry } of shapes.flatMap(meshesOf))
    for (const a of [...Object.values(geometry.attributes), geometry.index] as (BufferAttribute | InterleavedBufferAttribute | null)[])
      if (a) arrays.add('data' in a ? (a.data.array as Float32Array) : (a.array as Float32Array));
  const pictures = new Map<unknown, number>();
  for (const texture of [...materials.flatMap((m) => texturesOf(m).map(([, t]) => t)), ...planes.flatMap((p) => [...p.textures])]) {
    const { width = 0, height = 0 } = (texture.image ?? {}) as Partial<ImageBitmap>;
    if (width > 0) pictures.set(texture.source, Math.max(pictures.get(texture.source) ?? 0, textureBytes(width, height, (texture.minFilter as number) > LinearFilter ? undefined : 1, texelsOf(texture as Partial<CompressedTexture>))));
  }
  return [...arrays].reduce((sum, a) => sum + a.byteLength, 0) + [...pictures.values()].reduce((sum, bytes) => sum + bytes, 0);
}
