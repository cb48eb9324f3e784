import { DirectionalLight, HemisphereLight } from 'three';
import type { Object3D, Scene } from 'three';

/**
 * Adds daylight from above and a lamp that the camera is to carry; gives the lamp, whose place is the
 * camera's frame's. No shadows: textures of scans contain shadows. Posters are drawn in the same light
 * (stages/render: daylight_environment).
 */
export function daylight(scene: Scene): DirectionalLight {
  const lamp = new DirectionalLight(0xffffff, 2.2);
  lamp.position.set(-0.5, 0.7, 1);
  scene.add(new HemisphereLight(0xffffff, 0xd8d4cc, 3), lamp, lamp.target);
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
