// One script tag: defines <texmesh-viewer>. three.js and its decoders are inside; worker.js and draco/ stand
// beside this file.
import type { Scene } from 'three';
import { DRACOLoader } from 'three/addons/loaders/DRACOLoader.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { TexmeshViewer } from './element/texmesh_viewer';
import { TexmeshPage } from './page';
import { isMetallic, reflectSky } from './page/daylight';

let shared: TexmeshPage | undefined;
const draco = new DRACOLoader().setDecoderPath(new URL('./draco/', import.meta.url).href).setWorkerLimit(1);

/** The page that all elements of a document share. */
export function texmeshPage(): TexmeshPage {
  return (shared ??= new TexmeshPage({
    gltfLoader: () => new GLTFLoader().setDRACOLoader(draco).setMeshoptDecoder(MeshoptDecoder),
    workerUrl: new URL('./worker.js', import.meta.url),
  }));
}

/** Metals get a sky to mirror: under lamps alone they are black. */
function dress(scene: Scene): void {
  if (isMetallic(scene)) reflectSky(scene);
}

TexmeshViewer.host = { page: texmeshPage, dress };
if (!customElements.get('texmesh-viewer')) customElements.define('texmesh-viewer', TexmeshViewer);
