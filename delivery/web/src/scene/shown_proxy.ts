import type { Object3D } from 'three';
import { throwIfAborted } from '../format/errors';
import { readyToDraw } from './gpu';
import type { LoadContext } from './load_context';
import { disposeGeometries, disposeTexture, materialsOf, parseScale, texturesOf } from './scale_parts';

/** The proxy in the scene: the whole object in one small file, until a scale looks better. */
export class ShownProxy {
  /** In the scene; -1: none. */
  shown = -1;
  private object_?: Object3D;
  private coming_?: Object3D; // the GPU prepares for it

  constructor(
    private readonly load_: LoadContext,
    private readonly scene_: Object3D,
  ) {}

  get materials() {
    return this.object_ ? materialsOf(this.object_) : [];
  }
  get objects(): Object3D[] {
    return [this.object_, this.coming_].filter((object) => object !== undefined);
  }
  /** The bytes of a proxy. */
  fetch(proxy: number, signal = this.load_.signal): Promise<Uint8Array> {
    const { reader } = this.load_;
    return reader.proxyGlb(proxy, { signal });
  }
  /** Puts a proxy in place of the one before, in one turn of the page, once its bytes are there. */
  async show(proxy: number, bytes = this.fetch(proxy)): Promise<void> {
    const { load_: load, scene_: scene } = this;
    const { reader, options, object, signal } = load;
    const glb = await reader.decoded(signal, 'plainGlb', await bytes);
    const { scene: shape } = await parseScale(options.gltfLoader(), glb, false);
    this.coming_ = shape;
    try {
      await readyToDraw(load, scene, shape).finally(() => (this.coming_ = undefined));
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
