// Draws a GLB or a USDZ by three.js's loaders, or a USDZ by tinyusdz.
import * as THREE from 'three';
import {GLTFLoader} from 'three/addons/loaders/GLTFLoader.js';
import {USDLoader} from 'three/addons/loaders/USDLoader.js';
import {TinyUSDZLoader} from 'tinyusdz/TinyUSDZLoader.js';
import {TinyUSDZLoaderUtils} from 'tinyusdz/TinyUSDZLoaderUtils.js';

const kSide = 384;
const renderer = new THREE.WebGLRenderer({antialias: true, preserveDrawingBuffer: true});
renderer.setSize(kSide, kSide);
document.body.append(renderer.domElement);

/** Textures of a USDZ load after their object. */
const pictures = async (object) => {
  const all = [];
  object.traverse(({material}) => material && all.push(...Object.values(material).filter((v) => v?.isTexture)));
  while (all.some((t) => !t.image || t.image.complete === false)) await new Promise((f) => setTimeout(f, 20));
  return all.length;
};

const loaders = {
  glb: async (url) => (await new GLTFLoader().loadAsync(url)).scene,
  usd: async (url) => {
    const object = await new USDLoader().loadAsync(url);
    // three.js 0.187 takes the scale 2 that makes a vector of a normal map's texel for the map's strength.
    object.traverse(({material}) => material?.normalScale?.multiplyScalar(0.5));
    return object;
  },
  tiny: async (url) => {
    const loader = new TinyUSDZLoader(), base = TinyUSDZLoaderUtils.createDefaultMaterial();
    await loader.init();
    const scene = await loader.loadAsync(url);
    const object = TinyUSDZLoaderUtils.buildThreeNode(scene.getDefaultRootNode(), base, scene, {overrideMaterial: false});
    // Its textures come later, and 0.9.0-rc10 multiplies them by the surface's usual values, reads colours as light, clamps,
    // and makes tangents of its own, which the GLB has not.
    await new Promise((f) => setTimeout(f, 3000));
    object.traverse(({geometry, material: m}) => {
      if (!m) return;
      geometry.deleteAttribute('tangent');
      if (m.map) m.color.set(1, 1, 1), (m.map.colorSpace = THREE.SRGBColorSpace);
      if (m.roughnessMap) m.roughness = 1;
      for (const t of Object.values(m)) if (t?.isTexture) t.wrapS = t.wrapT = THREE.RepeatWrapping, (t.needsUpdate = true);
      m.needsUpdate = true;
    });
    return object;
  },
};

/** The picture's bytes, and what was loaded. */
window.drawn = async (url, reader) => {
  const object = await loaders[reader](url);
  const textures = await pictures(object);
  const scene = new THREE.Scene();
  scene.background = new THREE.Color(0x20c020);
  const sun = new THREE.DirectionalLight(0xffffff, 3);
  sun.position.set(1, 2, 3);
  scene.add(sun, new THREE.HemisphereLight(0xffffff, 0x404040, 1));
  scene.add(object);
  const box = new THREE.Box3().setFromObject(object);
  const [centre, size] = [box.getCenter(new THREE.Vector3()), box.getSize(new THREE.Vector3()).length()];
  const camera = new THREE.PerspectiveCamera(40, 1, size / 100, size * 10);
  camera.position.copy(centre).add(new THREE.Vector3(0.5, 0.4, 1).setLength(size * 1.3));
  camera.lookAt(centre);
  renderer.render(scene, camera);
  const pixels = new Uint8Array(4 * kSide * kSide);
  const gl = renderer.getContext();
  gl.readPixels(0, 0, kSide, kSide, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  return {pixels: Array.from(pixels), textures, size};
};
window.ready = true;
