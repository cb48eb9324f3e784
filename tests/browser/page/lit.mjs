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
  renderer = new WebGLRenderer({preserveDrawingBuffer: true});
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
  return !!renderer.getContext().getExtension('OES_texture_float_linear');
}

const decode = (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
const encode = (v) => (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);

/**
 * RGBA, top row first: the mean, as light, of drawings from 4 x 4 places within a pixel. A canvas' own antialiasing takes other places and
 * mixes encoded colours; one drawing of four times the size would read finer mips.
 */
function sampled(scene, camera) {
  const kSide = 4;
  const gl = renderer.getContext();
  const {width, height} = renderer.domElement;
  const light = Float64Array.from({length: 256}, (_, i) => decode(i / 255) / kSide ** 2);
  const sum = new Float64Array(4 * width * height);
  const drawn = new Uint8Array(sum.length);
  for (let k = 0; k < kSide ** 2; k++) {
    const [dx, dy] = [k % kSide, Math.floor(k / kSide)].map((i) => (i + 0.5) / kSide - 0.5);
    camera.setViewOffset(width, height, dx, dy, width, height);
    renderer.render(scene, camera);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, drawn);
    for (let i = 0; i < drawn.length; i++) sum[i] += light[drawn[i]];
  }
  const out = new Uint8ClampedArray(sum.length);
  for (let y = 0; y < height; y++)
    for (let x = 0; x < 4 * width; x++) out[y * 4 * width + x] = 255 * encode(sum[(height - 1 - y) * 4 * width + x]);
  return out;
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
  const bytes = sampled(scene, camera);
  let text = '';
  for (let i = 0; i < bytes.length; i += 0x8000) text += String.fromCharCode(...bytes.subarray(i, i + 0x8000));
  object.traverse((o) => {
    o.geometry?.dispose();
    for (const value of Object.values(o.material ?? {})) if (value?.isTexture) value.dispose();
  });
  return btoa(text);
}

Object.assign(window, {lit: {light, picture}, ready: true});
