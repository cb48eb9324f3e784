import { idle } from './gpu';

/** Longer than this no frame is waited for, and none is kept back. */
const kMostFrameMs = 1500;
/** A load that ends later than this shows what it has. */
const kMostLateMs = 1000;

/** Decides when frames are drawn of what has come. */
export class Pace {
  /** Time of performance.now() at which all is to have come. */
  dueAt = Infinity;
  private frameMs = 0; // time of the last frame on the GPU
  private drawing = 0; // frames that are not on the screen yet
  private freeAt = 0; // since when the GPU has had no frame
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
    if (now + this.frameMs > this.dueAt && now < this.dueAt + kMostLateMs)
      return Math.max(8, this.dueAt - now);
    return this.freeAt + this.frameMs - now;
  }

  /** To be called when a frame has been asked of the GPU. */
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
