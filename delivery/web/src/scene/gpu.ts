import type { WebGLProgram, WebGLRenderer } from 'three';
import { nowS, sleepS } from '../http/clock';

/** Resolves when the GPU has done all that it was asked for, or after `mostS`: what asks it for an answer then does not hold the page up. */
export async function gpuIdle(renderer: WebGLRenderer, mostS = 0.5): Promise<void> {
  const gl = renderer.getContext() as WebGL2RenderingContext;
  const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  gl.flush();
  for (const end = nowS() + mostS; fence && nowS() < end && gl.getSyncParameter(fence, gl.SYNC_STATUS) !== gl.SIGNALED; ) await sleepS(0.004);
  gl.deleteSync(fence);
}

/** Each program once ready and asked for what it holds, in a turn of its own: in the first frame with it the page would wait for the linker. */
export async function programsReady(renderer: WebGLRenderer, mostS: number, goOn: () => void): Promise<void> {
  const end = nowS() + mostS;
  for (const program of [...(renderer.info?.programs ?? [])] as (WebGLProgram & { isReady?(): boolean })[]) {
    do {
      await sleepS(0.004);
      goOn();
    } while (program.isReady?.() === false && nowS() < end);
    program.getUniforms();
  }
}
