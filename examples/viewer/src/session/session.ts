import { open, proxyLoss, shownFlip } from 'texmesh';
import type { LoadedModel, TexmeshPackage } from 'texmesh';
import type { Choices } from '../choices';
import type { Live } from '../live';
import type { Stage } from '../stage/stage';
import { Listener } from './listener';
import { chosenDetail, stageOptions } from './load_options';
import { Original } from './original';

/** One package on the stage: opens and loads it as chosen. `live` is what the panel shows of the load. */
export class Session {
  /** Something in `live` has changed. */
  onChange: () => void = () => {};
  onError: (error: unknown) => void = () => {};

  private pkg: TexmeshPackage | null = null;
  private model: LoadedModel | null = null;
  // These three are of one load. A load whose signal is aborted has been overtaken by a newer one and says
  // nothing any more.
  private abort = new AbortController();
  private listener: Listener;
  private originalLoad: Original;

  constructor(private readonly stage: Stage, private readonly url: string) {
    this.listener = this.newListener();
    this.originalLoad = this.newOriginal();
    stage.onFrame = () => {
      this.model?.update(stage.camera);
      this.original?.model.update(stage.camera);
      if (this.model) this.listener.look(this.model);
    };
  }

  get live(): Live {
    return this.listener.live;
  }

  /** Opens the package anew and loads it: what a first visitor would see. */
  async start(choices: Choices): Promise<void> {
    const first = this.live.manifest === null;
    this.stop();
    const { signal } = this.abort;
    this.live.startedAt = performance.now();
    this.live.limitS = choices.timeS;
    this.stage.dueAt = this.live.startedAt + 1000 * choices.timeS;
    this.stage.draw(); // what was shown is gone
    this.listener.changed('opening');
    try {
      const pkg = await this.open(choices, signal);
      if (signal.aborted) return pkg.dispose();
      this.pkg = pkg;
      if (first) this.stage.frame(pkg.manifest.boundsMin, pkg.manifest.boundsMax);
      this.listener.hearPackage(pkg);
      const model = this.load(pkg, choices);
      // `done` says what is wrong with the load
      void model.firstPicture.then(() => this.readAbout(pkg, signal)).catch(() => {});
      await model.done;
      if (signal.aborted) return;
      await this.readTables(pkg, signal);
      await this.predict(pkg, model, signal);
    } catch (error) {
      if (!signal.aborted) this.failed(error);
    }
  }

  /** Scale and rung of what is shown, without loading anew. */
  override(choices: Choices): void {
    this.model?.setOverride(chosenDetail(this.live.manifest, choices));
    this.stage.draw();
  }

  async refine(): Promise<void> {
    if (!this.model) return;
    try {
      this.listener.changed('refining');
      await this.model.refine();
    } catch (error) {
      this.failed(error);
    }
  }

  /** Loads the original into the stage's second scene, once for each load. May reject. */
  showOriginal(loading: (is: boolean) => void): Promise<void> {
    return this.originalLoad.show(loading);
  }

  /** Ends the load: nothing is shown or heard of it any more. */
  stop(): void {
    this.abort.abort();
    this.model?.dispose();
    this.pkg?.dispose();
    this.originalLoad.dispose();
    this.model = this.pkg = null;
    this.abort = new AbortController();
    this.listener = this.newListener();
    this.originalLoad = this.newOriginal();
  }

  /** Says what went wrong beside what is shown. */
  problem(error: unknown): void {
    this.listener.addProblem(error);
  }

  /** For tests and the console. */
  get inner(): { pkg: TexmeshPackage | null; model: LoadedModel | null } {
    return { pkg: this.pkg, model: this.model };
  }

  /** For tests and the console; null: not loaded. */
  get original(): Original['loaded'] {
    return this.originalLoad.loaded;
  }

  private newListener(): Listener {
    return new Listener(this.stage, this.abort.signal, () => this.onChange());
  }

  private newOriginal(): Original {
    return new Original(this.url, this.stage, this.abort.signal, (error) => this.onError(error));
  }

  private async open(choices: Choices, signal: AbortSignal): Promise<TexmeshPackage> {
    const cap = Number.isFinite(choices.capBytesPerSecond) ? choices.capBytesPerSecond : 0;
    const opening = open(this.url, { signal, capBytesS: cap });
    await Promise.all([opening, this.stage.begin()]); // the package's head comes while the renderer is made
    return opening;
  }

  private load(pkg: TexmeshPackage, choices: Choices): LoadedModel {
    const { signal } = this.abort;
    const model = pkg.load(this.stage.current, {
      ...stageOptions(this.stage, signal), ...chosenDetail(pkg.manifest, choices), time: choices.timeS,
      policy: choices.policy, meshes: 'auto',
    });
    this.model = model;
    this.listener.hearModel(model, {
      tables: (plane) => void this.readTables(pkg, signal, [plane]),
      prediction: () => void this.predict(pkg, model, signal).catch(() => {}),
    });
    return model;
  }

  /**
   * The panel's tables: of a plane as soon as it is shown, of all planes when the load's time is over.
   * Nothing is fetched twice.
   */
  private async readTables(pkg: TexmeshPackage, signal: AbortSignal, planes?: number[]): Promise<void> {
    try {
      const [textures, tables] = [await pkg.textures(signal), await pkg.tables(planes, signal)];
      if (signal.aborted) return;
      this.live.textures = textures;
      this.live.tables = tables;
      this.listener.changed();
    } catch (error) {
      if (!signal.aborted) this.problem(error);
    }
  }

  /** Whose the object is. */
  private async readAbout(pkg: TexmeshPackage, signal: AbortSignal): Promise<void> {
    try {
      const about = await pkg.about(signal);
      if (signal.aborted) return;
      this.live.about = about;
      this.listener.changed();
    } catch (error) {
      if (!signal.aborted) this.problem(error);
    }
  }

  /** What the package's measured table says of the picture that stands now. */
  private async predict(pkg: TexmeshPackage, model: LoadedModel, signal: AbortSignal): Promise<void> {
    const { planes, scale, proxy, displayedPx } = model.state;
    if (proxy >= 0) {
      this.live.predictedFlip = proxyLoss(pkg.manifest, proxy, displayedPx).flip;
      return this.listener.changed();
    }
    const data = await pkg.data(planes.flatMap((p) => [p.base, p.plane]));
    if (signal.aborted) return;
    this.live.predictedFlip = shownFlip(data, displayedPx, scale, planes);
    this.listener.changed();
  }

  private failed(error: unknown): void {
    this.stage.dueAt = Infinity;
    this.listener.changed('failed');
    this.onError(error);
  }
}
