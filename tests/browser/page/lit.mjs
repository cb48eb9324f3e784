// A page that shows a GLB as three.js does, under an environment and a key light that are given: what `texmesh render` is compared with.
import {
  Box3, Color, DataTexture, DirectionalLight, EquirectangularReflectionMapping, FloatType, LinearFilter, LinearSRGBColorSpace, Matrix4, NeutralToneMapping,
  PerspectiveCamera, PMREMGenerator, RGBAFormat, Scene, SRGBColorSpace, Vector3, WebGLRenderer,
} from 'three';
import {GLTFLoader} from 'three/addons/loaders/GLTFLoader.js';

let renderer;
let environment;
let key;

/** The light of all pictures to come; `url` holds RGBA floats. */
async function light({url, widthPx, heightPx, towards, irradiance}, sizePx) {
  renderer = new WebGLRenderer({antialias: true, preserveDrawingBuffer: true});
  renderer.setPixelRatio(1);
  renderer.setSize(sizePx, sizePx);
  renderer.toneMapping = NeutralToneMapping;
  renderer.outputColorSpace = SRGBColorSpace;
  document.body.append(renderer.domElement);
  const texture = new DataTexture(new Float32Array(await (await fetch(url)).arrayBuffer()), widthPx, heightPx, RGBAFormat, FloatType);
  texture.mapping = EquirectangularReflectionMapping;
  texture.colorSpace = LinearSRGBColorSpace;
  texture.minFilter = texture.magFilter = LinearFilter;
  texture.needsUpdate = true;
  environment = new PMREMGenerator(renderer).fromEquirectangular(texture).texture;
  key = new DirectionalLight(new Color().setRGB(...irradiance, LinearSRGBColorSpace), 1);
  key.position.set(...towards);
  const gl = renderer.getContext();
  return {samples: gl.getParameter(gl.SAMPLES), floats: !!gl.getExtension('OES_texture_float_linear')};
}

/** The GLB as base64 RGBA, top row first. `view` as `texmesh render --json` tells it; `background`: sRGB bytes. */
async function picture(glb, view, background) {
  const scene = new Scene();
  scene.environment = environment;
  scene.background = new Color().setRGB(...background.map((b) => b / 255), SRGBColorSpace);
  const {scene: object} = await new GLTFLoader().loadAsync(glb);
  scene.add(object, key);
  const [eye, right, up, backwards] = [view.eye, view.right, view.up, view.backwards].map((v) => new Vector3(...v));
  const box = new Box3().setFromObject(object, true);
  const [distance, radius] = [box.getCenter(new Vector3()).distanceTo(eye), box.getSize(new Vector3()).length() / 2];
  const camera = new PerspectiveCamera((360 / Math.PI) * Math.atan(view.tan_half_fov), 1, Math.max(view.near, distance - 1.01 * radius), distance + 1.01 * radius);
  camera.matrixAutoUpdate = false;
  camera.matrix.copy(new Matrix4().makeBasis(right, up, backwards).setPosition(eye));
  camera.matrixWorldNeedsUpdate = true;
  renderer.render(scene, camera);
  const {width, height} = renderer.domElement;
  const canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = [width, height];
  const context = canvas.getContext('2d');
  context.drawImage(renderer.domElement, 0, 0);
  const bytes = context.getImageData(0, 0, width, height).data;
  let text = '';
  for (let i = 0; i < bytes.length; i += 0x8000) text += String.fromCharCode(...bytes.subarray(i, i + 0x8000));
  object.traverse((o) => {
    o.geometry?.dispose();
    for (const value of Object.values(o.material ?? {})) if (value?.isTexture) value.dispose();
  });
  return btoa(text);
}

Object.assign(window, {lit: {light, picture}, ready: true});
