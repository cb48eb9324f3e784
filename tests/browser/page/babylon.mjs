// GLBs with MSFT_lod in Babylon.js, which shows the coarsest level first and the next one as soon as that is there.
const {BABYLON} = window;
const draco = (file) => `/three/examples/jsm/libs/draco/gltf/${file}`;
BABYLON.DracoDecoder.DefaultConfiguration = {wasmUrl: draco('draco_wasm_wrapper.js'), wasmBinaryUrl: draco('draco_decoder.wasm'), fallbackUrl: draco('draco_decoder.js'), numWorkers: 1};

BABYLON.SceneLoader.ShowLoadingScreen = false;

const canvas = document.getElementById('canvas');
const engine = new BABYLON.Engine(canvas, true, {preserveDrawingBuffer: true});

/** How many px of the canvas show something. */
function covered() {
  const copy = document.createElement('canvas');
  copy.width = copy.height = canvas.width;
  const context = copy.getContext('2d');
  context.drawImage(canvas, 0, 0);
  const {data} = context.getImageData(0, 0, copy.width, copy.height);
  let n = 0;
  for (let k = 0; k < data.length; k += 4) n += Math.abs(data[k] - 128) + Math.abs(data[k + 1] - 128) + Math.abs(data[k + 2] - 128) > 12;
  return n;
}

/** What stands in the scene after each level of a GLB: triangles, textures, extent and covered px. */
async function levels(url) {
  const scene = new BABYLON.Scene(engine);
  scene.clearColor = new BABYLON.Color4(0.502, 0.502, 0.502, 1);
  new BABYLON.HemisphericLight('light', new BABYLON.Vector3(0, 1, 0), scene).intensity = 2;
  const out = [];
  let camera;
  const look = async () => {
    const meshes = scene.meshes.filter((m) => m.isEnabled() && m.getTotalVertices() > 0);
    const {min, max} = scene.getWorldExtends((m) => meshes.includes(m));
    const size = max.subtract(min);
    if (!camera) {
      const centre = min.add(max).scale(0.5);
      camera = new BABYLON.FreeCamera('camera', centre.add(new BABYLON.Vector3(0, 0, 2 * size.length())), scene);
      [camera.minZ, camera.maxZ] = [0.1, 10].map((f) => f * size.length());
      camera.setTarget(centre);
    }
    await scene.whenReadyAsync();
    scene.render();
    out.push({
      triangles: meshes.reduce((n, m) => n + m.getTotalIndices() / 3, 0), size: size.asArray(), covered: covered(),
      textures: [...new Set(meshes.flatMap((m) => m.material.getActiveTextures()))].filter((t) => t.isReady() && t.getSize().width > 0).length,
    });
  };
  let looking = Promise.resolve();
  let loader;
  const observer = BABYLON.SceneLoader.OnPluginActivatedObservable.add((own) => {
    loader = own;
    own.onExtensionLoadedObservable.add((extension) => {
      if (extension.name === 'MSFT_lod') extension.onNodeLODsLoadedObservable.add(() => { looking = looking.then(look); });
    });
  });
  await BABYLON.SceneLoader.AppendAsync('', url, scene, null, '.glb');
  await loader.whenCompleteAsync();
  BABYLON.SceneLoader.OnPluginActivatedObservable.remove(observer);
  await looking;
  await look();
  return out;
}

window.door = {levels};
window.ready = true;
