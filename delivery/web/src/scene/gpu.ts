import {
  type BufferAttribute, Camera, type CompressedTexture, type InterleavedBufferAttribute, LinearFilter,
  type Material, type Object3D, RGB_ETC2_Format, RGB_S3TC_DXT1_Format, type Scene, type Texture,
  type WebGLProgram, type WebGLRenderer,
} from 'three';
import { type GpuTexels, textureBytes } from '../decide/gpu_size';
import { throwIfAborted } from '../format/errors';
import { nowS, sleepS } from '../http/requests';
import { materialsOf, meshesOf, texturesOf } from './scale_parts';

/** What is drawn for the first time, as a LoadContext has it. */
interface FirstDrawing {
  signal: AbortSignal;
  options: { renderer: WebGLRenderer };
  view: { camera?: Camera };
}
/** The first picture waits for its programs no longer than this. */
const mostCompileS = 0.5;

/** Resolves when the GPU has done its work, or after `mostS`. A GPU without work answers at once. */
export async function gpuIdle(renderer: WebGLRenderer, mostS = 0.5): Promise<void> {
  const gl = renderer.getContext() as WebGL2RenderingContext;
  const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  // not behind a lost context, which may stand again by then
  const lives = () => fence !== null && gl.isSync(fence);
  gl.flush();
  for (const end = nowS() + mostS; lives() && nowS() < end &&
      gl.getSyncParameter(fence!, gl.SYNC_STATUS) !== gl.SIGNALED; ) await sleepS(0.004);
  if (lives()) gl.deleteSync(fence);
}

/** Whether the graphics context is gone. What is made meanwhile cannot even be deleted later. */
export function isLost(renderer: WebGLRenderer): boolean {
  return renderer.getContext().isContextLost();
}

/** Programs that were waited for: models of one page share them. */
const ready = new WeakSet<WebGLProgram>();

/** Waits for each program and asks for its uniforms, in a turn of its own, before the first frame. */
async function programsReady(renderer: WebGLRenderer, mostS: number,
    stopIfCancelled: () => void): Promise<void> {
  const end = nowS() + mostS;
  const programs = (): (WebGLProgram & { isReady?(): boolean })[] => renderer.info?.programs ?? [];
  for (const program of programs().filter((p) => !ready.has(p))) {
    // not of another model, which went meanwhile, or of a lost context
    const lives = (): boolean => programs().includes(program) && !isLost(renderer);
    do {
      await sleepS(0.004);
      stopIfCancelled();
    } while (lives() && program.isReady?.() === false && nowS() < end);
    if (!lives()) continue;
    program.getUniforms();
    ready.add(program);
  }
}

/**
 * Prepares programs and previews for the first frame, each in a turn of its own: the page goes on. A lost
 * context is left alone: the first frame behind the loss makes all.
 */
export async function readyToDraw(load: FirstDrawing, scene: Object3D, shape: Object3D): Promise<void> {
  const { signal, options: { renderer } } = load;
  const stopIfCancelled = (): void => throwIfAborted(signal);
  const unlessLost = (prepare: () => void): void => {
    stopIfCancelled();
    if (!isLost(renderer)) prepare();
  };
  let root = scene;
  while (root.parent) root = root.parent;
  await sleepS(0);
  unlessLost(() => renderer.compile(shape, load.view.camera ?? new Camera(), root as Scene));
  await gpuIdle(renderer, mostCompileS); // or what comes next would wait for the programs
  await programsReady(renderer, mostCompileS, stopIfCancelled);
  for (const [, texture] of materialsOf(shape).flatMap(texturesOf)) {
    await sleepS(0);
    unlessLost(() => renderer.initTexture(texture));
  }
  await gpuIdle(renderer, mostCompileS);
}

/** Whether the processor draws for want of a GPU: it is slow at what a GPU does; workers are faster. */
export async function isSoftware(renderer: WebGLRenderer): Promise<boolean> {
  await gpuIdle(renderer);
  const gl = renderer.getContext();
  const info = gl.getExtension('WEBGL_debug_renderer_info');
  const name = String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

/** Somebody who draws with a renderer. */
export interface GpuUser {
  /** Bytes that the user has on the GPU. */
  gpuBytes(): number;
  /** The GPU has refused something: all that the user has is to be made anew, within the new limit. */
  refused?(): void;
}
/** A context that holds less was lost for another reason: sleep, a driver's update, another graphics card. */
const leastAtLoss = 32e6;
/** Where less is refused, too, nothing helps. */
const leastLimit = 1e6;
/** Shares of what was on the GPU that may be there from then on. */
const shareAfter = { lost: 0.5, refused: 0.75 };
/** New shapes go to the GPU with the next frame: the GPU is asked so much later. */
const askAfterS = 0.25;
const mostIdleS = 1;
/**
 * A question holds the page up until the GPU has done all that stands before it: half a second to one and a
 * half were measured where the processor draws. A GPU that does nothing says so soon. One that never rests is
 * asked at last.
 */
const soonS = 0.03;
const mostBusyS = 10;
/** WebGL keeps one flag for each kind of error. */
const errorKinds = 8;

/** What the GPU has shown to hold: a context lost with much in it, and refused storage, lower the limit. */
export class GpuRoom {
  /** Most bytes that all users together may have; Infinity: nothing has been refused. */
  limitBytes = Infinity;
  private readonly users_ = new Set<GpuUser>();
  private asking_ = false;

  private constructor(private readonly renderer_: WebGLRenderer) {
    // Before the users' own listeners: who comes back after a loss asks for the new limit.
    renderer_.domElement?.addEventListener('webglcontextlost', () => {
      const used = this.usedBytes_();
      if (used >= leastAtLoss) this.lower_(shareAfter.lost * used);
    });
  }
  /** The room of a renderer's GPU: one for all loads. */
  static of(renderer: WebGLRenderer): GpuRoom {
    const room = rooms.get(renderer) ?? new GpuRoom(renderer);
    rooms.set(renderer, room);
    return room;
  }

  /** Counts a user; gives a function that ends this. */
  add(user: GpuUser): () => void {
    this.users_.add(user);
    return () => void this.users_.delete(user);
  }
  /** To be called when something new goes to the GPU: asks the GPU a little later whether it took all. */
  async ask(): Promise<void> {
    if (this.asking_) return;
    this.asking_ = true;
    await sleepS(askAfterS);
    await this.rest_();
    this.asking_ = false;
    if (this.users_.size === 0 || this.limitBytes <= leastLimit || !this.hasRefused_()) return;
    this.lower_(shareAfter.refused * this.usedBytes_());
    for (const user of [...this.users_]) user.refused?.();
  }

  /** Resolves when the GPU has nothing to do. */
  private async rest_(): Promise<void> {
    for (const end = nowS() + mostBusyS; ; ) {
      const start = nowS();
      await gpuIdle(this.renderer_, mostIdleS);
      if (nowS() < start + soonS || nowS() > end) return;
    }
  }
  private usedBytes_(): number {
    return [...this.users_].reduce((sum, user) => sum + user.gpuBytes(), 0);
  }
  private lower_(bytes: number): void {
    this.limitBytes = Math.max(leastLimit, Math.min(this.limitBytes * shareAfter.refused, bytes));
  }
  private hasRefused_(): boolean {
    const gl = this.renderer_.getContext();
    let refused = false;
    for (let k = 0; k < errorKinds; ++k) {
      const error = gl.getError();
      if (error === gl.NO_ERROR) break; // each question waits for the GPU's process
      refused ||= error === gl.OUT_OF_MEMORY;
    }
    return refused;
  }
}
const rooms = new WeakMap<WebGLRenderer, GpuRoom>();

/** How a texture's texels are stored. */
function texelsOf({ isCompressedTexture, format }: Partial<CompressedTexture>): GpuTexels {
  if (!isCompressedTexture) return 'rgba8';
  return format === RGB_S3TC_DXT1_Format || format === RGB_ETC2_Format ? 'block8' : 'block16';
}

/** Bytes that drawn shapes, materials' textures and planes take on the GPU. Shared ones count once. */
export function gpuBytes(shapes: readonly Object3D[], materials: readonly Material[],
    planes: readonly { textures: readonly Texture[] }[]): number {
  const arrays = new Set<{ byteLength: number }>();
  for (const { geometry } of shapes.flatMap(meshesOf))
    for (const a of [...Object.values(geometry.attributes), geometry.index] as (BufferAttribute
        | InterleavedBufferAttribute | null)[])
      if (a) arrays.add('data' in a ? (a.data.array as Float32Array) : (a.array as Float32Array));
  const pictures = new Map<unknown, number>();
  for (const texture of [...materials.flatMap((m) => texturesOf(m).map(([, t]) => t)),
        ...planes.flatMap((p) => [...p.textures])]) {
    const { width = 0, height = 0 } = (texture.image ?? {}) as Partial<ImageBitmap>;
    if (width > 0) pictures.set(texture.source, Math.max(pictures.get(texture.source) ?? 0,
      textureBytes(width, height, (texture.minFilter as number) > LinearFilter ? undefined : 1,
        texelsOf(texture as Partial<CompressedTexture>))));
  }
  return [...arrays].reduce((sum, a) => sum + a.byteLength, 0) +
    [...pictures.values()].reduce((sum, bytes) => sum + bytes, 0);
}
