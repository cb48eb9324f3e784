import { servingProxy } from '../../decide/proxy_choice';
import type { LoadContext } from '../load_context';
import type { ShownProxy } from './shown_proxy';

/** Which proxy a load shows: the smallest first, one that is enough, or a larger one on the way to scales. */
export class ProxyChoice {
  private part_?: Promise<typeof import('../texture_load') | undefined>;

  constructor(
    private readonly load_: LoadContext,
    private readonly proxy_: ShownProxy,
  ) {}

  /** Shows the smallest one; what decides about larger ones is loaded meanwhile. */
  showFirst(): Promise<void> {
    const { reader: { manifest }, view: { display } } = this.load_;
    return this.proxy_.show(0, () => {
      if (servingProxy(manifest, display.heightPx) < 0) this.part_ = import('../texture_load').catch(() => undefined); // said later
    });
  }
  /** Proxies are candidates: one is in the scene, and nothing is chosen by hand. */
  private get asked_(): boolean {
    const { override: { scale, rung }, options: { rule = 'flip', fullSize } } = this.load_;
    return scale === undefined && rung === undefined && !fullSize && rule === 'flip' && this.proxy_.shown >= 0;
  }
  /** The smallest proxy that cannot be told from S_0 in this view; -1: none, or scales and textures are chosen by hand. */
  serving(): number {
    const { view, reader } = this.load_;
    return this.asked_ ? servingProxy(reader.manifest, view.display.heightPx) : -1;
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
  /** Where a larger proxy pays on the way to scales: shows the proxy, and does the rest once the proxy's bytes are there. */
  async showStep(rest: () => Promise<unknown>): Promise<void> {
    const { load_: load, proxy_: proxy } = this;
    const part = this.asked_ && load.options.policy !== 'thesis' ? await this.part_ : undefined;
    const step = part ? part.stepOf(load) : -1;
    if (step <= proxy.shown) return void (await rest());
    let arrive = (): void => undefined;
    const arrived = new Promise<void>((done) => (arrive = done));
    const shown = proxy.show(step, arrive).catch((error: unknown) => load.fail(error, 'proxy')); // the smaller one stays
    await Promise.race([arrived, shown]);
    await Promise.all([shown, rest()]);
  }
}
