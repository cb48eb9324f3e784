import { type Material, ShaderChunk } from 'three';
import type { BlockFormat } from '../../blocks/formats';

/** GLSL: `z` of the normal of unit length whose other channels are `c`. */
const normalZ = 'vec2 n = 2.0 * c - 1.0; float z = 0.5 + 0.5 * sqrt( max( 0.0, 1.0 - dot( n, n ) ) );';

/** How texels come that need their z made: as blocks, or as fragments of codec jpeg-xy brought them. */
type Stored = BlockFormat | 'jpeg-xy';
/** Where the two channels of normals stand. */
const channels: Partial<Record<Stored, string>> = { 'jpeg-xy': 'rg', bc5: 'rg', 'bc3-normal': 'ag',
  'astc-normal': 'ra' };
/** Uniform and chunk of three.js by the slot of a material. */
const chunks: Record<string, 'normal_fragment_maps' | 'clearcoat_normal_fragment_maps'> =
  { normalMap: 'normal_fragment_maps', clearcoatNormalMap: 'clearcoat_normal_fragment_maps' };

/** The channels that a slot of a material is read from by now. */
const known = new WeakMap<Material, Record<string, string>>();

/** Normals of a material have two channels from now on; their length is 1. False: they have three. */
export function readTwoChannels(material: Material, slot: string, format: Stored): boolean {
  const [two, chunk] = [channels[format], chunks[slot]];
  if (!two || !chunk) return false;
  const read = known.get(material) ?? {};
  const patched = read[slot];
  known.set(material, Object.assign(read, { [slot]: two }));
  if (patched !== two) material.needsUpdate = true;
  if (patched) return true;
  const [before, keyBefore] = [material.onBeforeCompile, material.customProgramCacheKey];
  material.onBeforeCompile = function (shader, renderer) {
    before.call(material, shader, renderer);
    const mapped = ShaderChunk[chunk].replaceAll(new RegExp(`texture2D\\( ${slot}, (\\w+) \\)\\.xyz`, 'g'),
      `texmeshNormal( texture2D( ${slot}, $1 ).${read[slot]} )`);
    const made = `vec3 texmeshNormal( vec2 c ) { ${normalZ} return vec3( c, z ); }\n`;
    const there = shader.fragmentShader.includes('texmeshNormal(');
    shader.fragmentShader = (there ? '' : made) +
      shader.fragmentShader.replace(`#include <${chunk}>`, mapped);
  };
  material.customProgramCacheKey = () => `${keyBefore.call(material)} ${slot} ${read[slot]}`;
  return true;
}

/** GLSL that makes a colour `t` of such a texture what RGBA would hold. */
export function unpacked(format: BlockFormat): string {
  const two = channels[format];
  return two ? `vec2 c = t.${two}; ${normalZ} t = vec4( c, z, 1.0 );` : '';
}
