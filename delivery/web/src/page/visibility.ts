import type { Place } from './schedule';

/** Models are prepared when they are so far from the screen, as a share of its height, and released when they are further. */
const nearShare = 1;

/** Follows where canvases lie on the page and how large they are. */
export class Visibility {
  private readonly seen_: IntersectionObserver;
  private readonly near_: IntersectionObserver;
  private readonly sized_: ResizeObserver;
  private readonly nearby_ = new Set<Element>();
  private readonly places_ = new Map<Element, Place>();

  /** `changed` hears of a canvas that has come, gone, or has another size: `resized` then. */
  constructor(private readonly changed_: (canvas: Element, resized: boolean) => void) {
    this.seen_ = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting, boundingClientRect, rootBounds } of entries) {
        const place = this.places_.get(target);
        if (!place) continue;
        place.visible = isIntersecting && boundingClientRect.width * boundingClientRect.height > 0;
        const { top, left, width, height } = boundingClientRect;
        const [x, y] = [(rootBounds?.width ?? 0) / 2, (rootBounds?.height ?? 0) / 2];
        place.distancePx = Math.hypot(left + width / 2 - x, top + height / 2 - y);
        this.changed_(target, false);
      }
    }, { threshold: [0, 0.01, 0.5, 1] });
    this.near_ = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting } of entries) {
        if (isIntersecting) this.nearby_.add(target);
        else this.nearby_.delete(target);
        this.changed_(target, false);
      }
    }, { rootMargin: `${100 * nearShare}% 0%` });
    this.sized_ = new ResizeObserver((entries) => {
      for (const { target } of entries) this.fit_(target as HTMLCanvasElement);
    });
  }
  /** Follows a canvas; its place is kept up to date. */
  follow(canvas: HTMLCanvasElement, place: Place): void {
    this.places_.set(canvas, place);
    this.fit_(canvas);
    for (const observer of [this.seen_, this.near_, this.sized_]) observer.observe(canvas);
  }
  forget(canvas: Element): void {
    for (const observer of [this.seen_, this.near_, this.sized_]) observer.unobserve(canvas);
    this.places_.delete(canvas);
    this.nearby_.delete(canvas);
  }
  /** Whether a canvas is on the screen or close to it. */
  isNear(canvas: Element): boolean {
    return this.nearby_.has(canvas);
  }
  dispose(): void {
    for (const observer of [this.seen_, this.near_, this.sized_]) observer.disconnect();
    this.places_.clear();
    this.nearby_.clear();
  }

  /** As many pixels as the device shows of the canvas. */
  private fit_(canvas: HTMLCanvasElement): void {
    const ratio = globalThis.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((px) => Math.round(px * ratio));
    const place = this.places_.get(canvas);
    if (!place) return;
    place.areaPx = width * height;
    if (width < 1 || height < 1 || (canvas.width === width && canvas.height === height)) return;
    canvas.width = width;
    canvas.height = height;
    this.changed_(canvas, true);
  }
}
