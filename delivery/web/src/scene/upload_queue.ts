import type { WebGLRenderer } from 'three';
import { sleepS } from '../http/requests';
import { gpuIdle } from './gpu';

/** Milliseconds and pixels of uploads between two turns of the page. */
const sliceMs = 4;
const slicePx = 1 << 19;
/** The GPU may be so many slices behind, and nobody waits for it longer than longestFenceS. */
const mostBehind = 3;
const longestFenceS = 0.25;
/** The smallest mip levels follow this often while fragments come. */
const mipsEveryMs = 200;

/** Uploads that wait for their turn: a few between two turns of the page; the GPU must keep up. */
export class UploadQueue {
  /** Uploads that still wait are left out from now on. */
  disposed = false;
  private readonly uploads_: { pixels: number; run(): void; ended(): void }[] = [];
  private uploading_ = false;
  private mipsAt_ = 0;
  private pixels_ = 0; // since the last of the fences that the GPU may not have passed
  private readonly fences_: Promise<void>[] = [];

  /** `updateMips` makes the smallest levels of all textures. */
  constructor(
    private readonly renderer_: WebGLRenderer,
    private readonly updateMips_: () => void,
  ) {}

  /** Puts off `run`, which uploads so many pixels; resolves when `run` has ended, or was left out. */
  enqueue(pixels: number, run: () => void): Promise<void> {
    return new Promise((ended) => {
      this.uploads_.push({ pixels, run, ended });
      if (!this.uploading_) void this.uploadWaiting_();
    });
  }
  /** Makes the smallest levels now. */
  finishMips(): void {
    this.mipsAt_ = performance.now();
    if (!this.disposed) this.updateMips_();
  }

  private async uploadWaiting_(): Promise<void> {
    this.uploading_ = true;
    for (await sleepS(0); this.uploads_.length > 0; await sleepS(0)) {
      const start = performance.now();
      while (this.uploads_.length > 0 && this.pixels_ < slicePx && performance.now() - start < sliceMs) {
        const upload = this.uploads_.shift()!;
        this.pixels_ += upload.pixels;
        if (!this.disposed) upload.run();
        upload.ended();
      }
      if (start - this.mipsAt_ > mipsEveryMs || this.uploads_.length === 0) this.finishMips();
      if (this.pixels_ < slicePx) continue;
      this.pixels_ = 0;
      this.fences_.push(gpuIdle(this.renderer_, longestFenceS));
      if (this.fences_.length > mostBehind) await this.fences_.shift();
    }
    this.uploading_ = false;
  }
}
