import { CubeUVReflectionMapping, DataTexture, HemisphereLight, type Scene, ShaderChunk } from 'three';
import {
  mirrorFrom, mirrorLow, mirrorRise, mirrorWidth, paperAbove, paperBelow,
} from '../format/shared_numbers';

/**
 * Radiance of the sky by height of the direction and by roughness, in linear light. Rough surfaces see the
 * hemisphere light: its intensity over pi. Mirrors see more contrast; with the hemisphere light alone a
 * mirror would look like paper.
 */
const kSky = `
vec3 sky(float up,float roughness){
return mix(vec3(${mirrorLow}+${mirrorRise}*smoothstep(${mirrorFrom},${mirrorFrom + mirrorWidth},up)),
mix(vec3(${paperBelow}),vec3(${paperAbove}),.5+.5*up),roughness);}
`;
const kLookUp = /textureCubeUV\( envMap, .+? \* (\w+), (.+?) \)/g;

/**
 * Puts a sky as surroundings in the place of the hemisphere light: a metal under that light alone is black.
 * Shaders compute the sky where three.js would look it up in a texture; with look-ups a processor that draws
 * takes twice as long for a frame.
 */
export function reflectSky(scene: Scene): void {
  if (scene.environment) return;
  const { envmap_physical_pars_fragment: code } = ShaderChunk;
  if (kLookUp.test(code))
    ShaderChunk.envmap_physical_pars_fragment = kSky + code.replace(kLookUp, 'vec4(sky($1.y,$2),1)');
  // of the least size that three.js takes for surroundings
  const unused = new DataTexture(new Uint8Array(4 * 64), 1, 64);
  unused.mapping = CubeUVReflectionMapping;
  unused.needsUpdate = true;
  scene.environment = unused;
  for (const o of scene.children) if (o instanceof HemisphereLight) o.visible = false;
}
