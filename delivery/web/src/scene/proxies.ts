import type { Object3D } from 'three';
import { servingProxy } from '../decide/proxy_choice';
import { throwIfAborted } from '../format/errors';
import { readyToDraw } from './gpu';
import type { LoadContext } from './load_context';
import { disposeGeometries, disposeTexture, materialsOf, parseScale, texturesOf } from './scale_parts';

/** The proxy in the scene: the whole object in one small file, until a scale looks better. */
export class ShownProxy {
  /** In the scene; -1: none. */
  shown = -1;
  private object_?: Object3D;

  constructor(
    private readonly load_: LoadContext,
    private readonly scene_: Object3D,
  ) {}

  get materials() {
    return this.object_ ? materialsOf(this.object_) : [];
  }
  get objects(): Object3D[] {
    return this.object_ ? [this.object_] : [];
  }
  /** The bytes of a proxy. */
  fetch(proxy: number): Promise<Uint8Array> {
    const { reader, signal } = this.load_;
    return reader.proxyGlb(proxy, { signal });
  }
  /** Puts a proxy in place of the one before, in one turn of the page, once its bytes are there. */
  async show(proxy: number, bytes = this.fetch(proxy)): Promise<void> {
    const { load_: load, scene_: scene } = this;
    const { reader, options, object, signal } = load;
    const glb = await reader.decoded(signal, 'plainGlb', await bytes);
    const { scene: shape } = await parseScale(options.gltfLoader(), glb, false);
    try {
      await readyToDraw(load, scene, shape);
      throwIfAborted(signal);
    } catch (error) {
      free(shape);
      throw error;
    }
    object.clear().add(shape);
    if (!object.parent) scene.add(object);
    this.dispose();
    this.object_ = shape;
    this.shown = proxy;
    load.emit('proxy', { proxy, triangles: reader.manifest.proxies[proxy].triangles });
  }
  /** Frees the proxy, which is in the scene no more. */
  dispose(): void {
    if (this.object_) free(this.object_);
    this.object_ = undefined;
    this.shown = -1;
  }
}

function free(object: Object3D): void {
  disposeGeometries(object);
  for (const material of materialsOf(object)) {
    for (const [, texture] of texturesOf(material)) disposeTexture(texture);
    material.dispose();
  }
}

/** What is fetched on the way to scales. */
interface Way {
  /** The larger proxy that is shown meanwhile; -1: none. */
  step: number;
  bytes?: Promise<Uint8Array>;
  /** What scales need is there. */
  rest: Promise<unknown>;
}

/** Which proxy a load shows: the smallest first, one that is enough, or a larger one on the way to scales. */
export class ProxyChoice {
  private part_?: Promise<typeof import('./texture_load') | undefined>;
  private way_?: Promise<Way>;

  /** `fetchRest` fetches what scales need. */
  constructor(
    private readonly load_: LoadContext,
    private readonly proxy_: ShownProxy,
    private readonly fetchRest_: () => Promise<unknown>,
  ) {}

  /**
   * Shows the smallest one. What decides about larger ones is loaded meanwhile; and where nobody gives turns, the link goes on with what
   * comes next while the proxy is decoded.
   */
  async showFirst(): Promise<void> {
    const { load_: { reader: { manifest }, view: { display }, options: { turn } }, proxy_: proxy } = this;
    const bytes = proxy.fetch(0);
    const next = (): void => {
      if (servingProxy(manifest, display.heightPx) >= 0) return;
      this.part_ = import('./texture_load').catch(() => undefined); // said later
      if (!turn) this.way_ = this.goOn_();
    };
    await Promise.all([proxy.show(0, bytes), bytes.then(next, () => undefined)]);
  }
  /** Nothing is chosen by hand. */
  private get free_(): boolean {
    const { override: { scale, rung }, options: { rule = 'flip', fullSize } } = this.load_;
    return scale === undefined && rung === undefined && !fullSize && rule === 'flip';
  }
  /** The smallest proxy that cannot be told from S_0 in this view; -1: none, or scales and textures are chosen by hand. */
  serving(): number {
    const { view, reader } = this.load_;
    return this.free_ && this.proxy_.shown >= 0 ? servingProxy(reader.manifest, view.display.heightPx) : -1;
  }
  /** Shows a proxy that is enough. False where scales are needed. */
  async showServing(): Promise<boolean> {
    const serving = this.serving();
    try {
      if (serving > this.proxy_.shown) await this.proxy_.show(serving);
      return serving >= 0;
    } catch (error) {
      this.load_.fail(error, 'proxy');
      return false;
    }
  }
  /** Fetches what scales need; before that a larger proxy, where one pays on the way to scales. */
  private async goOn_(): Promise<Way> {
    const { load_: load, proxy_: proxy } = this;
    const part = this.free_ && load.options.policy !== 'thesis' ? await this.part_ : undefined;
    const step = part ? part.stepOf(load) : -1;
    const bytes = step > Math.max(proxy.shown, 0) ? proxy.fetch(step) : undefined;
    const rest = (bytes ?? Promise.resolve()).then(this.fetchRest_, this.fetchRest_);
    rest.catch(() => undefined); // whoever waits hears of it
    return { step, bytes, rest };
  }
  /** Shows the larger proxy that pays, if any; resolves when what scales need is there, too. */
  async showStep(): Promise<void> {
    const { load_: load, proxy_: proxy } = this;
    const { step, bytes, rest } = await (this.way_ ?? this.goOn_());
    const shown = bytes && proxy.show(step, bytes).catch((error: unknown) => load.fail(error, 'proxy')); // the smaller one stays
    await Promise.all([shown, rest]);
  }
}
