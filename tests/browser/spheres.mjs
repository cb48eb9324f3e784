// Spheres of every metalness and roughness, five by five, in the plane of x and y.
import {glbOf} from './sheet.mjs';

const [kSide, kColumns, kRows, kPitch] = [5, 64, 32, 2.2];

export function spheresGlb() {
  const [across, down] = [kColumns + 1, kRows + 1];
  const [positions, normals, indices] = [new Float32Array(3 * across * down), new Float32Array(3 * across * down), []];
  for (let j = 0; j < down; j++)
    for (let i = 0; i < across; i++) {
      const [turn, fall, at] = [(2 * Math.PI * i) / kColumns, (Math.PI * j) / kRows, j * across + i];
      const p = [Math.sin(fall) * Math.sin(turn), Math.cos(fall), Math.sin(fall) * Math.cos(turn)];
      positions.set(p, 3 * at);
      normals.set(p, 3 * at);
      if (i === kColumns || j === kRows) continue;
      if (j > 0) indices.push(at, at + across, at + 1);
      if (j < kRows - 1) indices.push(at + 1, at + across, at + across + 1);
    }
  const blobs = [positions, normals, new Uint16Array(indices)].map((a) => Buffer.from(a.buffer));
  const all = [...Array(kSide * kSide).keys()];
  const place = (k) => kPitch * (k - (kSide - 1) / 2);
  return glbOf({
    asset: {version: '2.0'}, scene: 0, scenes: [{nodes: all}],
    nodes: all.map((k) => ({mesh: k, translation: [place(k % kSide), -place(Math.floor(k / kSide)), 0]})),
    meshes: all.map((k) => ({primitives: [{attributes: {POSITION: 0, NORMAL: 1}, indices: 2, material: k}]})),
    materials: all.map((k) => ({
      pbrMetallicRoughness: {baseColorFactor: [0.8, 0.45, 0.2, 1], roughnessFactor: (k % kSide) / (kSide - 1), metallicFactor: Math.floor(k / kSide) / (kSide - 1)},
    })),
    accessors: [
      {bufferView: 0, componentType: 5126, count: across * down, type: 'VEC3', min: [-1, -1, -1], max: [1, 1, 1]},
      {bufferView: 1, componentType: 5126, count: across * down, type: 'VEC3'}, {bufferView: 2, componentType: 5123, count: indices.length, type: 'SCALAR'},
    ],
  }, blobs);
}
