import type { WebGLProgram, WebGLRenderer } from 'three';
import { nowS, sleepS } from './http';

/** Resolves when the GPU has done all that it was asked for, or after `mostS`: what asks it for an answer then does not hold the page up. */
export async function gpuIdle(renderer: WebGLRenderer, mostS = 0.5): Promise<void> {
  const gl = renderer.getContext?.() as WebGL2RenderingContext | undefined;
  const fence = gl?.fenceSync?.(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  if (!gl || !fence) return;
  gl.flush();
  for (const end = nowS() + mostS; nowS() < end && gl.getSyncParameter(fence, gl.SYNC_STATUS) !== gl.SIGNALED; )
    await sleepS(0.004);
  gl.deleteSync(fence);
}

/** Each program once ready and asked for what it holds, in a turn of its own: in the first frame with it the page would wait for the linker. */
export async function programsReady(renderer: WebGLRenderer, mostS: number, goOn: () => void): Promise<void> {
  const end = nowS() + mostS;
  for (const program of [...(renderer.info?.programs ?? [])] as (WebGLProgram & { isReady?(): boolean })[]) {
    while (program.isReady?.() === false && nowS() < end) {
      await sleepS(0.004);
      goOn();
    }
    program.getUniforms();
    await sleepS(0);
    goOn();
  }
}

const software = new WeakMap<WebGLRenderer, Promise<boolean>>();

/** Nothing but the processor draws: what a GPU does at once takes it seconds, and workers less. */
export function isSoftware(renderer: WebGLRenderer): Promise<boolean> {
  let is = software.get(renderer);
  if (!is) software.set(renderer, (is = asked(renderer)));
  return is;
}
async function asked(renderer: WebGLRenderer): Promise<boolean> {
  await gpuIdle(renderer);
  const gl = renderer.getContext();
  const info = gl.getExtension('WEBGL_debug_renderer_info');
  const name = String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}
