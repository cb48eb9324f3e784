import type { Camera, Material, Object3D, Texture, WebGLRenderer } from 'three';
import type { BlockFormat } from '../blocks/formats';
import type { Policy } from '../decide/harmonic_time';
import type { StepRule, VisiblePart } from '../decide/viewing';
import type { RequestRecord } from '../http/requests';
import type { DecodeHere } from '../worker/pool';

/** How the object is looked at; lengths in device pixels. */
export interface Display {
  /** Height on screen of the object's largest extent, seen or not. */
  heightPx: number;
  /** Visible part of the object (Fig. 7.5); left out: the whole object. */
  part?: VisiblePart;
}

/** Where somebody looks. */
export interface Gaze {
  /** Place in the picture, -1 (left) to 1 (right). */
  x: number;
  /** -1 (bottom) to 1 (top). */
  y: number;
  /** Device pixels for one degree of the visual field. Default 40: 96 to the inch at 60 cm. */
  pxPerDegree?: number;
}

/** The methods of GLTFLoader (three/addons) that this library uses. */
export interface GltfLoaderLike {
  /** Adds an extension of the loader. */
  register(callback: (parser: any) => any): unknown;
  /** Reads a GLB. */
  parseAsync(data: ArrayBuffer, path: string): Promise<unknown>;
}

/** A model's turn at the link. */
export interface Turn {
  /** From now on; Infinity: no limit. 0: the first picture stays until refine() or another view. */
  seconds: number;
  /** Expected bytes per second of the link; left out: what the model's own transfers have shown. */
  bytesS?: number;
}

/** Options of TexmeshPackage.load. */
export interface LoadOptions {
  /** The renderer of the scene: textures are composed in the renderer's context. */
  renderer: WebGLRenderer;
  /** Makes a GLTFLoader with the decoders that the package's meshes need. Called for every mesh. */
  gltfLoader: () => GltfLoaderLike;
  /** Camera that looks at the object; scale and textures follow the camera's view, see LoadedModel.update. */
  camera?: Camera;
  /**
   * Where somebody looks, asked before every list of fragments (an eye tracker, the pointer): what lies
   * beside counts less, by the acuity of the eye. Needs a camera. Left out: the whole picture counts alike.
   */
  gaze?: () => Gaze | undefined;
  /** Displayed height in device px, or a function that gives it; replaces the camera. Default 1000. */
  display?: number | Display | (() => number | Display);
  /**
   * Seconds from the package's opening (the first load) or from load() (further ones) until everything is
   * there. Infinity: no limit, everything that the display can show. Default 5.
   */
  time?: number;
  /**
   * Policy that spends the time. guard: what shows most of what the camera sees comes first. thesis: chapters
   * 4 and 7 as printed, with the rule distance, one request at a time. Default guard.
   */
  policy?: Policy;
  /** First guess of the throughput, bytes per second; left out: the throughput of the first transfers. */
  beta0BytesS?: number;
  /** The rule that says which scale is enough. Default flip: by lit pictures that the build compared. */
  rule?: StepRule;
  /**
   * The viewer's own just-noticeable difference, above 0 and at most 1: the load stops at the coarsest scale
   * that cannot be told from the rule's. It fetches thesis.bin for it. Left out: the rule alone decides.
   */
  jnd?: number;
  /** This scale (or the nearest one that the package has) instead of the scale for the display. */
  scale?: number;
  /** This rung of every fragment (at most the highest) instead of rungs that fit the time. */
  rung?: number;
  /** Textures have full size, whatever the display can show. */
  fullSize?: boolean;
  /** Meshes: as GLB files, by the vertex-split stream, or by whichever needs fewer bytes. Default auto. */
  meshes?: 'glb' | 'stream' | 'auto';
  /** Whether the load goes on after the deadline until the display can show no more. Default true. */
  autoRefine?: boolean;
  /** Refining fetches no fragment whose 1 - SSIM is no more than this. Default 0.003: not to be seen. */
  refineTo?: number;
  /** Address of worker.js, where that file does not stand beside the library. */
  workerUrl?: string | URL;
  /** `handle` of texmesh/worker, for pages without workers: it works on the main thread. */
  decode?: DecodeHere;
  /** Workers that decode images. Default: 2 to 4 by the number of cores. */
  workers?: number;
  /**
   * Asked once the first picture stands; the timed part begins when the answer comes, and lasts as long as
   * the answer says. So several models of a page have the link one after the other. `bytes` are fetched in
   * any turn, before anything can be chosen. `time` counts where this is left out.
   */
  turn?: (bytes: number) => Promise<Turn>;
  /**
   * Bytes that textures and meshes may take on the GPU: textures get coarser mips, meshes coarser scales,
   * until all fits or nothing is coarser. Left out: no limit but the one that the GPU shows by losing its
   * context, or by refusing storage.
   */
  memoryBytes?: number | (() => number);
  /**
   * Textures as blocks of 4 x 4 texels: auto = where memoryBytes would take coarser mips otherwise, as BC7 or
   * ASTC, and normals as BC5, ASTC or BC3, which take a quarter of the memory; always = whatever memory there
   * is, at last as BC1 or ETC2, which take an eighth and look worse; never. What the GPU has decides. Default
   * auto.
   */
  compress?: 'auto' | 'always' | 'never';
  /** Address of blocks.js, which makes blocks, where that file does not stand beside the library. */
  blocksUrl?: string | URL;
  /** Cancels the load, as LoadedModel.cancel does. */
  signal?: AbortSignal;
}

/** Phases of a load, in their order. */
export type LoadPhase = 'first-picture' | 'tables' | 'mesh' | 'textures' | 'refining' | 'done' | 'cancelled'
  | 'failed';

/** A decision for a fragment or some neighbours; sent when taken and when its transfer has ended. */
export interface DecisionEvent {
  /** k = 1 .. n */
  position: number;
  /** Texture plane of the fragments. */
  plane: number;
  /** The first. */
  fragment: number;
  /** All: neighbours of one rung are fetched together where a request takes longer than its bytes. */
  fragments: number[];
  /** Importance. */
  eta: number;
  /** -1: skipped */
  rung: number;
  /** Bytes that are fetched. */
  bytes: number;
  /** theta_k: the transfer may take so long. */
  plannedSeconds: number;
  /** gamma_k: the transfer took so long; undefined until the transfer has ended. */
  actualSeconds?: number;
  /** Time that earlier transfers have saved, or, below 0, lost. */
  creditSeconds: number;
  /** Throughput that the decision supposes. */
  bytesPerSecond: number;
  /** When the fragments were asked for, seconds after the first request for a fragment. */
  issued: number;
  /** When the fragments had come, on the same clock; undefined until then. */
  done?: number;
  /** Nothing is fetched: the preview stays. */
  skipped: boolean;
}

/** Events of a load; every one has the time `at`, milliseconds of performance.now(). */
export interface LoadEvents {
  /** A request of the package has ended. */
  request: RequestRecord & { at: number };
  /** The smallest proxy (`scale` is -1), or the coarsest mesh with its previews (`proxy` is -1), is shown. */
  'first-picture': { at: number; scale: number; proxy: number; bytes: number };
  /** A proxy stands in the scene: the first one, a larger one on the way, or one that is enough. */
  proxy: { at: number; proxy: number; triangles: number };
  /** Another scale stands in the scene. */
  scale: { at: number; scale: number; triangles: number };
  /** A plane was chosen, or a finer one, to show a texture. */
  plane: { at: number; base: number; plane: number; widthPx: number; heightPx: number };
  /** A fragment is in its texture. */
  fragment: { at: number; plane: number; fragment: number; rung: number };
  /** The plan has decided about fragments, or their transfer has ended. */
  decision: DecisionEvent & { at: number };
  /** More bytes, or another phase. */
  progress: { at: number; phase: LoadPhase; bytes: number; bytesExpected: number };
  /** The timed part is over: limit and actual time, seconds from the same start. */
  deadline: { at: number; limit: number; actual: number; skipped: number };
  /** The context was lost, or is back: fragments are fetched again; `done` tells when all have come. */
  context: { at: number; lost: boolean };
  /** The GPU holds less than it was thought to: a coarser picture is shown from now on, within this limit. */
  memory: { at: number; gpuBytes: number; limitBytes: number };
  /** Something went wrong; fatal: the load has ended. */
  error: { at: number; fatal: boolean; message: string; what: string; error: unknown };
  /** Nothing is left to fetch for what the display can show now. */
  done: { at: number };
}

/** A texture that is being composed. */
export interface ComposedPlane {
  /** Full-size plane. */
  base: number;
  /** The plane that is shown: the full-size plane or a mip of that. */
  plane: number;
  /** Image of the package that the texture holds. */
  image: number;
  /** Role of the image: base-colour, normal and so on. */
  role: string;
  /** Texels of the shown plane across. */
  widthPx: number;
  /** Texels of the shown plane down. */
  heightPx: number;
  /** How texels are stored: rgba8, or the format of their blocks. */
  texels: 'rgba8' | BlockFormat;
  /** Rung of each fragment in the texture; -1: the preview. */
  rungs: Int16Array;
  /** Textures in the materials; all of them have the same GPU texture. */
  textures: readonly Texture[];
}

/** State of a load, for panels and tests. */
export interface LoadState {
  /** Phase of the load. */
  phase: LoadPhase;
  /** Scale in the scene; -1: none yet. */
  scale: number;
  /** Proxy in the scene, instead of a scale; -1: none. */
  proxy: number;
  /** Scale that is shown, or comes: what the display asks for, or what time and refining allow. */
  wantedScale: number;
  /** Displayed height that decides, device px. */
  displayedPx: number;
  /** Textures that are being composed, in no order. */
  planes: readonly ComposedPlane[];
  /** Bytes that the meshes and textures of the load take on the GPU, mip levels included. */
  gpuBytes: number;
  /** Bytes received by this package so far. */
  bytes: number;
  /** Estimate of the throughput now; 0: nothing is known yet. */
  throughputBytesS: number;
  /** Round trip, seconds. */
  rttS: number;
  /** Fragments whose transfer, decoding or upload is under way. */
  pending: number;
}

/** A package in a scene. */
export interface LoadedModel {
  /** Object that was added to the scene, in the frame of the package's meshes (Manifest.origin). */
  readonly object: Object3D;
  /** State of the load now; a new object each time. */
  readonly state: LoadState;
  /** Resolves when the first picture stands in the scene. */
  readonly firstPicture: Promise<void>;
  /** Resolves when the timed part is over and all is shown. Rejects when the load fails or is cancelled. */
  readonly done: Promise<void>;
  /** Calls the listener at every such event; gives a function that ends the calls. */
  on<K extends keyof LoadEvents>(name: K, listener: (event: LoadEvents[K]) => void): () => void;
  /**
   * Follows the view: to be called for every frame, or when the camera moves. Picks the scale (with
   * hysteresis), finer planes, and fragments to refine first. Cheap when nothing has changed: false.
   */
  update(camera?: Camera): boolean;
  /**
   * Fetches fragments, planes and a finer mesh that the display can show but the time did not allow; resolves
   * when none is left.
   */
  refine(): Promise<void>;
  /**
   * Changes scale and rung that were chosen at loading; fetches at once, or when the timed part is over, and
   * shows lower rungs in place of higher ones, too. undefined: by the display again. InputError: scale or
   * rung is no whole number from 0 on.
   */
  setOverride(override: { scale?: number; rung?: number }): void;
  /** Stops all transfers; the picture stays. */
  cancel(): void;
  /** Stops all transfers, takes the object out of the scene, frees its memory and its workers. */
  dispose(): void;
  /** RGBA bytes of a composed plane, row 0 at the top: read back from the GPU, for tests. */
  readPlane(base: number): Uint8Array;
  /** Materials in use, for effects of the application's own. */
  readonly materials: readonly Material[];
}
