import { describe, expect, it } from 'vitest';
import { requireSelfContained } from '../../src/format/glb';
import { hasGlb } from '../../src/format/manifest';
import { FormatError, PackageReader } from '../../src/reader';
import { container } from '../support/scan';

describe('hostile answers', () => {
  const [jsonChunk, binChunk] = [0x4e4f534a, 0x004e4942];
  /** A GLB of these chunks. */
  function glb(...chunks: (string | [number, string])[]): Uint8Array {
    const all = chunks.map((c): [number, Uint8Array] =>
      typeof c === 'string' ? [jsonChunk, new TextEncoder().encode(c)]
        : [c[0], new TextEncoder().encode(c[1])]);
    const out = new Uint8Array(all.reduce((n, [, text]) => n + 8 + text.length, 12));
    const view = new DataView(out.buffer);
    [0x46546c67, 2, out.length].forEach((v, i) => view.setUint32(4 * i, v, true));
    let at = 12;
    for (const [type, text] of all) {
      view.setUint32(at, text.length, true);
      view.setUint32(at + 4, type, true);
      out.set(text, at + 8);
      at += 8 + text.length;
    }
    return out;
  }
  it('a GLB whose JSON loaders may read otherwise is refused', () => {
    const nice = '{"buffers":[{"byteLength":1}]}';
    const evil = '{"buffers":[{"uri":"http://evil.example/"}]}';
    requireSelfContained(glb(nice, [binChunk, 'bytes']));
    for (const chunks of [[nice, evil], [[1, nice], evil], [nice, [binChunk, 'a'], evil], [nice, [1, 'a']],
        [[binChunk, 'a'], nice]])
      expect(() => requireSelfContained(glb(...(chunks as string[])))).toThrow(FormatError);
    for (const name of ['buffers', 'images'])
      for (const list of [{ 0: { uri: 'http://evil.example/' } }, [null], 'http://evil.example/',
          [{ uri: ['data:'] }], [{ uri: null }]])
        expect(() => requireSelfContained(glb(JSON.stringify({ [name]: list })))).toThrow(FormatError);
    const [longer, shorter] = [glb(nice), glb(nice)]; // than the file says it is
    new DataView(longer.buffer).setUint32(8, longer.length + 4, true);
    new DataView(shorter.buffer).setUint32(8, shorter.length - 4, true);
    for (const bad of [longer, shorter]) expect(() => requireSelfContained(bad)).toThrow(FormatError);
  });
  it('a GLB with pictures larger than previews is refused', () => {
    const withPicture = (side: number, view: object = {}, image: object = {}): Uint8Array => {
      const bufferViews = [{ buffer: 0, byteLength: 12, ...view }];
      const out = glb(JSON.stringify({ buffers: [{ byteLength: 12 }], bufferViews,
        images: [{ bufferView: 0, ...image }] }), [binChunk, ' '.repeat(12)]);
      out.set([0xff, 0xd8, 0xff, 0xc0, 0, 17, 8, side >> 8, side & 255, side >> 8, side & 255, 3],
        out.length - 12);
      return out;
    };
    requireSelfContained(withPicture(4096));
    // Previews with coverage are PNG.
    const withPng = (width: number, height: number): Uint8Array => {
      const bufferViews = [{ buffer: 0, byteLength: 24 }];
      const out = glb(JSON.stringify({ buffers: [{ byteLength: 24 }], bufferViews,
        images: [{ bufferView: 0, mimeType: 'image/png' }] }), [binChunk, ' '.repeat(24)]);
      out.set([0x89, 0x50, 0x4e, 0x47, 13, 10, 26, 10, 0, 0, 0, 13, 0x49, 0x48, 0x44, 0x52], out.length - 24);
      new DataView(out.buffer).setUint32(out.length - 8, width);
      new DataView(out.buffer).setUint32(out.length - 4, height);
      return out;
    };
    requireSelfContained(withPng(4096, 1));
    for (const [w, h] of [[4097, 1], [1, 4097], [0, 8], [8, 0], [0x80000001, 8], [65536 * 4, 8]])
      expect(() => requireSelfContained(withPng(w, h))).toThrow(FormatError);
    for (const bad of [
      withPicture(4097), withPicture(0), withPicture(65535), withPicture(64, { byteLength: 6 }),
      withPicture(64, { byteOffset: 1 }), withPicture(64, { buffer: 1 }),
      withPicture(64, { byteOffset: -12 }), withPicture(64, { extensions: {} }),
      withPicture(64, {}, { bufferView: 1 }), withPicture(64, {}, { bufferView: undefined }),
    ])
      expect(() => requireSelfContained(bad)).toThrow(FormatError);
  });
  it('a GLB that names other hosts is refused', async () => {
    for (const uri of ['http://evil.example/x.png', '//evil.example/x', 'x.bin', 'blob:y',
          'data:image/png;base64,']) {
      for (const name of ['images', 'buffers'])
        expect(() => requireSelfContained(glb(JSON.stringify({ [name]: [{}, { uri }] }))))
          .toThrow(FormatError);
    }
    requireSelfContained(glb(JSON.stringify({ images: [], buffers: [{ byteLength: 3 }] })));
    const whole = glb('{}');
    for (let n = 0; n < whole.length; ++n)
      expect(() => requireSelfContained(whole.subarray(0, n))).toThrow(FormatError);
    expect(() => requireSelfContained(glb('{"images":'))).toThrow(FormatError);
    const reader = await PackageReader.openBytes(container, 'golden');
    const { scales } = reader.manifest;
    for (const s of scales.filter(hasGlb))
      requireSelfContained(await reader.scaleGlb(s.scale), s !== scales.at(-1));
  });
  it('images may be previews by their URI where nobody asks for images', () => {
    const named = (uri: unknown, list = 'images'): Uint8Array => glb(JSON.stringify({ [list]: [{ uri }] }));
    requireSelfContained(named('../preview/003.jpg'), true);
    requireSelfContained(named('../preview/10000.jpg'), true);
    expect(() => requireSelfContained(named('../preview/003.jpg'))).toThrow(FormatError);
    expect(() => requireSelfContained(named('../preview/003.jpg', 'buffers'), true)).toThrow(FormatError);
    for (const uri of ['http://evil.example/../preview/003.jpg', '../preview/3.jpg', '../preview/003.png',
        'preview/003.jpg', '../../preview/003.jpg', '../preview/003.jpg?x', 7])
      expect(() => requireSelfContained(named(uri), true)).toThrow(FormatError);
  });
});
