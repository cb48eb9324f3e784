import { concat } from './sha256';
import { FormatError } from './errors';

/** How a plane's fragments are coded (format/SPEC.md, section 9). */
export type CodecId = 'jpeg' | 'jpeg-progressive' | 'webp' | 'jpeg-xy';

/** Traits of a codec. */
export interface CodecTraits {
  requiredFeature: string;
  /** Ending of complete files, without the dot. */
  extension: string;
  mediaType: string;
  /** A rung's streams continue those of the rungs below. */
  incremental: boolean;
}
const traits: Record<CodecId, CodecTraits> = {
  jpeg: { requiredFeature: '', extension: 'jpg', mediaType: 'image/jpeg', incremental: false },
  'jpeg-progressive': {
    requiredFeature: 'codec-jpeg-progressive',
    extension: 'jpg',
    mediaType: 'image/jpeg',
    incremental: true,
  },
  webp: { requiredFeature: 'codec-webp', extension: 'webp', mediaType: 'image/webp', incremental: false },
  'jpeg-xy': { requiredFeature: 'codec-jpeg-xy', extension: 'jpg', mediaType: 'image/jpeg',
    incremental: false },
};
/** Traits of a codec that this reader knows. */
export function codecTraits(codec: CodecId): CodecTraits {
  return traits[codec];
}
/** Whether this reader knows a codec of that id. */
export function isCodec(name: string): name is CodecId {
  return Object.hasOwn(traits, name);
}

const beginsAndEnds = (b: Uint8Array): boolean =>
  b.length >= 4 && b[0] === 0xff && b[1] === 0xd8 && b[b.length - 2] === 0xff && b[b.length - 1] === 0xd9;

function withoutEnd(tables: Uint8Array, rule: string): Uint8Array {
  if (!beginsAndEnds(tables)) throw new FormatError('JPEG', 'table stream', 'SOI ... EOI', '', rule);
  return tables.subarray(0, tables.length - 2);
}

/**
 * The complete image file of one fragment. `tables` is the table stream of the rung, or of the lowest rung
 * for an incremental codec; `streams` is the rung's one stream, or those of the lowest rung up to it. Nothing
 * is decoded.
 */
export function joinFragment(codec: CodecId, tables: Uint8Array, streams: readonly Uint8Array[]): Uint8Array {
  const fail = (expected: string, rule?: string): never => {
    throw new FormatError(codec, 'fragment', expected, '', rule);
  };
  if (streams.length === 0 || (streams.length > 1 && !codecTraits(codec).incremental)) fail('one stream');
  const first = streams[0];
  if (codec === 'jpeg' || codec === 'jpeg-xy') {
    if (!beginsAndEnds(first)) fail('SOI ... EOI', 'F05');
    return concat([withoutEnd(tables, 'F05'), first.subarray(2)]);
  }
  if (codec === 'jpeg-progressive') {
    const last = streams[streams.length - 1];
    if (first.length === 0 || last[last.length - 1] === 0xff) fail('scans', 'F06');
    return concat([withoutEnd(tables, 'F06'), ...streams, new Uint8Array([0xff, 0xd9])]);
  }
  const text = (at: number): string => String.fromCharCode(...first.subarray(at, at + 4));
  if (first.length <= 12 || text(0) !== 'RIFF' || text(8) !== 'WEBP') fail('RIFF ... WEBP', 'F07');
  return first;
}
