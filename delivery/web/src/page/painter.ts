import { type Camera, NeutralToneMapping, type Scene, Vector2, WebGLRenderer } from 'three';
import { GpuRoom } from '../scene/memory/gpu_room';

/** The renderer that draws all models of a page: browsers give a page few contexts. Pictures are copied to the models' own canvases. */
export class Painter {
  private own_?: WebGLRenderer;

  /** `given` is the application's; left out: one of the page's own, which the page disposes of. */
  constructor(private readonly given_?: WebGLRenderer) {}
  /** Made when it is first asked for. Throws where the browser has no WebGL. */
  get renderer(): WebGLRenderer {
    if (this.given_ ?? this.own_) return (this.given_ ?? this.own_)!;
    const renderer = (this.own_ = new WebGLRenderer({ antialias: true, alpha: true, powerPreference: 'high-performance' }));
    renderer.debug.checkShaderErrors = false; // each question waits for the compiler, and the programs are three.js's own
    renderer.toneMapping = NeutralToneMapping;
    renderer.setClearAlpha(0);
    return renderer;
  }

  /** What the GPU has shown to hold, bytes; Infinity: nothing has been refused. */
  get limitBytes(): number {
    const renderer = this.given_ ?? this.own_;
    return renderer ? GpuRoom.of(renderer).limitBytes : Infinity;
  }
  /** Draws a scene as large as the canvas has pixels. False: nothing can be drawn now, the context is lost. */
  draw(scene: Scene, camera: Camera, canvas: HTMLCanvasElement): boolean {
    const { renderer } = this;
    const { width, height } = canvas;
    const to = canvas.getContext('2d');
    if (!to || width < 1 || height < 1 || renderer.getContext().isContextLost()) return false;
    const size = renderer.getDrawingBufferSize(new Vector2());
    // The buffer grows to the largest picture: to make it anew for each would take longer than to draw.
    if (size.x < width || size.y < height) renderer.setDrawingBufferSize(Math.max(size.x, width), Math.max(size.y, height), 1);
    renderer.setViewport(0, 0, width, height);
    renderer.setScissor(0, 0, width, height);
    renderer.setScissorTest(true);
    renderer.render(scene, camera);
    to.globalCompositeOperation = 'copy';
    to.drawImage(renderer.domElement, 0, renderer.domElement.height - height, width, height, 0, 0, width, height);
    return true;
  }
  dispose(): void {
    this.own_?.dispose();
    this.own_?.forceContextLoss();
  }
}
