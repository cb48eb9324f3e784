import { MeshStandardMaterial, ShaderChunk, type WebGLProgramParametersWithUniforms,
  type WebGLRenderer } from 'three';
import { expect, test } from 'vitest';
import { readTwoChannels } from '../../../src/scene/blocks/two_channels';

const shaderOf = (material: MeshStandardMaterial): string => {
  const shader = { fragmentShader: '#include <normal_fragment_maps>' } as WebGLProgramParametersWithUniforms;
  material.onBeforeCompile(shader, undefined as unknown as WebGLRenderer);
  return shader.fragmentShader;
};

test('fragments of codec jpeg-xy have their z made in the shader', () => {
  const material = new MeshStandardMaterial();
  const [version, key] = [material.version, material.customProgramCacheKey()];
  expect(readTwoChannels(material, 'normalMap', 'jpeg-xy')).toBe(true);
  expect(material.version).toBeGreaterThan(version);
  expect(material.customProgramCacheKey()).not.toBe(key);
  expect(ShaderChunk.normal_fragment_maps).toContain('texture2D( normalMap, vNormalMapUv ).xyz');
  expect(shaderOf(material)).toContain('texmeshNormal( texture2D( normalMap, vNormalMapUv ).rg )');
  expect(shaderOf(material)).not.toContain('texture2D( normalMap, vNormalMapUv ).xyz');
});

test('another storage of the same slot changes the channels, and nothing is patched twice', () => {
  const material = new MeshStandardMaterial();
  readTwoChannels(material, 'normalMap', 'jpeg-xy');
  const { version } = material;
  readTwoChannels(material, 'normalMap', 'bc5');
  expect(material.version).toBe(version); // the same two channels
  readTwoChannels(material, 'normalMap', 'bc3-normal');
  expect(material.version).toBeGreaterThan(version);
  expect(shaderOf(material).match(/texmeshNormal\( texture2D\( normalMap, vNormalMapUv \)\.ag \)/g))
    .toHaveLength(2);
  expect(shaderOf(material).match(/vec3 texmeshNormal\(/g)).toHaveLength(1);
});

test('three channels and other slots stay as they are', () => {
  const material = new MeshStandardMaterial();
  expect(readTwoChannels(material, 'normalMap', 'bc7')).toBe(false);
  expect(readTwoChannels(material, 'map', 'jpeg-xy')).toBe(false);
  expect(shaderOf(material)).toBe('#include <normal_fragment_maps>');
});
