import type { Orbit } from '../page/framing';

/** Degrees per press of an arrow key, and with Shift. */
const keyDegrees = { plain: 6, shift: 18 };
const nearer = 0.85;
const distances = { least: 0.05, most: 8 };
/** A drag over the whole height of the canvas turns by so many degrees. */
const degreesPerHeight = 180;

/** Turns what the user does on a canvas into orbits: mouse, touch, pen, wheel and keys. */
export class OrbitInput {
  orbit: Orbit;
  private readonly pointers_ = new Map<number, { x: number; y: number }>();
  private readonly ended_ = new AbortController();

  /** `moved` hears of each new orbit. With `zooms`, the wheel zooms while the canvas has the focus. */
  constructor(private readonly canvas_: HTMLElement, private home_: Orbit,
      private readonly moved_: () => void, private readonly zooms_ = true) {
    this.orbit = { ...home_ };
    const { signal } = this.ended_;
    canvas_.addEventListener('pointerdown', (e) => this.down_(e), { signal });
    canvas_.addEventListener('pointermove', (e) => this.move_(e), { signal });
    for (const name of ['pointerup', 'pointercancel'] as const)
      canvas_.addEventListener(name, (e) => this.pointers_.delete(e.pointerId), { signal });
    if (zooms_) canvas_.addEventListener('wheel', (e) => this.wheel_(e), { signal, passive: false });
    canvas_.addEventListener('keydown', (e) => this.key_(e), { signal });
  }
  /** Whether the user holds the object now. */
  get isHeld(): boolean {
    return this.pointers_.size > 0;
  }
  /** Goes to another orbit, which Home leads back to. */
  reset(home: Orbit): void {
    this.home_ = home;
    this.set_(home);
  }
  turn(right: number, up: number): void {
    const { thetaDegrees, phiDegrees, distance } = this.orbit;
    this.set_({ thetaDegrees: (thetaDegrees + right) % 360,
      phiDegrees: Math.min(179, Math.max(1, phiDegrees - up)), distance });
  }
  zoom(factor: number): void {
    if (this.zooms_) this.set_({ ...this.orbit,
      distance: Math.min(distances.most, Math.max(distances.least, this.orbit.distance * factor)) });
  }
  dispose(): void {
    this.ended_.abort();
    this.pointers_.clear();
  }

  private set_(orbit: Orbit): void {
    this.orbit = { ...orbit };
    this.moved_();
  }
  private down_(e: PointerEvent): void {
    if (e.button !== 0) return;
    this.pointers_.set(e.pointerId, { x: e.clientX, y: e.clientY });
    this.canvas_.setPointerCapture?.(e.pointerId);
    this.canvas_.focus({ preventScroll: true });
  }
  private move_(e: PointerEvent): void {
    const before = this.pointers_.get(e.pointerId);
    if (!before) return;
    const now = { x: e.clientX, y: e.clientY };
    const other = [...this.pointers_].find(([id]) => id !== e.pointerId)?.[1];
    this.pointers_.set(e.pointerId, now);
    if (other) {
      const apart = (p: { x: number; y: number }): number =>
        Math.max(1, Math.hypot(p.x - other.x, p.y - other.y));
      return this.zoom(apart(before) / apart(now));
    }
    const scale = degreesPerHeight / Math.max(1, this.canvas_.clientHeight);
    this.turn((before.x - now.x) * scale, (now.y - before.y) * scale);
  }
  private wheel_(e: WheelEvent): void {
    if (this.canvas_.getRootNode() instanceof ShadowRoot
        ? (this.canvas_.getRootNode() as ShadowRoot).activeElement !== this.canvas_
        : document.activeElement !== this.canvas_) return;
    e.preventDefault();
    this.zoom(Math.exp(Math.min(1, Math.max(-1, e.deltaY / 400))));
  }
  private key_(e: KeyboardEvent): void {
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    const step = e.shiftKey ? keyDegrees.shift : keyDegrees.plain;
    const actions: Record<string, () => void> = {
      ArrowLeft: () => this.turn(-step, 0),
      ArrowRight: () => this.turn(step, 0),
      ArrowUp: () => this.turn(0, step),
      ArrowDown: () => this.turn(0, -step),
      '+': () => this.zoom(nearer),
      '=': () => this.zoom(nearer),
      '-': () => this.zoom(1 / nearer),
      Home: () => this.set_(this.home_),
    };
    const action = actions[e.key];
    if (!action) return;
    e.preventDefault();
    action();
  }
}
