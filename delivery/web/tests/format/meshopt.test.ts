import { MeshoptDecoder } from 'three/examples/jsm/libs/meshopt_decoder.module.js';
import { beforeAll, describe, expect, it } from 'vitest';
import { FormatError } from '../../src/format/errors';
import { decodeAttributes, decodeTriangles } from '../../src/format/glb';

// Random streams: whatever three.js's decoder makes of a stream, this decoder makes of it, too.

/** 0 .. 2^32 - 1. */
function random(seed: number): () => number {
  let state = seed >>> 0;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return (state ^ (state >>> 15)) >>> 0;
  };
}
const bytesOf = (next: () => number, count: number, most = 256): number[] =>
  Array.from({ length: count }, () => (next() >>> 8) % most);

/** A stream of attributes with groups of all four kinds, small differences and escapes. */
function attributeStream(next: () => number, count: number, stride: number): Uint8Array {
  const out = [0xa0];
  const most = Math.min(256, (8192 / stride) & ~15);
  for (let first = 0; first < count; first += most) {
    const groups = Math.ceil(Math.min(most, count - first) / 16);
    for (let k = 0; k < stride; ++k) {
      const modes = bytesOf(next, groups, 4);
      for (let g = 0; g < groups; g += 4)
        out.push(modes.slice(g, g + 4).reduce((byte, mode, i) => byte | (mode << (2 * i)), 0));
      for (const mode of modes) {
        if (mode === 3) out.push(...bytesOf(next, 16));
        else if (mode > 0) {
          const bits = 2 * mode;
          const escape = (1 << bits) - 1;
          const values = bytesOf(next, 16, escape + 1);
          for (let at = 0; at < 16; at += 8 / bits)
            out.push(values.slice(at, at + 8 / bits).reduce((byte, v) => (byte << bits) | v, 0));
          for (const v of values) if (v === escape) out.push(...bytesOf(next, 1));
        }
      }
    }
  }
  const tail = bytesOf(next, Math.max(32, stride));
  return Uint8Array.from([...out, ...tail]);
}

/** A stream of triangles whose codes are those of a mesh: nothing is looked for before it was written. */
function triangleStream(next: () => number, triangles: number): Uint8Array {
  const codes: number[] = [];
  const data: number[] = [];
  for (let t = 0; t < triangles; ++t) {
    const kind = t === 0 ? 2 : next() % 8;
    if (kind > 3) {
      const code = (next() % 15 << 4) | next() % 16;
      codes.push(code);
      if ((code & 15) === 15) data.push(next() % 128);
    } else if (kind > 1) codes.push(0xf0 | next() % 14);
    else {
      const free = kind === 0 ? 0xfe : 0xff;
      const ways = (next() >>> 8) % 256;
      codes.push(free);
      data.push(ways);
      for (const far of [free === 0xff, ways >> 4 === 15, (ways & 15) === 15]) if (far)
        data.push(128 | next() % 128, next() % 128);
    }
  }
  return Uint8Array.from([0xe1, ...codes, ...data, ...bytesOf(next, 16, 0xef)]);
}

beforeAll(() => MeshoptDecoder.ready);

describe('meshopt', () => {
  it('decodes attributes as three.js does', () => {
    for (let seed = 1; seed <= 60; ++seed) {
      const next = random(seed);
      const stride = 4 * (1 + next() % (seed % 5 === 0 ? 64 : 6));
      const count = 1 + next() % 700;
      const stream = attributeStream(next, count, stride);
      const expected = new Uint8Array(count * stride);
      MeshoptDecoder.decodeGltfBuffer(expected, count, stride, stream, 'ATTRIBUTES', 'NONE');
      expect(Buffer.compare(decodeAttributes(stream, count, stride), expected), `seed ${seed}`).toBe(0);
    }
  });
  it('decodes triangles as three.js does', () => {
    for (let seed = 1; seed <= 200; ++seed) {
      const next = random(seed);
      const count = 3 * (1 + next() % 300);
      const stream = triangleStream(next, count / 3);
      const expected = new Uint8Array(4 * count);
      MeshoptDecoder.decodeGltfBuffer(expected, count, 4, stream, 'TRIANGLES', 'NONE');
      expect(Buffer.compare(new Uint8Array(decodeTriangles(stream, count).buffer), expected), `seed ${seed}`)
        .toBe(0);
    }
  });
  it('refuses other versions and streams that end too early', () => {
    const next = random(7);
    const attributes = attributeStream(next, 100, 8);
    const triangles = triangleStream(next, 50);
    for (const cut of [0, 1, 10, 40, attributes.length / 2])
      expect(() => decodeAttributes(attributes.subarray(0, cut), 100, 8), `${cut}`).toThrow(FormatError);
    expect(() => decodeAttributes(attributes, 10_000_000, 8)).toThrow(FormatError);
    for (const cut of [0, 1, 16, 40, 60])
      expect(() => decodeTriangles(triangles.subarray(0, cut), 150), `${cut}`).toThrow(FormatError);
    expect(() => decodeTriangles(triangles, 149)).toThrow(FormatError);
    expect(() => decodeTriangles(triangles, 3e9)).toThrow(FormatError);
    expect(() => decodeAttributes(Uint8Array.from([0xa1, ...attributes.subarray(1)]), 100, 8))
      .toThrow(FormatError);
    expect(() => decodeTriangles(Uint8Array.from([0xe0, ...triangles.subarray(1)]), 150))
      .toThrow(FormatError);
  });
});
