import type { WebGLRenderer } from 'three';
import { TexmeshPage, type PageOptions } from '../../src/page';
import { fakeGltf, fakeRenderer } from './loading';

// A page without a browser: canvases that lie where a test says, frames that come at once.

/** A canvas `top` screens below the top of the screen. */
export interface FakeCanvas {
  width: number;
  height: number;
  clientWidth: number;
  clientHeight: number;
  top: number;
  pictures: number;
}
const screen = { width: 1000, height: 1000 };

function rectOf({ clientWidth: width, clientHeight: height, top }: Omit<FakeCanvas, 'pictures'>): object {
  const y = top * screen.height;
  return { top: y, left: 0, width, height, right: width, bottom: y + height };
}

interface Observer {
  targets: Set<FakeCanvas>;
  look(): void;
}
const observers = new Set<Observer>();

class FakeIntersectionObserver implements Observer {
  readonly targets = new Set<FakeCanvas>();
  private readonly margin_: number;
  constructor(private readonly heard_: (entries: unknown[]) => void, options: { rootMargin?: string } = {}) {
    this.margin_ = parseFloat(options.rootMargin ?? '0') / 100;
    observers.add(this);
  }
  observe(target: FakeCanvas): void {
    this.targets.add(target);
    queueMicrotask(() => this.targets.has(target) && this.heard_([this.entry_(target)]));
  }
  unobserve(target: FakeCanvas): void {
    this.targets.delete(target);
  }
  disconnect(): void {
    this.targets.clear();
    observers.delete(this);
  }
  look(): void {
    if (this.targets.size > 0) this.heard_([...this.targets].map((t) => this.entry_(t)));
  }
  private entry_(target: FakeCanvas): object {
    const { top } = target;
    const isIntersecting = top >= -this.margin_ && top < 1 + this.margin_;
    return { target, isIntersecting, rootBounds: screen, boundingClientRect: rectOf(target) };
  }
}
class FakeResizeObserver implements Observer {
  readonly targets = new Set<FakeCanvas>();
  constructor(private readonly heard_: (entries: unknown[]) => void) {
    observers.add(this);
  }
  observe(target: FakeCanvas): void {
    this.targets.add(target);
    queueMicrotask(() => this.targets.has(target) && this.heard_([{ target }]));
  }
  unobserve(target: FakeCanvas): void {
    this.targets.delete(target);
  }
  disconnect(): void {
    observers.delete(this);
  }
  look(): void {
    if (this.targets.size > 0) this.heard_([...this.targets].map((target) => ({ target })));
  }
}

export interface FakePage {
  page: TexmeshPage;
  canvas(top?: number, px?: number): HTMLCanvasElement;
  /** Canvases have other places or sizes now. */
  scrolled(): void;
  /** Targets that are observed now. */
  observed(): number;
}
/** Runs `body` with a page; the browser's classes are as before afterwards. */
export async function withPage(options: Partial<PageOptions>,
    body: (page: FakePage) => Promise<void>): Promise<void> {
  const fakes: Record<string, unknown> = {
    IntersectionObserver: FakeIntersectionObserver, ResizeObserver: FakeResizeObserver,
    innerWidth: screen.width, innerHeight: screen.height,
    requestAnimationFrame: (draw: () => void) => setTimeout(draw, 0), cancelAnimationFrame: clearTimeout,
  };
  const before =
    Object.keys(fakes).map((name) => [name, Object.getOwnPropertyDescriptor(globalThis, name)] as const);
  for (const [name, value] of Object.entries(fakes))
    Object.defineProperty(globalThis, name, { value, configurable: true, writable: true });
  const renderer = Object.assign(fakeRenderer([]), {
    domElement: { height: 1000, addEventListener: () => undefined }, setViewport: () => undefined,
    setScissor: () => undefined, setScissorTest: () => undefined, render: () => undefined,
    setDrawingBufferSize: () => undefined,
  });
  const gltfLoader = () => ({ register: () => undefined, parseAsync: () => Promise.resolve(fakeGltf()) });
  const page = new TexmeshPage({ gltfLoader, renderer: renderer as unknown as WebGLRenderer, ...options });
  const canvas = (top = 0, px = 100): HTMLCanvasElement => {
    const made = { width: 1, height: 1, clientWidth: px, clientHeight: px, top, pictures: 0,
      getBoundingClientRect: () => rectOf(made), getContext: () => ({ drawImage: () => ++made.pictures }) };
    return made as unknown as HTMLCanvasElement;
  };
  try {
    await body({ page, canvas, scrolled: () => observers.forEach((o) => o.look()),
      observed: () => [...observers].reduce((n, o) => n + o.targets.size, 0) });
  } finally {
    page.dispose();
    observers.clear();
    for (const [name, descriptor] of before)
      if (descriptor) Object.defineProperty(globalThis, name, descriptor);
      else Reflect.deleteProperty(globalThis, name);
  }
}
