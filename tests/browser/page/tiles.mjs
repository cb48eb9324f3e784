// Exported files in programs that others wrote: tilesets in 3d-tiles-renderer, GLBs in three.js alone.
import {TilesRenderer} from '3d-tiles-renderer';
import {Box3, Color, HemisphereLight, PerspectiveCamera, Scene, Sphere, Vector3, WebGLRenderer} from 'three';
import {DRACOLoader} from 'three/addons/loaders/DRACOLoader.js';
import {GLTFLoader} from 'three/addons/loaders/GLTFLoader.js';

const kSize = 512;
const loader = () => new GLTFLoader().setDRACOLoader(new DRACOLoader().setDecoderPath('/three/examples/jsm/libs/draco/gltf/'));

let stage;
function start() {
  const renderer = stage?.renderer ?? new WebGLRenderer({antialias: true, preserveDrawingBuffer: true}); // browsers hold sixteen at most
  renderer.setSize(kSize, kSize);
  document.body.replaceChildren(renderer.domElement);
  const scene = new Scene();
  scene.background = new Color(0x808080);
  scene.add(new HemisphereLight(0xffffff, 0xcccccc, 3));
  stage = {renderer, scene, camera: new PerspectiveCamera(30, 1, 1e-3, 1e4)};
}

/** The camera so far from a sphere that its diameter is `px` high, in front of it with +Y up, or +Z for tiles. */
function look({center, radius}, px, up) {
  const {camera} = stage;
  const distance = (2 * radius * kSize) / px / (2 * Math.tan(Math.PI / 12));
  camera.up.copy(up);
  camera.position.copy(center).addScaledVector(up.z ? new Vector3(0, -1, 0) : new Vector3(0, 0, 1), distance);
  camera.near = distance / 100;
  camera.far = distance * 100;
  camera.lookAt(center);
  camera.updateProjectionMatrix();
  camera.updateMatrixWorld();
}

/** How many px of the canvas show something. */
function covered() {
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = kSize;
  const context = canvas.getContext('2d');
  context.drawImage(stage.renderer.domElement, 0, 0);
  const {data} = context.getImageData(0, 0, kSize, kSize);
  let n = 0;
  for (let k = 0; k < data.length; k += 4) n += Math.abs(data[k] - 128) + Math.abs(data[k + 1] - 128) + Math.abs(data[k + 2] - 128) > 12;
  return n;
}

/** Shows a tileset with its box `px` high until nothing more comes; the files of the tiles that are seen. */
async function tiles(url, px) {
  start();
  const {renderer, scene, camera} = stage;
  const set = new TilesRenderer(url);
  const asked = [];
  set.manager.addHandler(/\.glb$/i, loader());
  set.addEventListener('load-error', (e) => { throw e.error; });
  set.addEventListener('load-model', ({tile}) => asked.push(tile.content.uri));
  scene.add(set.group);
  set.setCamera(camera);
  set.setResolution(camera, kSize, kSize);
  const sphere = new Sphere();
  let still = 0;
  for (let frame = 0; frame < 2000 && still < 10; frame++) {
    if (set.getBoundingSphere(sphere)) look(sphere, px, new Vector3(0, 0, 1));
    set.update();
    still = set.root && set.visibleTiles.size > 0 && set.stats.downloading + set.stats.parsing + set.stats.queued === 0 ? still + 1 : 0;
    await new Promise((done) => setTimeout(done, 20));
  }
  renderer.render(scene, camera);
  const shown = new Box3().setFromObject(set.group);
  return {
    seen: [...set.visibleTiles].map((t) => t.content.uri), asked, covered: covered(), still,
    size: shown.getSize(new Vector3()).toArray(), centre: shown.getCenter(new Vector3()).toArray(),
    sphere: [...sphere.center.toArray(), sphere.radius], target: set.errorTarget,
  };
}

/** Shows a GLB as three.js alone loads it. */
async function glb(url) {
  start();
  const {renderer, scene, camera} = stage;
  const gltf = await loader().loadAsync(url);
  scene.add(gltf.scene);
  const box = new Box3().setFromObject(gltf.scene);
  look(box.getBoundingSphere(new Sphere()), 400, new Vector3(0, 1, 0));
  renderer.render(scene, camera);
  let triangles = 0;
  gltf.scene.traverse((o) => { triangles += o.isMesh ? o.geometry.index.count / 3 : 0; });
  const {json} = gltf.parser;
  return {
    covered: covered(), triangles, images: json.images?.length ?? 0, extensions: json.extensionsUsed,
    lod: json.nodes.find((n) => n.extensions?.MSFT_lod), centre: box.getCenter(new Vector3()).toArray(), size: box.getSize(new Vector3()).toArray(),
  };
}

window.door = {tiles, glb};
window.ready = true;
