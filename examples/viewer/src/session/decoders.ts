import { DRACOLoader } from 'three/addons/loaders/DRACOLoader.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import type { GLTF } from 'three/addons/loaders/GLTFLoader.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';

// Draco's decoder as three.js ships it, copied beside the page by vite.config.ts: nothing comes from another server.
const draco = new DRACOLoader().setDecoderPath(new URL('draco/', document.baseURI).href).setWorkerLimit(2);

/** Fetches and starts the mesh decoders before a mesh is there that needs them. */
export function warmDecoders(): void {
  draco.preload();
}

/** A loader for the meshes of packages, whatever they were compressed with. `read` sees each before anybody else does. */
export function gltfLoader(read: (gltf: GLTF) => void): GLTFLoader {
  const loader = new GLTFLoader().setDRACOLoader(draco).setMeshoptDecoder(MeshoptDecoder);
  return loader.register(() => ({ name: 'read', afterRoot: async (gltf) => read(gltf) }));
}
