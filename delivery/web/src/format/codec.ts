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
  'jpeg-xy': { requiredFeature: 'codec-jpeg-xy', extension: 'jpg', mediaType: 'image/jpeg', incremental: false },
};
/** Traits of a codec that this reader knows. */
export function codecTraits(codec: CodecId): CodecTraits {
  return traits[codec];
}
/** Whether this reader knows a codec of that id. */
export function isCodec(name: string): name is CodecId {
  return Object.hasOwn(traits, name);
}
