/**
 * Formats of the encoder, numbered as encoder/encoder.cpp has them. Two channels of a normal stand where
 * `channels` of two_channels.ts says.
 */
export const blockFormats = ['bc1', 'bc3-normal', 'bc5', 'bc7', 'etc2', 'astc', 'astc-normal'] as const;
/** A format of blocks. */
export type BlockFormat = (typeof blockFormats)[number];
/** Bytes of a block of 4 x 4 texels. */
export const blockBytes = (format: BlockFormat): 8 | 16 => (format === 'bc1' || format === 'etc2' ? 8 : 16);

/** What a worker makes blocks by: blocks.js, which the worker fetches from `url`. */
export interface BlockRequest {
  url: string;
  format: BlockFormat;
  /** Levels that become blocks. One more may come as RGBA, from which the caller makes the smallest ones. */
  own: number;
  /** Width and height that count; what lies beyond is left out. */
  size: [number, number];
}
/** A mip level as blocks, or as RGBA bytes. */
export interface BlockLevel {
  width: number;
  height: number;
  data: Uint8Array;
  close?: undefined;
}
/** RGBA bytes, row 0 at the top. */
export interface Pixels {
  pixels: Uint8Array;
  width: number;
  height: number;
}
