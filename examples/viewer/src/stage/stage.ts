import { NeutralToneMapping, Scene, SRGBColorSpace, Vector2, Vector3, WebGLRenderer } from 'three';
import type { DirectionalLight, PerspectiveCamera } from 'three';
import { daylight, reflectSky } from 'texmesh';
import { graphics, idle, pixelRatio, turn } from './gpu';
import { Orbit } from './orbit';
import { Pace } from './pace';

/**
 * The picture of two scenes: left of a movable border the original, right of it the current one. Draws only
 * when something has changed, and once `begin` has made a renderer.
 */
export class Stage {
  readonly current = new Scene();
  readonly original = new Scene();
  /** Called before each frame; e.g. the library's look at the camera. */
  onFrame: () => void = () => {};

  private made: WebGLRenderer | null = null;
  private making: Promise<void> | null = null;
  private widthPx = 1;
  private heightPx = 1;
  private readonly orbit: Orbit;
  private readonly lamps: DirectionalLight[];
  private split = 0; // share of the width that shows the original
  private asked = false; // for a frame
  private readonly pace = new Pace();

  constructor(private readonly canvas: HTMLCanvasElement) {
    this.lamps = [this.current, this.original].map(daylight);
    this.orbit = new Orbit(canvas, () => this.draw());
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement ?? canvas);
    canvas.addEventListener('webglcontextrestored', () => this.draw());
    this.resize();
  }

  get camera(): PerspectiveCamera {
    return this.orbit.camera;
  }

  /** Makes the renderer, once, in turns of the page. Rejects where there is no WebGL. */
  begin(): Promise<void> {
    return (this.making ??= this.makeRenderer());
  }

  /** Throws before `begin` has resolved. */
  get renderer(): WebGLRenderer {
    if (!this.made) throw new Error('The stage is not ready');
    return this.made;
  }

  private async makeRenderer(): Promise<void> {
    const context = graphics(this.canvas);
    await idle(context);
    const renderer = new WebGLRenderer({ canvas: this.canvas, context });
    renderer.outputColorSpace = SRGBColorSpace;
    renderer.toneMapping = NeutralToneMapping;
    renderer.setClearAlpha(0);
    // Reading what the compiler has to say of three.js's own shaders would hold the page up.
    renderer.debug.checkShaderErrors = import.meta.env.DEV;
    await turn();
    this.made = renderer;
    this.resize();
  }

  /** Frames a new object: its box in the scene's units. */
  frame(min: readonly number[], max: readonly number[]): void {
    this.orbit.frame(min, max);
  }

  /** Puts the camera at a place that looks at another. */
  look(position: readonly number[], target: readonly number[]): void {
    this.orbit.look(position, target);
  }

  /** Shows the whole object. */
  home(): void {
    this.orbit.home();
  }

  /** Shows the original in the left `share` of the picture; 0 = not at all. */
  setSplit(share: number): void {
    this.split = share;
    this.draw();
  }

  /** Asks for a frame; several in a row give one. */
  draw(): void {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      this.render();
    });
  }

  /**
   * Asks for a frame of something that has come. The frame is drawn when the GPU has had as much time for
   * other work as the last frame took. Where the processor draws, a frame takes half a second, and frame upon
   * frame would keep back what is to be shown.
   */
  show(): void {
    this.pace.next(() => this.draw());
  }

  /** Deadline by performance.now(): `show` begins no frame that would last beyond it. */
  set dueAt(ms: number) {
    this.pace.dueAt = ms;
  }

  /** Gives metals that are loaded from now on a sky to mirror; other materials keep their light. */
  reflect(): void {
    for (const scene of [this.current, this.original]) reflectSky(scene);
  }

  /** Draws now. */
  render(): void {
    this.orbit.glide();
    this.onFrame();
    this.carryLamps();
    const [r, width, height] = [this.made, this.widthPx, this.heightPx];
    if (!r) return;
    this.drawScenes(r, width, height);
    this.pace.drawn(r.getContext() as WebGL2RenderingContext);
  }

  private drawScenes(r: WebGLRenderer, width: number, height: number): void {
    if (this.split > 0) {
      const border = Math.round(width * this.split);
      r.setScissorTest(true);
      r.setScissor(0, 0, border, height);
      r.render(this.original, this.camera);
      r.setScissor(border, 0, width - border, height);
      r.render(this.current, this.camera);
      r.setScissorTest(false);
    } else {
      r.render(this.current, this.camera);
    }
  }

  private carryLamps(): void {
    const side = new Vector3(-0.5, 0.7, 1).applyQuaternion(this.camera.quaternion);
    for (const lamp of this.lamps) {
      lamp.target.position.copy(this.orbit.target);
      lamp.position.copy(this.orbit.target).add(side);
    }
  }

  private resize(): void {
    const box = this.canvas.parentElement?.getBoundingClientRect();
    if (!box || box.width < 1 || box.height < 1) return;
    [this.widthPx, this.heightPx] = [box.width, box.height];
    this.fit();
    this.camera.aspect = box.width / box.height;
    this.camera.updateProjectionMatrix();
    // A canvas that was resized is empty until the next frame: draw at once, or it flickers.
    this.render();
  }

  /** The renderer's buffer as large as the picture; made anew only when it has another size. */
  private fit(): void {
    const r = this.made;
    const ratio = pixelRatio();
    if (!r || (r.getPixelRatio() === ratio &&
        r.getSize(new Vector2()).equals({ x: this.widthPx, y: this.heightPx }))) return;
    r.setDrawingBufferSize(this.widthPx, this.heightPx, ratio); // setPixelRatio and setSize would make two
  }
}
