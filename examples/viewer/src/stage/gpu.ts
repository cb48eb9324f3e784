/** As WebGLRenderer would make it. */
const kAttributes: WebGLContextAttributes = { alpha: true, depth: true, stencil: false, antialias: true, powerPreference: 'high-performance' };
/** What three.js and the library ask for, sooner or later. */
const kExtensions = [
  'EXT_color_buffer_float', 'WEBGL_clip_cull_distance', 'OES_texture_float_linear', 'EXT_color_buffer_half_float', 'EXT_texture_filter_anisotropic',
  'KHR_parallel_shader_compile', 'WEBGL_debug_renderer_info',
];

/** A page waits for a busy GPU no longer than this. */
const kMostIdleMs = 500;

/** The page's other work comes first. */
export const turn = (ms = 0): Promise<void> => new Promise((go) => setTimeout(go, ms));

/** Device pixels per CSS pixel of the picture: more than two only cost time. */
export const pixelRatio = (): number => Math.min(devicePixelRatio, 2);

let made: WebGL2RenderingContext | null = null;

/**
 * The canvas's WebGL 2, made once. Making it and asking for an extension are calls that wait for the browser's GPU process, 0.2 s in all
 * where there is no graphics card, and longer once that has a page to draw: so this comes first of all, while the rest of the page
 * is being fetched. Throws where there is none.
 */
export function graphics(canvas: HTMLCanvasElement): WebGL2RenderingContext {
  if (made) return made;
  // The right size from the start: another one would make its buffers anew.
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

/** Resolves when the GPU has done what it was asked for: a question holds the page up until then, this does not. */
export async function idle(gl: WebGL2RenderingContext, mostMs = kMostIdleMs): Promise<void> {
  const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  if (!fence) return; // a lost context
  gl.flush();
  const end = performance.now() + mostMs;
  do await turn(4); while (performance.now() < end && !gl.isContextLost() && gl.getSyncParameter(fence, gl.SYNC_STATUS) !== gl.SIGNALED);
  gl.deleteSync(fence);
}
