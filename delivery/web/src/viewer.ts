// One script tag: defines <texmesh-viewer>. three.js and its decoders are inside; worker.js and draco/ stand
// beside this file.
import { type Scene, Texture } from 'three';
import { DRACOLoader } from 'three/addons/loaders/DRACOLoader.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { forbidsTextWorkers, trusted } from './element/page_policy';
import { TexmeshViewer } from './element/texmesh_viewer';
import { TexmeshPage } from './page';
import { isMetallic } from './page/daylight';

/** Seconds that a decoder of meshes has. */
const longestDecodingS = 30;
const lookS = 0.25;
/** Loads what a policy allows to be loaded, and ends where it forbids decoders. */
class PromptLoader extends GLTFLoader {
  private usesDraco_ = false;
  constructor() {
    super();
    // Pictures within a file are decoded without a URL: policies forbid many pages to fetch blob:.
    this.register((parser) => {
      this.usesDraco_ = !!parser.json.extensionsUsed?.includes('KHR_draco_mesh_compression');
      const { loadImageSource: load } = parser;
      const known: Promise<Texture>[] = [];
      parser.loadImageSource = async (index, by) => {
        const { bufferView, mimeType } = parser.json.images[index];
        if (bufferView === undefined || !('isImageBitmapLoader' in by)) return load.call(parser, index, by);
        known[index] ??= parser.getDependency('bufferView', bufferView).then((bytes) =>
          pictureOf(bytes as ArrayBuffer, mimeType));
        return (await known[index]).clone();
      };
      return { name: 'pictures' };
    });
  }
  override parseAsync(...of: Parameters<GLTFLoader['parseAsync']>): ReturnType<GLTFLoader['parseAsync']> {
    return new Promise((done, failed) => {
      let leftS = longestDecodingS;
      const timer = setInterval(() => {
        if ((leftS -= lookS) >= 0 && !(this.usesDraco_ && forbidsTextWorkers())) return;
        clearInterval(timer); // a decoder that is forbidden never answers
        failed(new Error('the decoder of meshes gives no answer'));
      }, 1000 * lookS);
      super.parseAsync(...of).then(done, failed).finally(() => clearInterval(timer));
    });
  }
}
async function pictureOf(bytes: ArrayBuffer, type: string): Promise<Texture> {
  const file = new Blob([bytes], { type });
  const asStored = { premultiplyAlpha: 'none', colorSpaceConversion: 'none' } as const;
  // Some browsers know no such options.
  const texture =
    new Texture(await createImageBitmap(file, asStored).catch(() => createImageBitmap(file)));
  texture.needsUpdate = true;
  texture.userData.mimeType = type;
  return texture;
}

class Draco extends DRACOLoader {
  private url_ = '';
  /** Of the worker that the loader starts. */
  get workerSourceURL(): string {
    return this.url_;
  }
  set workerSourceURL(url: string) {
    this.url_ = url && trusted('createScriptURL', url);
  }
}
/** Whether there is WebAssembly, and the page's policy allows it. */
function hasWasm(): boolean {
  try {
    return !!new WebAssembly.Module(Uint8Array.of(0, 0x61, 0x73, 0x6d, 1, 0, 0, 0)); // the empty one
  } catch {
    return false;
  }
}

/** Browsers start workers of the page's own origin alone: of another one, a script of one line imports it. */
function worker(): string {
  const { origin: from, href } = new URL('./worker.js', import.meta.url);
  return trusted('createScriptURL', from === origin ? href
    : URL.createObjectURL(new Blob([`import ${JSON.stringify(href)}`], { type: 'text/javascript' })));
}

let shared: TexmeshPage | undefined;
const draco = new Draco().setDecoderPath(new URL('./draco/', import.meta.url).href).setWorkerLimit(1);

/** The page that all elements of a document share. */
export function texmeshPage(): TexmeshPage {
  if (!shared && !hasWasm()) draco.setDecoderConfig({ type: 'js' });
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
