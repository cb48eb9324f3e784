import type { PagePlace } from './schedule';

/** Models are prepared so far from the screen (by its height), and released when they are further. */
const nearShare = 1;

/** From the middle of a box to the middle of a screen. */
const distance = ({ top, left, width, height }: DOMRectReadOnly, screenWidth: number,
  screenHeight: number): number =>
  Math.hypot(left + width / 2 - screenWidth / 2, top + height / 2 - screenHeight / 2);

/** Follows where canvases lie on the page and how large they are. */
export class Visibility {
  private readonly seen_: IntersectionObserver;
  private readonly near_: IntersectionObserver;
  private readonly sized_: ResizeObserver;
  private readonly nearby_ = new Set<Element>();
  private readonly lookedAt_ = new Set<Element>(); // whether they are seen is known
  private readonly places_ = new Map<Element, PagePlace>();
  private readonly ended_ = new AbortController();

  /** `changed` hears of a canvas that has come, gone, or has another size: `resized` then. */
  constructor(private readonly changed_: (canvas: Element, resized: boolean) => void) {
    this.seen_ = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting, boundingClientRect, rootBounds } of entries) {
        const place = this.places_.get(target);
        if (!place) continue;
        this.lookedAt_.add(target);
        place.visible = isIntersecting && boundingClientRect.width * boundingClientRect.height > 0;
        place.distancePx = distance(boundingClientRect, rootBounds?.width ?? 0, rootBounds?.height ?? 0);
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
    this.sized_ =
      new ResizeObserver((entries) => this.fit_(entries.map(({ target }) => target as HTMLCanvasElement)));
    this.followRatio_();
  }
  /** Zooming, or another screen, changes the pixels of a canvas whose size stays. */
  private followRatio_(): void {
    globalThis.matchMedia?.(`(resolution: ${devicePixelRatio}dppx)`).addEventListener('change', () => {
      this.fit_([...this.places_.keys()] as HTMLCanvasElement[]);
      this.followRatio_();
    }, { once: true, signal: this.ended_.signal });
  }
  /** Follows a canvas; its place is kept up to date. */
  follow(canvas: HTMLCanvasElement, place: PagePlace): void {
    this.places_.set(canvas, place);
    for (const observer of [this.seen_, this.near_, this.sized_]) observer.observe(canvas);
  }
  /** Looks where new canvases lie: the observers speak up with the next frame only, which is late. */
  glance(): void {
    for (const [canvas, place] of this.places_) {
      if (this.lookedAt_.has(canvas)) continue;
      const rect = canvas.getBoundingClientRect();
      const { innerWidth, innerHeight, devicePixelRatio: ratio = 1 } = globalThis;
      place.areaPx = Math.round(rect.width * ratio) * Math.round(rect.height * ratio);
      place.visible = place.areaPx > 0 && rect.bottom > 0 && rect.right > 0 && rect.top < innerHeight &&
        rect.left < innerWidth;
      place.distancePx = distance(rect, innerWidth, innerHeight);
    }
  }
  forget(canvas: Element): void {
    for (const observer of [this.seen_, this.near_, this.sized_]) observer.unobserve(canvas);
    this.places_.delete(canvas);
    this.nearby_.delete(canvas);
    this.lookedAt_.delete(canvas);
  }
  /** Whether a canvas is on the screen or close to it; not before it is known which of the two. */
  isNear(canvas: Element): boolean {
    return this.nearby_.has(canvas) && this.lookedAt_.has(canvas);
  }
  dispose(): void {
    this.ended_.abort();
    for (const observer of [this.seen_, this.near_, this.sized_]) observer.disconnect();
    this.places_.clear();
    this.nearby_.clear();
    this.lookedAt_.clear();
  }

  /**
   * As many pixels as the device shows of the canvases. A size that is read behind one that is written makes
   * the browser lay out all anew.
   */
  private fit_(canvases: readonly HTMLCanvasElement[]): void {
    const ratio = globalThis.devicePixelRatio || 1;
    const sizes =
      canvases.map((canvas) => [canvas.clientWidth, canvas.clientHeight].map((px) => Math.round(px * ratio)));
    canvases.forEach((canvas, i) => {
      const [width, height] = sizes[i];
      const place = this.places_.get(canvas);
      if (!place) return;
      if (!place.areaPx) { // the share that is seen stays as it was, of which alone the observer speaks
        this.seen_.unobserve(canvas);
        this.seen_.observe(canvas);
      }
      place.areaPx = width * height;
      if (width < 1 || height < 1 || (canvas.width === width && canvas.height === height)) return;
      canvas.width = width;
      canvas.height = height;
      this.changed_(canvas, true);
    });
  }
}
