import type { WebGLRenderer } from 'three';
import { nowS, sleepS } from '../../http/clock';
import { gpuIdle } from '../gpu';

/** Somebody who draws with a renderer. */
export interface GpuUser {
  /** Bytes that the user has on the GPU. */
  gpuBytes(): number;
  /** The GPU has refused something: all that the user has is to be made anew, within the new limit. */
  refused?(): void;
}
/** A context that holds less was lost for another reason: sleep, a driver's update, another graphics card. */
const leastAtLoss = 32e6;
/** Where less is refused, too, nothing helps. */
const leastLimit = 1e6;
/** Shares of what was on the GPU that may be there from then on. */
const shareAfter = { lost: 0.5, refused: 0.75 };
/** New shapes go to the GPU with the next frame: the GPU is asked so much later. */
const askAfterS = 0.25;
const mostIdleS = 1;
/**
 * A question holds the page up until the GPU has done all that stands before it: half a second to one and a half were measured where the
 * processor draws. A GPU that does nothing says so soon. One that never rests is asked at last.
 */
const soonS = 0.03;
const mostBusyS = 10;
/** WebGL keeps one flag for each kind of error. */
const errorKinds = 8;

/**
 * What the GPU of a renderer has shown to hold: a context that is lost with much in it, and storage that is refused, lower the limit for
 * all who draw with the renderer.
 */
export class GpuRoom {
  /** Most bytes that all users together may have; Infinity: nothing has been refused. */
  limitBytes = Infinity;
  private readonly users_ = new Set<GpuUser>();
  private asking_ = false;

  private constructor(private readonly renderer_: WebGLRenderer) {
    // Before the users' own listeners: who comes back after a loss asks for the new limit.
    renderer_.domElement?.addEventListener('webglcontextlost', () => {
      const used = this.usedBytes_();
      if (used >= leastAtLoss) this.lower_(shareAfter.lost * used);
    });
  }
  /** The room of a renderer's GPU: one for all loads. */
  static of(renderer: WebGLRenderer): GpuRoom {
    const room = rooms.get(renderer) ?? new GpuRoom(renderer);
    rooms.set(renderer, room);
    return room;
  }

  /** Counts a user; gives a function that ends this. */
  add(user: GpuUser): () => void {
    this.users_.add(user);
    return () => void this.users_.delete(user);
  }
  /** To be called when something new goes to the GPU: asks the GPU, a little later, whether it has taken all. */
  async ask(): Promise<void> {
    if (this.asking_) return;
    this.asking_ = true;
    await sleepS(askAfterS);
    await this.rest_();
    this.asking_ = false;
    if (this.users_.size === 0 || this.limitBytes <= leastLimit || !this.hasRefused_()) return;
    this.lower_(shareAfter.refused * this.usedBytes_());
    for (const user of [...this.users_]) user.refused?.();
  }

  /** Resolves when the GPU has nothing to do. */
  private async rest_(): Promise<void> {
    for (const end = nowS() + mostBusyS; ; ) {
      const start = nowS();
      await gpuIdle(this.renderer_, mostIdleS);
      if (nowS() < start + soonS || nowS() > end) return;
    }
  }
  private usedBytes_(): number {
    return [...this.users_].reduce((sum, user) => sum + user.gpuBytes(), 0);
  }
  private lower_(bytes: number): void {
    this.limitBytes = Math.max(leastLimit, Math.min(this.limitBytes * shareAfter.refused, bytes));
  }
  private hasRefused_(): boolean {
    const gl = this.renderer_.getContext();
    let refused = false;
    for (let k = 0; k < errorKinds; ++k) {
      const error = gl.getError();
      if (error === gl.NO_ERROR) break; // each question waits for the GPU's process
      refused ||= error === gl.OUT_OF_MEMORY;
    }
    return refused;
  }
}
const rooms = new WeakMap<WebGLRenderer, GpuRoom>();
