import type { BlockLevel, BlockRequest, Pixels } from '../blocks/formats';
import type { CodecId } from '../format/codec';
import type { Documents } from '../format/document_decoder';
import type { MadeTangents } from './tangents';

/** Decodes one fragment (or preview): checks digests, joins streams and tables. Gives Levels. */
export interface DecodeRequest {
  op: 'decode';
  codec: CodecId;
  tables: Uint8Array;
  streams: Uint8Array[];
  /** First bytes of each stream's SHA-256; empty = not to be checked. */
  digests: Uint8Array[];
  /** The stream is a complete file. */
  complete: boolean;
  /** Mip levels to make, the picture itself included. */
  levels: number;
  /** Most width and height that the picture may have. */
  most: [number, number];
  /** Levels as blocks, made of the picture alone. */
  blocks?: BlockRequest;
}
/** x0 .. x1, y0 .. y1: multiples of 16, or the picture's end. */
export interface PictureArea {
  x0: number;
  x1: number;
  y0: number;
  y1: number;
}
/** An area of a picture enlarged bilinearly. Gives Levels. */
export interface EnlargeRequest extends PictureArea {
  op: 'enlarge';
  picture: ImageBitmap;
  width: number;
  height: number;
  levels: number;
  /** As for decode. */
  blocks?: BlockRequest;
}
/** Make blocks of a picture that is no file. Gives Levels. */
export interface PixelsRequest extends Pixels {
  op: 'blocks';
  blocks: BlockRequest;
}
/** A picture and its halves, one after the other. */
export type Levels = (ImageBitmap | BlockLevel)[];
/** Start a vertex-split stream under a number of the caller's. Gives SplitInfo. */
export interface SplitOpenRequest {
  op: 'split-open';
  key: number;
  head: Uint8Array;
}
/** Decode the next blocks of a stream, which stand one after the other. */
export interface SplitAddRequest {
  op: 'split-add';
  key: number;
  blocks: Uint8Array;
  /** By material: the texture coordinates (0 or 1) that tangents are made along; -1 or nothing = none. */
  tangents: number[];
}
/** Check the digests of the whole blocks among bytes of a stream. */
export interface SplitCheckRequest {
  op: 'split-check';
  key: number;
  /** Where the bytes stand in the stream. */
  from: number;
  blocks: Uint8Array;
}
/** Forget a stream. */
export interface SplitCloseRequest {
  op: 'split-close';
  key: number;
}
/** Decode a document by a function of documents.ts. Gives the result of that function. */
export interface DocumentRequest {
  op: 'document';
  name: keyof Documents;
  args: unknown[];
}
/** Anything that a worker is asked. */
export type WorkerRequest = DocumentRequest | DecodeRequest | EnlargeRequest | PixelsRequest
  | SplitOpenRequest | SplitCheckRequest | SplitAddRequest | SplitCloseRequest;

/** Facts about a stream from its head. */
export interface SplitInfo {
  /** Bytes of the head; blocks follow. */
  headBytes: number;
  /** Coarsest first; complete with the byte before `end`. */
  scales: { scale: number; blocks: number; wedges: number; end: number }[];
}

/** Wedges that were added to a split mesh, and the mesh's triangles now. */
export interface SplitUpdate {
  /** Wedges before and now; arrays hold those between. */
  from: number;
  to: number;
  /** Blocks decoded so far. */
  blocks: number;
  /** Positions, UV, normals, colours, by three.js's names. */
  attributes: { name: string; components: number; values: Float32Array }[];
  /** Wedges of all visible triangles, sorted by group. */
  index: Uint32Array;
  /** Parts of the index that are drawn by one material each. */
  draws: { material: number; start: number; count: number }[];
  /** Of all wedges and of some that this index alone has, from number `to` on. */
  tangents?: MadeTangents;
}

/** A worker's answer. */
export interface WorkerAnswer {
  id: number;
  /** Levels of decode and enlarge, SplitUpdate of split-add, the decoded document. */
  result?: unknown;
  /** The error itself, where no thread lies between. */
  failed?: unknown;
  error?: { name: string; message: string; parts?: [string, string, string, string, string] };
}
