import { Box3, MathUtils, PerspectiveCamera, Spherical, Vector3 } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { firstLookFovDegrees, frame } from 'texmesh';

const kTurnDegrees = 6; // per press of an arrow key
const kNearer = 0.85; // per press of +

/**
 * A camera that goes round the object by mouse, touch and keyboard. Calls `onMove` when the camera has moved.
 */
export class Orbit {
  readonly camera = new PerspectiveCamera(firstLookFovDegrees, 1, 0.01, 100);
  private readonly controls: OrbitControls;
  private readonly bounds = new Box3(new Vector3(-1, -1, -1), new Vector3(1, 1, 1));

  constructor(canvas: HTMLCanvasElement, private readonly onMove: () => void) {
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = true;
    this.controls.dampingFactor = 0.12;
    this.controls.addEventListener('change', () => onMove());
    canvas.addEventListener('keydown', (e) => this.key(e));
  }

  /** The point that the camera goes round. */
  get target(): Vector3 {
    return this.controls.target;
  }

  /** Carries on the gliding after a movement; while the camera glides, `onMove` is called. */
  glide(): void {
    this.controls.update();
  }

  /** Frames a new object: its box in the scene's units. */
  frame(min: readonly number[], max: readonly number[]): void {
    this.bounds.min.fromArray(min as number[]);
    this.bounds.max.fromArray(max as number[]);
    this.home();
  }

  /** The whole object, as its poster shows it. */
  home(): void {
    const { min, max } = this.bounds;
    const centre = frame(this.camera, min.toArray(), max.toArray());
    const distance = this.camera.position.distanceTo(centre);
    this.controls.target.copy(centre);
    this.controls.minDistance = min.distanceTo(max) / 100;
    this.controls.maxDistance = distance * 8;
    this.moved();
  }

  /** Puts the camera at a place that looks at another, round which it then goes. */
  look(position: readonly number[], target: readonly number[]): void {
    this.camera.position.fromArray(position as number[]);
    this.controls.target.fromArray(target as number[]);
    this.moved();
  }

  /** Turns the camera round the object, degrees. */
  turn(right: number, up: number): void {
    const offset = this.camera.position.clone().sub(this.target);
    const s = new Spherical().setFromVector3(offset);
    s.theta += MathUtils.degToRad(right);
    s.phi = MathUtils.clamp(s.phi - MathUtils.degToRad(up), 0.02, Math.PI - 0.02);
    this.camera.position.setFromSpherical(s).add(this.target);
    this.moved();
  }

  /** Comes nearer by a factor below 1, goes away by one above. */
  zoom(factor: number): void {
    const offset = this.camera.position.clone().sub(this.target);
    const length =
      MathUtils.clamp(offset.length() * factor, this.controls.minDistance, this.controls.maxDistance);
    this.camera.position.copy(this.target).add(offset.setLength(length));
    this.moved();
  }

  private moved(): void {
    this.controls.update();
    this.onMove();
  }

  private key(e: KeyboardEvent): void {
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    const step = e.shiftKey ? kTurnDegrees * 3 : kTurnDegrees;
    const actions: Record<string, () => void> = {
      ArrowLeft: () => this.turn(-step, 0),
      ArrowRight: () => this.turn(step, 0),
      ArrowUp: () => this.turn(0, step),
      ArrowDown: () => this.turn(0, -step),
      '+': () => this.zoom(kNearer),
      '=': () => this.zoom(kNearer),
      '-': () => this.zoom(1 / kNearer),
      '0': () => this.home(),
      Home: () => this.home(),
    };
    const action = actions[e.key];
    if (!action) return;
    e.preventDefault();
    action();
  }
}
