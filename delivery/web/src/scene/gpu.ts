import { Camera, type Object3D, type Scene, type WebGLProgram, type WebGLRenderer } from 'three';
import { throwIfAborted } from '../format/errors';
import { nowS, sleepS } from '../http/clock';
import { materialsOf, texturesOf } from './scale_parts';

/** What is drawn for the first time, as a LoadContext has it. */
interface FirstDrawing {
  signal: AbortSignal;
  options: { renderer: WebGLRenderer };
  view: { camera?: Camera };
}
/** The first picture waits for its programs no longer than this. */
const mostCompileS = 0.5;

/** Resolves when the GPU has done all its work, or after `mostS`. A question to a GPU without work does not hold the page up. */
export async function gpuIdle(renderer: WebGLRenderer, mostS = 0.5): Promise<void> {
  const gl = renderer.getContext() as WebGL2RenderingContext;
  const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  const lives = () => fence !== null && gl.isSync(fence); // not behind a lost context, which may stand again by then
  gl.flush();
  for (const end = nowS() + mostS; lives() && nowS() < end && gl.getSyncParameter(fence!, gl.SYNC_STATUS) !== gl.SIGNALED; ) await sleepS(0.004);
  if (lives()) gl.deleteSync(fence);
}

/** Programs that were waited for: models of one page share them. */
const ready = new WeakSet<WebGLProgram>();

/** Waits for each program, then asks the program for its uniforms, in a turn of its own: the first frame would wait for the linker otherwise. */
async function programsReady(renderer: WebGLRenderer, mostS: number, stopIfCancelled: () => void): Promise<void> {
  const end = nowS() + mostS;
  const programs = (renderer.info?.programs ?? []) as (WebGLProgram & { isReady?(): boolean })[];
  for (const program of programs.filter((p) => !ready.has(p))) {
    do {
      await sleepS(0.004);
      stopIfCancelled();
    } while (program.program && program.isReady?.() === false && nowS() < end);
    if (!program.program) continue; // of another model, which went meanwhile
    program.getUniforms();
    ready.add(program);
  }
}

/** Prepares programs and previews for the first frame, each in a turn of its own: the page goes on while the GPU's process makes them. */
export async function readyToDraw(load: FirstDrawing, scene: Object3D, shape: Object3D): Promise<void> {
  const { signal, options: { renderer } } = load;
  const stopIfCancelled = (): void => throwIfAborted(signal);
  let root = scene;
  while (root.parent) root = root.parent;
  await sleepS(0);
  stopIfCancelled();
  renderer.compile(shape, load.view.camera ?? new Camera(), root as Scene);
  await gpuIdle(renderer, mostCompileS); // or what comes next would wait for the programs
  await programsReady(renderer, mostCompileS, stopIfCancelled);
  for (const [, texture] of materialsOf(shape).flatMap(texturesOf)) {
    await sleepS(0);
    stopIfCancelled();
    renderer.initTexture(texture);
  }
  await gpuIdle(renderer, mostCompileS);
}

/** Whether the processor draws for want of a GPU: the processor takes seconds for what a GPU does at once, and workers take less. */
export async function isSoftware(renderer: WebGLRenderer): Promise<boolean> {
  await gpuIdle(renderer);
  const gl = renderer.getContext();
  const info = gl.getExtension('WEBGL_debug_renderer_info');
  const name = String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}
