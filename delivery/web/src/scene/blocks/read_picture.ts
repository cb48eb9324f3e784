import { LinearFilter, Mesh, NoBlending, OrthographicCamera, PlaneGeometry, ShaderMaterial, type Texture, WebGLRenderTarget, type WebGLRenderer } from 'three';
import type { BlockFormat } from '../../blocks/formats';
import { unpacked } from './two_channels';

/** A part of a picture that has, or would have if it were enlarged, a size `of` so many px. */
export interface Part {
  x: number;
  y: number;
  width: number;
  height: number;
  of: [width: number, height: number];
}

/** RGBA bytes of a texture's part, row 0 first: blocks cannot be read, so they are drawn. */
export function readPicture(renderer: WebGLRenderer, texture: Texture, format: BlockFormat | undefined, { x, y, width, height, of }: Part): Uint8Array {
  const target = new WebGLRenderTarget(width, height, { colorSpace: texture.colorSpace, depthBuffer: false, minFilter: LinearFilter, magFilter: LinearFilter });
  const material = new ShaderMaterial({
    depthTest: false, depthWrite: false, blending: NoBlending, toneMapped: false,
    uniforms: { map: { value: texture }, place: { value: [x / of[0], y / of[1], width / of[0], height / of[1]] } },
    vertexShader: 'varying vec2 at; uniform vec4 place; void main() { at = place.xy + uv * place.zw; gl_Position = vec4( position.xy * 2.0, 0.0, 1.0 ); }',
    fragmentShader: `varying vec2 at; uniform sampler2D map; void main() { vec4 t = textureLod( map, at, 0.0 ); ${format ? unpacked(format) : ''} gl_FragColor = t; }`,
  });
  const square = new Mesh(new PlaneGeometry(1, 1), material);
  square.frustumCulled = false;
  const before = renderer.getRenderTarget();
  const pixels = new Uint8Array(4 * width * height);
  renderer.setRenderTarget(target);
  renderer.render(square, new OrthographicCamera());
  renderer.readRenderTargetPixels(target, 0, 0, width, height, pixels);
  renderer.setRenderTarget(before);
  square.geometry.dispose();
  material.dispose();
  target.dispose();
  return pixels;
}
