import {
  Box3, DirectionalLight, MathUtils, NeutralToneMapping, PerspectiveCamera, Scene, Spherical, SRGBColorSpace, Vector2, Vector3, WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { graphics, idle, pixelRatio, turn } from './gpu';
import { light, reflectSky } from './light';

const kFieldOfViewDegrees = 32;
const kTurnDegrees = 6; // per press of an arrow key
/** Longer than this no frame is waited for, and none is kept back. */
const kMostFrameMs = 1500;
/** A load that ends later than this shows what it has. */
const kMostLateMs = 1000;

/**
 * The picture: a camera that goes round the object by mouse, touch and keyboard, and two scenes of which the left one is shown
 * left of a movable border. Draws only when something has changed, and once `begin` has made a renderer.
 */
export class Stage {
  readonly camera = new PerspectiveCamera(kFieldOfViewDegrees, 1, 0.01, 100);
  readonly current = new Scene();
  readonly original = new Scene();
  /** Called before each frame; e.g. the library's look at the camera. */
  onFrame: () => void = () => {};

  private made: WebGLRenderer | null = null;
  private becoming: Promise<void> | null = null;
  private widthPx = 1;
  private heightPx = 1;
  private readonly controls: OrbitControls;
  private readonly lamps: DirectionalLight[];
  private readonly bounds = new Box3(new Vector3(-1, -1, -1), new Vector3(1, 1, 1));
  private split = 0; // share of the width that shows the original
  private asked = false;
  private readonly pace = new Pace();

  constructor(private readonly canvas: HTMLCanvasElement) {
    this.lamps = [this.current, this.original].map(light);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = true;
    this.controls.dampingFactor = 0.12;
    this.controls.addEventListener('change', () => this.draw());
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement ?? canvas);
    canvas.addEventListener('keydown', (e) => this.key(e));
    canvas.addEventListener('webglcontextrestored', () => this.draw());
    this.resize();
  }

  /** Makes the renderer, once, in turns of the page. Rejects where there is no WebGL. */
  begin(): Promise<void> {
    return (this.becoming ??= this.makeRenderer());
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
    this.bounds.min.fromArray(min as number[]);
    this.bounds.max.fromArray(max as number[]);
    this.home();
  }

  /** The whole object, the sphere round its box, from a little above, its front to the left. */
  home(): void {
    const centre = this.bounds.getCenter(new Vector3());
    const radius = Math.max(this.bounds.getSize(new Vector3()).length() / 2, 1e-9);
    const half = MathUtils.degToRad(kFieldOfViewDegrees) / 2;
    const narrow = Math.min(1, this.camera.aspect);
    const distance = radius / Math.sin(Math.atan(Math.tan(half) * narrow));
    this.camera.position.setFromSpherical(new Spherical(distance, MathUtils.degToRad(72), MathUtils.degToRad(28))).add(centre);
    this.camera.near = distance / 500;
    this.camera.far = distance * 20;
    this.camera.updateProjectionMatrix();
    this.controls.target.copy(centre);
    this.controls.minDistance = radius / 50;
    this.controls.maxDistance = distance * 8;
    this.controls.update();
    this.draw();
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
   * Something has come that a frame may show: one is drawn when the GPU has had as much time for other things, the next things to come
   * among them, as the last frame took. Where the processor draws, half a second each, frames would else keep back what is to be shown.
   */
  show(): void {
    this.pace.next(() => this.draw());
  }

  /** All is to have come at this time of performance.now(): no frame of `show` is begun that would last until then. */
  set dueAt(ms: number) {
    this.pace.dueAt = ms;
  }

  /** Metals mirror a sky, of whose light the rest gets as much as before. For what is loaded from now on. */
  reflect(): void {
    for (const scene of [this.current, this.original]) reflectSky(scene);
  }

  /** Draws now. */
  render(): void {
    this.controls.update(); // while it is gliding, this asks for the next frame
    this.onFrame();
    this.carryLamps();
    const [r, width, height] = [this.made, this.widthPx, this.heightPx];
    if (!r) return;
    this.draws(r, width, height);
    this.pace.drawn(r.getContext() as WebGL2RenderingContext);
  }

  private draws(r: WebGLRenderer, width: number, height: number): void {
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
      lamp.target.position.copy(this.controls.target);
      lamp.position.copy(this.controls.target).add(side);
    }
  }

  /** Turns the camera round the object, degrees. */
  turn(right: number, up: number): void {
    const offset = this.camera.position.clone().sub(this.controls.target);
    const s = new Spherical().setFromVector3(offset);
    s.theta += MathUtils.degToRad(right);
    s.phi = MathUtils.clamp(s.phi - MathUtils.degToRad(up), 0.02, Math.PI - 0.02);
    this.camera.position.setFromSpherical(s).add(this.controls.target);
    this.controls.update();
    this.draw();
  }

  /** Comes nearer by a factor below 1, goes away by one above. */
  zoom(factor: number): void {
    const offset = this.camera.position.clone().sub(this.controls.target);
    const length = MathUtils.clamp(offset.length() * factor, this.controls.minDistance, this.controls.maxDistance);
    this.camera.position.copy(this.controls.target).add(offset.setLength(length));
    this.controls.update();
    this.draw();
  }

  private key(e: KeyboardEvent): void {
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    const step = e.shiftKey ? kTurnDegrees * 3 : kTurnDegrees;
    const actions: Record<string, () => void> = {
      ArrowLeft: () => this.turn(-step, 0),
      ArrowRight: () => this.turn(step, 0),
      ArrowUp: () => this.turn(0, step),
      ArrowDown: () => this.turn(0, -step),
      '+': () => this.zoom(0.85),
      '=': () => this.zoom(0.85),
      '-': () => this.zoom(1 / 0.85),
      '0': () => this.home(),
      Home: () => this.home(),
    };
    const action = actions[e.key];
    if (!action) return;
    e.preventDefault();
    action();
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
    if (!r || (r.getPixelRatio() === ratio && r.getSize(new Vector2()).equals({ x: this.widthPx, y: this.heightPx }))) return;
    r.setDrawingBufferSize(this.widthPx, this.heightPx, ratio); // setPixelRatio and setSize would make two
  }
}

/** When frames of what comes are drawn. */
class Pace {
  dueAt = Infinity;
  private frameMs = 0; // on the GPU, the last one
  private drawing = 0; // frames that are not on the screen yet
  private freeAt = 0; // since when the GPU has had none
  private timer = 0;

  /** Calls `draw` once, when it is time. */
  next(draw: () => void): void {
    if (this.timer) return;
    const wait = this.waitMs(performance.now());
    if (wait <= 0) return draw();
    this.timer = window.setTimeout(() => {
      this.timer = 0;
      this.next(draw);
    }, wait);
  }

  private waitMs(now: number): number {
    if (this.drawing > 0) return 8;
    // What is late has no time for frames, either.
    if (now + this.frameMs > this.dueAt && now < this.dueAt + kMostLateMs) return Math.max(8, this.dueAt - now);
    return this.freeAt + this.frameMs - now;
  }

  /** A frame has been asked for. */
  drawn(gl: WebGL2RenderingContext): void {
    const begun = performance.now();
    this.drawing++;
    void idle(gl, kMostFrameMs).then(() => {
      this.drawing--;
      this.freeAt = performance.now();
      this.frameMs = Math.min(this.freeAt - begun, kMostFrameMs);
    });
  }
}
