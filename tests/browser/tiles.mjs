// Waved tiles, four by two, each with something of its own that a material or a mesh may have: how textures are placed and wrapped,
// second coordinates, normal maps with tangents and without, colours of vertices, emission, occlusion, no light at all.
import {PNG} from './browser.mjs';
import {glbOf} from './sheet.mjs';

const [kCells, kColumns, kSidePx] = [16, 4, 128];

/** A picture of `of(u, v)`, three numbers of 0..1. */
function picture(of) {
  const png = new PNG({width: kSidePx, height: kSidePx});
  for (let y = 0; y < kSidePx; y++)
    for (let x = 0; x < kSidePx; x++)
      png.data.set([...of((x + 0.5) / kSidePx, (y + 0.5) / kSidePx).map((c) => Math.round(255 * c)), 255], 4 * (y * kSidePx + x));
  return PNG.sync.write(png, {colorType: 2});
}
const wave = (a, b) => 0.5 + 0.4 * Math.sin(a) * Math.cos(b);
const pictures = [
  picture((u, v) => [wave(9 * u, 4 * v), wave(5 * v, 3 * u), u]),
  picture((u, v) => {
    const [x, y] = [0.5 * Math.sin(25 * u), 0.5 * Math.sin(19 * v)];
    return [x, y, Math.sqrt(1 - x * x - y * y)].map((c) => 0.5 + 0.5 * c);
  }),
  picture((u, v) => [wave(8 * u, 8 * v), 0.2 + 0.6 * u, wave(3 * u, 6 * v)]),
];
const [kBase, kNormal, kData] = [0, 1, 2];

/** One tile's vertices around a place of the plane of x and y. */
function tile(column, row) {
  const n = kCells + 1;
  const all = {POSITION: [], NORMAL: [], TEXCOORD_0: [], TEXCOORD_1: [], TANGENT: [], COLOR_0: []};
  for (let j = 0; j < n; j++)
    for (let i = 0; i < n; i++) {
      const [u, v] = [i / kCells, j / kCells];
      const [along, down] = [0.6 * Math.cos(4 * u), 0.5 * Math.cos(3 * v)];
      const length = Math.hypot(along, down, 1);
      all.POSITION.push(1.1 * column + u, -1.1 * row - v, 0.15 * Math.sin(4 * u) + (0.5 / 3) * Math.sin(3 * v));
      all.NORMAL.push(-along / length, down / length, 1 / length);
      all.TEXCOORD_0.push(u, v);
      all.TEXCOORD_1.push(2.6 * u - 0.8, 2.2 * v - 0.6);
      all.TANGENT.push(1 / Math.hypot(1, along), 0, along / Math.hypot(1, along), -1);
      all.COLOR_0.push(u, 1 - v, 0.5, 1);
    }
  return all;
}

export function tilesGlb() {
  const matte = {metallicFactor: 0, roughnessFactor: 0.6};
  const base = (more) => ({pbrMetallicRoughness: {...matte, baseColorTexture: {index: 0, ...more}}});
  const tiles = [
    // Even scale: three.js r170 scales after it has rotated, glTF's extension before (three.js, issue 34032).
    {material: base({extensions: {KHR_texture_transform: {offset: [0.2, 0.4], rotation: 0.5, scale: [1.8, 1.8]}}})},
    {material: {pbrMetallicRoughness: {...matte, baseColorTexture: {index: 3, texCoord: 1}}}, more: ['TEXCOORD_1']},
    {material: {pbrMetallicRoughness: {...matte, baseColorTexture: {index: 4, texCoord: 1}}}, more: ['TEXCOORD_1']},
    {material: {pbrMetallicRoughness: {metallicFactor: 1, roughnessFactor: 0.35}, normalTexture: {index: kNormal, scale: 0.7}}},
    {material: {pbrMetallicRoughness: {metallicFactor: 1, roughnessFactor: 0.35}, normalTexture: {index: kNormal}}, more: ['TANGENT']},
    {material: {pbrMetallicRoughness: matte, extensions: {KHR_materials_unlit: {}}}, more: ['COLOR_0']},
    {material: {pbrMetallicRoughness: matte, emissiveTexture: {index: kBase}, emissiveFactor: [0.3, 0.2, 0.1], extensions: {KHR_materials_emissive_strength: {emissiveStrength: 2}}}, more: ['COLOR_0']},
    {material: {pbrMetallicRoughness: {metallicRoughnessTexture: {index: kData}}, occlusionTexture: {index: kData, strength: 0.8}}},
  ];
  const [blobs, accessors] = [[], []];
  const add = (array, type, more = {}) => accessors.push({bufferView: blobs.push(Buffer.from(array.buffer)) - 1, componentType: array instanceof Uint16Array ? 5123 : 5126, type, ...more}) - 1;
  const indices = [];
  for (let j = 0; j < kCells; j++)
    for (let i = 0; i < kCells; i++) {
      const at = j * (kCells + 1) + i;
      indices.push(at, at + kCells + 1, at + 1, at + 1, at + kCells + 1, at + kCells + 2);
    }
  const types = {POSITION: 'VEC3', NORMAL: 'VEC3', TEXCOORD_0: 'VEC2', TEXCOORD_1: 'VEC2', TANGENT: 'VEC4', COLOR_0: 'VEC4'};
  const index = add(new Uint16Array(indices), 'SCALAR', {count: indices.length});
  const meshes = tiles.map(({more = []}, k) => {
    const values = tile(k % kColumns, Math.floor(k / kColumns));
    const box = [0, 1, 2].map((c) => values.POSITION.filter((_, i) => i % 3 === c).map(Math.fround));
    const bounds = {min: box.map((b) => Math.min(...b)), max: box.map((b) => Math.max(...b))};
    const attributes = Object.fromEntries(['POSITION', 'NORMAL', 'TEXCOORD_0', ...more].map((name) =>
      [name, add(new Float32Array(values[name]), types[name], {count: (kCells + 1) ** 2, ...(name === 'POSITION' && bounds)})]));
    return {primitives: [{attributes, indices: index, material: k}]};
  });
  const images = pictures.map((png) => ({bufferView: blobs.push(png) - 1, mimeType: 'image/png'}));
  return glbOf({
    asset: {version: '2.0'}, scene: 0, scenes: [{nodes: tiles.map((_, k) => k)}], nodes: tiles.map((_, k) => ({mesh: k})), meshes, accessors, images,
    extensionsUsed: ['KHR_texture_transform', 'KHR_materials_unlit', 'KHR_materials_emissive_strength'], materials: tiles.map((t) => t.material),
    samplers: [{}, {wrapS: 33648, wrapT: 33648}, {wrapS: 33071, wrapT: 33071, magFilter: 9728}],
    textures: [{source: kBase, sampler: 0}, {source: kNormal, sampler: 0}, {source: kData, sampler: 0}, {source: kBase, sampler: 1}, {source: kBase, sampler: 2}],
  }, blobs);
}
