import { Color, DirectionalLight, HemisphereLight } from 'three';
import type { Object3D, Scene } from 'three';
import { lampIntensity, lampPlace, paperAbove, paperBelow } from '../format/shared_numbers';

/**
 * Adds daylight from above and a lamp that the camera is to carry; gives the lamp, whose place is the
 * camera's frame's. No shadows: textures of scans contain shadows. Posters are drawn in the same light
 * (stages/render: daylight_environment).
 */
export function daylight(scene: Scene): DirectionalLight {
  const lamp = new DirectionalLight(0xffffff, lampIntensity);
  lamp.position.fromArray(lampPlace);
  const [above, below] = [paperAbove, paperBelow].map((paper) => new Color().fromArray(paper));
  scene.add(new HemisphereLight(above, below, Math.PI), lamp, lamp.target);
  return lamp;
}

/** Whether an object has a metallic material: one that shows little but its surroundings. */
export function isMetallic(root: Object3D): boolean {
  let metallic = false;
  root.traverse((o) => {
    const { material = [] } = o as { material?: unknown };
    for (const m of [material].flat() as { metalness: number }[]) metallic ||= m.metalness > 0.5;
  });
  return metallic;
}
