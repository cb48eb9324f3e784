// A waved sheet: what make_scan's objects have not, coverage, a material with two sides, a texture of a material extension.
import {PNG} from './browser.mjs';

const kCells = 40;

/** Colours of broad waves, so that JPEG keeps them; coverage from left to right, or as islands. */
function picture(sidePx, islands) {
  const png = new PNG({width: sidePx, height: sidePx});
  for (let y = 0; y < sidePx; y++)
    for (let x = 0; x < sidePx; x++) {
      const [u, v] = [x / (sidePx - 1), y / (sidePx - 1)];
      const wave = (a, b) => Math.round(128 + 100 * Math.sin(a * u + b * v) * Math.cos(b * u - a * v));
      const alpha = islands ? (Math.sin(17 * u) * Math.sin(17 * v) > 0 ? 255 : 0) : Math.round(255 * u);
      png.data.set([wave(40, 9), wave(11, 30), wave(23, 21), alpha], 4 * (y * sidePx + x));
    }
  return PNG.sync.write(png);
}

/** Stripes of red and green, as no other texture of the sheet has them. */
function stripes(sidePx) {
  const png = new PNG({width: sidePx, height: sidePx});
  for (let i = 0; i < sidePx * sidePx; i++) png.data.set(((i % sidePx) >> 5) % 2 ? [255, 0, 0, 255] : [0, 255, 0, 255], 4 * i);
  return PNG.sync.write(png, {colorType: 2});
}

/** A GLB whose buffer view k is blob k. */
export function glbOf(json, blobs) {
  const bufferViews = [];
  const parts = [];
  let length = 0;
  for (const blob of blobs) {
    bufferViews.push({buffer: 0, byteOffset: length, byteLength: blob.length});
    parts.push(blob, Buffer.alloc(-blob.length & 3));
    length += blob.length + (-blob.length & 3);
  }
  let text = JSON.stringify({...json, bufferViews, buffers: [{byteLength: length}]});
  text += ' '.repeat(-text.length & 3);
  const chunk = (type, bytes) => [Buffer.from(Uint32Array.of(bytes.length, type).buffer), bytes];
  const body = Buffer.concat([...chunk(0x4e4f534a, Buffer.from(text)), ...chunk(0x004e4942, Buffer.concat(parts))]);
  return Buffer.concat([Buffer.from(Uint32Array.of(0x46546c67, 2, 12 + body.length).buffer), body]);
}

/** The sheet as a GLB, in the plane of x and y, a metre wide and high. `alphaMode` as glTF has it; of metal it has no sheen. */
export function sheetGlb({alphaMode, metal = false, sidePx = 512}) {
  const n = kCells + 1;
  const [positions, uvs, indices] = [new Float32Array(3 * n * n), new Float32Array(2 * n * n), []];
  for (let j = 0; j < n; j++)
    for (let i = 0; i < n; i++) {
      const [u, v, at] = [i / kCells, j / kCells, j * n + i];
      positions.set([u - 0.5, 0.5 - v, 0.08 * Math.sin(6 * u) * Math.cos(5 * v)], 3 * at);
      uvs.set([u, v], 2 * at);
      if (i < kCells && j < kCells) indices.push(at, at + n, at + 1, at + 1, at + n, at + n + 1);
    }
  const blobs = [positions, uvs, new Uint32Array(indices), picture(sidePx, alphaMode === 'MASK'), stripes(sidePx)]
    .map((a) => Buffer.from(a.buffer, a.byteOffset, a.byteLength));
  const clamp = {wrapS: 33071, wrapT: 33071};
  return glbOf({
    asset: {version: '2.0'}, scene: 0, scenes: [{nodes: [0]}], nodes: [{mesh: 0}], ...(!metal && {extensionsUsed: ['KHR_materials_sheen']}),
    meshes: [{primitives: [{attributes: {POSITION: 0, TEXCOORD_0: 1}, indices: 2, material: 0}]}],
    materials: [{
      alphaMode, ...(alphaMode === 'MASK' && {alphaCutoff: 0.5}), doubleSided: true, pbrMetallicRoughness: {baseColorTexture: {index: 0}, metallicFactor: metal ? 1 : 0, ...(metal && {roughnessFactor: 0.3})},
      ...(!metal && {extensions: {KHR_materials_sheen: {sheenColorFactor: [1, 1, 1], sheenRoughnessFactor: 0.6, sheenColorTexture: {index: 1}}}}),
    }],
    textures: [{source: 0, sampler: 0}, {source: 1, sampler: 0}], samplers: [clamp],
    images: [3, 4].map((bufferView) => ({bufferView, mimeType: 'image/png'})),
    accessors: [
      {bufferView: 0, componentType: 5126, count: n * n, type: 'VEC3', min: [-0.5, -0.5, -0.08], max: [0.5, 0.5, 0.08]},
      {bufferView: 1, componentType: 5126, count: n * n, type: 'VEC2'}, {bufferView: 2, componentType: 5125, count: indices.length, type: 'SCALAR'},
    ],
  }, blobs);
}
