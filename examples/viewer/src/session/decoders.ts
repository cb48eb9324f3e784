import { DRACOLoader } from 'three/addons/loaders/DRACOLoader.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import type { GLTF } from 'three/addons/loaders/GLTFLoader.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';

// vite.config.ts copies three.js's decoder of Draco beside the page: nothing comes from another server.
const draco = new DRACOLoader().setDecoderPath(new URL('draco/', document.baseURI).href).setWorkerLimit(2);

/** Fetches and starts the decoder of Draco before the first mesh has come. */
export function warmDecoders(): void {
  draco.preload();
}

/**
 * A loader for the meshes of packages, for every mesh codec. `read` sees each mesh before the library does.
 */
export function gltfLoader(read: (gltf: GLTF) => void): GLTFLoader {
  const loader = new GLTFLoader().setDRACOLoader(draco).setMeshoptDecoder(MeshoptDecoder);
  return loader.register(() => ({ name: 'read', afterRoot: async (gltf) => read(gltf) }));
}
