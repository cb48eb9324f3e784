// One script tag: defines <texmesh-viewer>. three.js and its decoders are inside; worker.js and draco/ stand
// beside this file.
import type { Scene } from 'three';
import { DRACOLoader } from 'three/addons/loaders/DRACOLoader.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { TexmeshViewer } from './element/texmesh_viewer';
import { TexmeshPage } from './page';
import { isMetallic } from './page/daylight';

/** Seconds that a decoder of meshes has. One that the page's policy forbids never answers. */
const longestDecodingS = 30;
class PromptLoader extends GLTFLoader {
  override parseAsync(...of: Parameters<GLTFLoader['parseAsync']>): ReturnType<GLTFLoader['parseAsync']> {
    return new Promise((done, failed) => {
      const late = (): void => failed(new Error('the decoder of meshes gives no answer'));
      const timer = setTimeout(late, 1000 * longestDecodingS);
      super.parseAsync(...of).then(done, failed).finally(() => clearTimeout(timer));
    });
  }
}

/** Browsers start workers of the page's own origin alone: of another one, a script of one line imports it. */
function worker(): URL | string {
  const url = new URL('./worker.js', import.meta.url);
  return url.origin === origin ? url
    : URL.createObjectURL(new Blob([`import ${JSON.stringify(url.href)}`], { type: 'text/javascript' }));
}

let shared: TexmeshPage | undefined;
const draco = new DRACOLoader().setDecoderPath(new URL('./draco/', import.meta.url).href).setWorkerLimit(1);

/** The page that all elements of a document share. */
export function texmeshPage(): TexmeshPage {
  return (shared ??= new TexmeshPage({
    gltfLoader: () => new PromptLoader().setDRACOLoader(draco).setMeshoptDecoder(MeshoptDecoder),
    workerUrl: worker(),
  }));
}

/** Metals get a sky to mirror, whose code comes when it is needed: under lamps alone they are black. */
async function dress(scene: Scene): Promise<void> {
  if (!isMetallic(scene)) return;
  (await import('./page/sky')).reflectSky(scene);
  for (const model of texmeshPage().models) if (model.scene === scene) model.moved();
}

TexmeshViewer.host = { page: texmeshPage, dress: (scene) => void dress(scene) };
if (!customElements.get('texmesh-viewer')) customElements.define('texmesh-viewer', TexmeshViewer);
