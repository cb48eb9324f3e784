import { Box3, HemisphereLight, Scene, Vector3, WebGLRenderer } from 'three';
import { DRACOLoader } from 'three/addons/loaders/DRACOLoader.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';

interface XrSystem {
  requestSession(mode: string, options: object): Promise<EventTarget>;
}

/** Shows a GLB, in metres, before whoever holds the device, until the session ends. */
export async function showInRoom(glb: string): Promise<void> {
  const { xr } = navigator as unknown as { xr: XrSystem };
  // Asked for first: a browser grants it only for a while after a click.
  const session = await xr.requestSession('immersive-ar', { requiredFeatures: ['local'] });
  const draco = new DRACOLoader().setDecoderPath(new URL('./draco/', import.meta.url).href);
  const renderer = new WebGLRenderer({ alpha: true, antialias: true });
  session.addEventListener('end', () => {
    renderer.setAnimationLoop(null);
    renderer.dispose();
    draco.dispose();
  });
  renderer.xr.enabled = true;
  renderer.xr.setReferenceSpaceType('local');
  await renderer.xr.setSession(session as Parameters<typeof renderer.xr.setSession>[0]);
  const loader = new GLTFLoader().setDRACOLoader(draco).setMeshoptDecoder(MeshoptDecoder);
  const { scene: object } = await loader.loadAsync(glb);
  const box = new Box3().setFromObject(object), size = box.getSize(new Vector3());
  const middle = box.getCenter(new Vector3());
  // Far enough to be seen whole, a little below the eyes.
  object.position.sub(middle).add(new Vector3(0, -0.3, -Math.max(0.8, 1.5 * size.length())));
  const scene = new Scene();
  scene.add(object, new HemisphereLight(0xffffff, 0xb0aca4, 3));
  const camera = renderer.xr.getCamera();
  renderer.setAnimationLoop(() => renderer.render(scene, camera));
}
