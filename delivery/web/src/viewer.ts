// One script tag: defines <texmesh-viewer>. three.js and its decoders are inside; worker.js and draco/ stand
// beside this file.
import { HemisphereLight, type Material, type Mesh, PMREMGenerator, type Scene, type Texture } from 'three';
import { DRACOLoader } from 'three/addons/loaders/DRACOLoader.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { TexmeshViewer } from './element/texmesh_viewer';
import { TexmeshPage } from './page';

let shared: TexmeshPage | undefined;
let room: Promise<Texture> | undefined;
const draco = new DRACOLoader().setDecoderPath(new URL('./draco/', import.meta.url).href).setWorkerLimit(1);

/** The page that all elements of a document share. */
export function texmeshPage(): TexmeshPage {
  return (shared ??= new TexmeshPage({
    gltfLoader: () => new GLTFLoader().setDRACOLoader(draco).setMeshoptDecoder(MeshoptDecoder),
    workerUrl: new URL('./worker.js', import.meta.url),
  }));
}

/** Draws the room that metals mirror into a texture. */
async function drawRoom(): Promise<Texture> {
  const { RoomEnvironment } = await import('three/addons/environments/RoomEnvironment.js');
  const { renderer } = texmeshPage();
  const generator = new PMREMGenerator(renderer);
  const { texture } = generator.fromScene(new RoomEnvironment(), 0.04);
  generator.dispose();
  return texture;
}
function mirror(scene: Scene, room: Texture): void {
  scene.environment = room;
  texmeshPage().models.find((m) => m.scene === scene)?.moved();
}
/** The room is drawn once. A lost context takes the drawing along: metals would be black from then on. */
function surroundings(): Promise<Texture> {
  if (room) return room;
  texmeshPage().renderer.domElement.addEventListener('webglcontextrestored', async () => {
    const before = await room!;
    const now = await (room = drawRoom());
    for (const { scene } of texmeshPage().models) if (scene.environment === before) mirror(scene, now);
  });
  return (room = drawRoom());
}
/** Metals get a room to mirror: under lamps alone they are black. */
async function surroundMetals(scene: Scene): Promise<void> {
  let metallic = false;
  scene.traverse((o) => {
    for (const m of [(o as Mesh).material].flat() as (Material & { metalness?: number })[])
      metallic ||= (m?.metalness ?? 0) > 0.5;
  });
  if (!metallic || scene.environment) return;
  mirror(scene, await surroundings());
  for (const o of scene.children) if (o instanceof HemisphereLight) o.intensity = 1;
}

TexmeshViewer.host = { page: texmeshPage, dress: (scene) => void surroundMetals(scene) };
if (!customElements.get('texmesh-viewer')) customElements.define('texmesh-viewer', TexmeshViewer);
