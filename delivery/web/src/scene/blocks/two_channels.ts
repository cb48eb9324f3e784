import { type Material, ShaderChunk } from 'three';
import type { BlockFormat } from '../../blocks/formats';

/** Where the two channels of normals stand. */
const channels: Partial<Record<BlockFormat, string>> = { bc5: 'rg', 'bc3-normal': 'ag', 'astc-normal': 'ra' };
/** Uniform and chunk of three.js by the slot of a material. */
const chunks: Record<string, 'normal_fragment_maps' | 'clearcoat_normal_fragment_maps'> = { normalMap: 'normal_fragment_maps', clearcoatNormalMap: 'clearcoat_normal_fragment_maps' };

/** Normals of a material are made of two channels from now on; z is what makes their length 1. */
export function readTwoChannels(material: Material, slot: string, format: BlockFormat): void {
  const [two, chunk] = [channels[format], chunks[slot]];
  if (!two || !chunk) return;
  const [before, keyBefore] = [material.onBeforeCompile, material.customProgramCacheKey];
  material.onBeforeCompile = function (shader, renderer) {
    before.call(material, shader, renderer);
    const read = ShaderChunk[chunk].replaceAll(new RegExp(`texture2D\\( ${slot}, (\\w+) \\)\\.xyz`, 'g'), `texmeshNormal( texture2D( ${slot}, $1 ).${two} )`);
    const made = 'vec3 texmeshNormal( vec2 c ) { vec2 n = 2.0 * c - 1.0; return vec3( c, 0.5 + 0.5 * sqrt( max( 0.0, 1.0 - dot( n, n ) ) ) ); }\n';
    const known = shader.fragmentShader.includes('texmeshNormal(');
    shader.fragmentShader = (known ? '' : made) + shader.fragmentShader.replace(`#include <${chunk}>`, read);
  };
  material.customProgramCacheKey = () => `${keyBefore.call(material)} ${slot} ${two}`;
  material.needsUpdate = true;
}

/** GLSL that makes a colour `t` of such a texture what RGBA would hold. */
export function unpacked(format: BlockFormat): string {
  const two = channels[format];
  return two ? `vec2 c = t.${two}, n = 2.0 * c - 1.0; t = vec4( c, 0.5 + 0.5 * sqrt( max( 0.0, 1.0 - dot( n, n ) ) ), 1.0 );` : '';
}
