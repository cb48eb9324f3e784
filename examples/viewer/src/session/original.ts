import { open } from 'texmesh';
import type { LoadedModel, TexmeshPackage } from 'texmesh';
import type { Stage } from '../stage/stage';
import { stageOptions } from './load_options';

/** The original, in the stage's second scene: S_0 with the highest rungs of full-size textures. */
export class Original {
  /** Null before `show`. */
  loaded: { pkg: TexmeshPackage; model: LoadedModel } | null = null;
  private opening = false;

  /** After `signal` nothing is loaded and no error is told. */
  constructor(
    private readonly url: string,
    private readonly stage: Stage,
    private readonly signal: AbortSignal,
    private readonly onError: (error: unknown) => void,
  ) {}

  /** Loads the original once. Rejects when the package cannot be opened. */
  async show(loading: (is: boolean) => void): Promise<void> {
    if (this.loaded || this.opening) return;
    loading(true);
    const pkg = await this.open();
    if (!pkg) return;
    await this.stage.begin();
    if (this.signal.aborted) return pkg.dispose();
    const model = pkg.load(this.stage.original, {
      ...stageOptions(this.stage, this.signal), time: Infinity, scale: 0, rung: 99, fullSize: true,
      autoRefine: false,
    });
    this.loaded = { pkg, model };
    for (const name of ['first-picture', 'proxy', 'scale', 'fragment', 'done'] as const)
      model.on(name, () => this.stage.show());
    try {
      await model.done;
    } catch (error) {
      if (!this.signal.aborted) this.onError(error);
    }
    if (!this.signal.aborted) loading(false);
  }

  dispose(): void {
    this.loaded?.model.dispose();
    this.loaded?.pkg.dispose();
    this.loaded = null;
  }

  /** Null: aborted. */
  private async open(): Promise<TexmeshPackage | null> {
    this.opening = true;
    try {
      return await open(this.url, { signal: this.signal });
    } catch (error) {
      if (!this.signal.aborted) throw error;
      return null;
    } finally {
      this.opening = false;
    }
  }
}
