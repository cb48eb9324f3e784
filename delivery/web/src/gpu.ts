import type { WebGLRenderer } from 'three';
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

const software = new WeakMap<WebGLRenderer, boolean>();

/** Nothing but the processor draws: what a GPU does at once takes it seconds, and workers less. */
export async function isSoftware(renderer: WebGLRenderer): Promise<boolean> {
  let is = software.get(renderer);
  if (is === undefined) {
    await gpuIdle(renderer);
    const gl = renderer.getContext();
    const info = gl.getExtension('WEBGL_debug_renderer_info');
    const name = String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
    software.set(renderer, (is = /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name)));
  }
  return is;
}
