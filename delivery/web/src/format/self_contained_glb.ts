import { FormatError } from './errors';
import { imageSize } from './image_size';
import { mostPreviewPx } from './layout';

/** Fields of a GLB's JSON that make loaders ask other hosts, or make room for pictures. */
interface Embedding {
  buffers?: { uri?: unknown }[];
  images?: { uri?: unknown; bufferView?: number }[];
  bufferViews?: Record<number, { buffer?: unknown; byteOffset?: number; byteLength?: number; extensions?: unknown } | undefined>;
}

function require(good: unknown, rule: string, what: string): asserts good {
  if (!good) throw new FormatError('mesh', '', what, '', rule);
}

/** Requires something of a mesh. */
export { require as requireOfMesh };

/** JSON and bytes of a GLB of at most two chunks. glTF has no further chunks, and loaders differ in what they make of those. */
export function partsOfGlb(glb: Uint8Array): { json: Embedding; bytes: Uint8Array } {
  const view = new DataView(glb.buffer, glb.byteOffset, glb.byteLength);
  const at = (i: number): number => (i + 4 <= glb.length ? view.getUint32(i, true) : -1);
  const end = 20 + at(12);
  const endsThere = end === glb.length || (at(end + 4) === 0x004e4942 && end + 8 + at(end) === glb.length);
  require(at(0) === 0x46546c67 && at(8) === glb.length && at(16) === 0x4e4f534a && endsThere, 'G01', 'a GLB of JSON and bytes');
  let json: unknown;
  try {
    json = JSON.parse(new TextDecoder().decode(glb.subarray(20, end)));
  } catch {
    // the next line throws
  }
  require(typeof json === 'object' && json, 'G01', 'JSON in its GLB');
  return { json, bytes: glb.subarray(end + 8) };
}

/** What the GLBs of finer scales have for images: previews by their place in a tree. */
const previewUri = /^\.\.\/preview\/\d{3,5}\.jpg$/;

/**
 * Requires a GLB whose data is all in the file: a URI would make pages ask the host of that URI. With `placeholders` its images may be
 * URIs of previews, since nobody asks for them. Pictures in the GLB, which loaders decode, must be no larger than previews. FormatError
 * otherwise.
 */
export function requireSelfContained(glb: Uint8Array, placeholders = false, rule = placeholders ? 'G06' : 'G05'): void {
  const { json, bytes } = partsOfGlb(glb);
  const { buffers = [], images = [] } = json;
  require(Array.isArray(buffers) && Array.isArray(images) && [...buffers, ...images].every((item) => item), 'G01', 'lists of buffers and images');
  const mayName = (uri: unknown): boolean => placeholders && typeof uri === 'string' && previewUri.test(uri);
  const inside = images.filter(({ uri }) => !mayName(uri));
  require([...buffers, ...inside].every(({ uri }) => uri === undefined), rule, 'buffers and images within the file');
  for (const { bufferView = -1 } of inside) {
    const { buffer, byteOffset: at = 0, byteLength: length = 0, extensions } = json.bufferViews?.[bufferView] ?? {};
    require(buffer === 0 && !extensions && Number.isInteger(at) && at >= 0, 'G05', 'pictures as they are');
    const [width, height] = imageSize(bytes.subarray(at, at + length));
    require(width > 0 && width <= mostPreviewPx && height > 0 && height <= mostPreviewPx, 'G05', 'previews');
  }
}
