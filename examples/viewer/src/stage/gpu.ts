/** As WebGLRenderer would make it. */
const kAttributes: WebGLContextAttributes = { alpha: true, depth: true, stencil: false, antialias: true,
  powerPreference: 'high-performance' };
/** What three.js and the library ask for, sooner or later. */
const kExtensions = [
  'EXT_color_buffer_float', 'WEBGL_clip_cull_distance', 'OES_texture_float_linear',
  'EXT_color_buffer_half_float', 'EXT_texture_filter_anisotropic',
  'KHR_parallel_shader_compile', 'WEBGL_debug_renderer_info',
];

/** Longest wait for a busy GPU. */
const kMostIdleMs = 500;

/** Resolves after a turn of the page: other work of the page comes first. */
export const turn = (ms = 0): Promise<void> => new Promise((go) => setTimeout(go, ms));

/** Device pixels per CSS pixel of the picture, at most two: more cost time and are not seen. */
export const pixelRatio = (): number => Math.min(devicePixelRatio, 2);

let made: WebGL2RenderingContext | null = null;

/**
 * The canvas's WebGL 2 context, made by the first call. Throws where the browser has none. Making a context
 * and asking for an extension are calls that wait for the browser's GPU process: 0.2 s in all without a
 * graphics card, longer once that process has a page to draw. So the page makes its context first of all,
 * while the rest of the page is being fetched.
 */
export function graphics(canvas: HTMLCanvasElement): WebGL2RenderingContext {
  if (made) return made;
  // The right size from the start: a change of size makes the buffers anew.
  const box = (canvas.parentElement ?? canvas).getBoundingClientRect();
  if (box.width >= 1 && box.height >= 1) {
    canvas.width = Math.floor(box.width * pixelRatio());
    canvas.height = Math.floor(box.height * pixelRatio());
  }
  made = canvas.getContext('webgl2', kAttributes);
  if (!made) throw new Error('This browser gives no WebGL 2 context');
  for (const name of kExtensions) made.getExtension(name);
  return made;
}

/**
 * Resolves when the GPU has done all its work so far, or after `mostMs`. The page goes on meanwhile; a
 * question to the GPU would hold the page up.
 */
export async function idle(gl: WebGL2RenderingContext, mostMs = kMostIdleMs): Promise<void> {
  const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  if (!fence) return; // a lost context
  gl.flush();
  const end = performance.now() + mostMs;
  do await turn(4); while (performance.now() < end && !gl.isContextLost() &&
    gl.getSyncParameter(fence, gl.SYNC_STATUS) !== gl.SIGNALED);
  gl.deleteSync(fence);
}
