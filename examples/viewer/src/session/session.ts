import { equivalentQuality, open, predictedSsim, surfaceWeights } from 'texmesh';
import type { Object3D } from 'three';
import type { DecisionEvent, LoadedModel, LoadOptions, TexmeshPackage } from 'texmesh';
import { gltfLoader } from './decoders';
import { isMetallic } from '../stage/light';
import { emptyLive } from '../live';
import type { Live } from '../live';
import type { Choices } from '../choices';
import type { Stage } from '../stage/stage';

/** One package on the stage: opens it, loads it as chosen, and keeps in `live` what the panel shows. */
export class Session {
  live: Live = emptyLive();
  /** Something in `live` has changed. */
  onChange: () => void = () => {};
  onError: (error: unknown) => void = () => {};

  private pkg: TexmeshPackage | null = null;
  private model: LoadedModel | null = null;
  private original: { pkg: TexmeshPackage; model: LoadedModel } | null = null;
  private abort = new AbortController();
  /** Loads that were overtaken by a newer one say nothing any more. */
  private turn = 0;
  private openingOriginal = -1; // turn of the original that is being opened

  constructor(
    private readonly stage: Stage,
    private readonly url: string,
  ) {
    stage.onFrame = () => {
      this.model?.update(stage.camera);
      this.original?.model.update(stage.camera);
      this.look();
    };
  }

  /** Opens the package anew and loads it: what a first visitor would see. */
  async start(choices: Choices): Promise<void> {
    this.stop();
    const turn = ++this.turn;
    const first = this.live.manifest === null;
    this.live = { ...emptyLive(), startedAt: performance.now(), limitS: choices.timeS };
    this.stage.dueAt = this.live.startedAt + 1000 * choices.timeS;
    this.stage.draw(); // what was shown is gone
    this.changed('opening');
    try {
      const cap = Number.isFinite(choices.capBytesPerSecond) ? choices.capBytesPerSecond : 0;
      const opening = open(this.url, { signal: this.abort.signal, capBytesS: cap });
      await Promise.all([opening, this.stage.begin()]); // the package's head comes meanwhile
      const pkg = await opening;
      if (turn !== this.turn) return pkg.dispose();
      this.pkg = pkg;
      this.opened(pkg, first, turn);
      const model = pkg.load(this.stage.current, this.options(choices));
      this.model = model;
      this.listen(model, turn);
      await model.done;
      if (turn !== this.turn) return;
      await this.readTables(pkg, turn);
      await this.predict(pkg, model, turn);
    } catch (error) {
      if (turn === this.turn && !this.abort.signal.aborted) this.failed(error);
    }
  }

  /** Scale and rung of what is shown, without loading anew. */
  override(choices: Choices): void {
    this.model?.setOverride({ scale: this.scaleThatIs(choices.scale), rung: choices.rung ?? undefined });
    this.stage.draw();
  }

  async refine(): Promise<void> {
    if (!this.model) return;
    try {
      this.changed('refining');
      await this.model.refine();
    } catch (error) {
      this.failed(error);
    }
  }

  /** S_0 with the highest rungs of full-size textures, into the second scene, once for each load. Rejects where it cannot be opened. */
  async showOriginal(loading: (is: boolean) => void): Promise<void> {
    const { turn } = this;
    if (this.original || this.openingOriginal === turn) return;
    this.openingOriginal = turn;
    loading(true);
    const { signal } = this.abort;
    let pkg: TexmeshPackage;
    try {
      pkg = await open(this.url, { signal });
    } catch (error) {
      if (turn === this.turn && !signal.aborted) throw error;
      return;
    } finally {
      if (this.openingOriginal === turn) this.openingOriginal = -1;
    }
    await this.stage.begin();
    if (turn !== this.turn) return pkg.dispose();
    const model = pkg.load(this.stage.original, {
      ...this.common(), time: Infinity, scale: 0, rung: 99, fullSize: true, autoRefine: false,
    });
    this.original = { pkg, model };
    const show = (): void => this.stage.show();
    for (const name of ['first-picture', 'scale', 'fragment', 'done'] as const) model.on(name, show);
    try {
      await model.done;
    } catch (error) {
      if (turn === this.turn && !signal.aborted) this.onError(error);
    }
    if (turn === this.turn) loading(false);
  }

  stop(): void {
    this.abort.abort();
    this.abort = new AbortController();
    this.model?.dispose();
    this.pkg?.dispose();
    this.original?.model.dispose();
    this.original?.pkg.dispose();
    this.model = this.pkg = this.original = null;
  }

  /** For tests and the console. */
  get inner(): { pkg: TexmeshPackage | null; model: LoadedModel | null } {
    return { pkg: this.pkg, model: this.model };
  }

  private common(): Pick<LoadOptions, 'renderer' | 'gltfLoader' | 'camera' | 'signal'> {
    // Seen before its programs are made, which depend on it.
    const read = ({ scene }: { scene: Object3D }): void => { if (isMetallic(scene)) this.stage.reflect(); };
    return { renderer: this.stage.renderer, gltfLoader: () => gltfLoader(read), camera: this.stage.camera, signal: this.abort.signal };
  }

  private options(c: Choices): LoadOptions {
    return {
      ...this.common(), time: c.timeS, policy: c.policy, meshes: 'auto',
      scale: this.scaleThatIs(c.scale), rung: c.rung ?? undefined,
    };
  }

  /** The package's scale nearest to a number, which may come from an address written for another package. */
  private scaleThatIs(wanted: number | null): number | undefined {
    const scales = this.live.manifest?.scales.map((s) => s.scale) ?? [];
    if (wanted === null || scales.length === 0) return undefined;
    return scales.reduce((best, s) => (Math.abs(s - wanted) < Math.abs(best - wanted) ? s : best));
  }

  private opened(pkg: TexmeshPackage, first: boolean, turn: number): void {
    const m = pkg.manifest;
    this.live.manifest = m;
    this.live.title = m.title;
    this.live.packageBytes = m.provenance.offset + m.provenance.bytes;
    if (first) this.stage.frame(m.boundsMin, m.boundsMax);
    for (const record of pkg.requests) this.transfer(record);
    pkg.onRequest((record) => {
      if (turn !== this.turn) return; // what was cancelled for this load is not of it
      this.transfer(record);
      this.changed();
    });
    this.changed('first-picture');
  }

  private transfer(r: { kind: string; received: number; started: number; ended: number }): void {
    const start = this.live.startedAt / 1000;
    this.live.transfers.push({ kind: r.kind, bytes: r.received, start: r.started - start, end: r.ended - start });
    this.live.bytes += r.received;
    this.live.requests++;
  }

  /** The panel's tables: of the planes that are shown as soon as the load has read them, of all when its time is over. Nothing is read twice. */
  private async readTables(pkg: TexmeshPackage, turn: number, planes?: number[]): Promise<void> {
    const { signal } = this.abort;
    try {
      const [textures, tables] = [await pkg.textures(signal), await pkg.tables(planes, signal)];
      if (turn !== this.turn) return;
      this.live.textures = textures;
      this.live.tables = tables;
      this.changed();
    } catch (error) {
      if (turn === this.turn && !signal.aborted) this.problem(error);
    }
  }

  private listen(model: LoadedModel, turn: number): void {
    const l = this.live;
    const since = (at: number): number => (at - l.startedAt) / 1000;
    let origin = NaN; // of the plan's own clock
    const on: LoadedModel['on'] = (name, f) => model.on(name, (e) => {
      if (turn !== this.turn) return;
      f(e);
      this.look();
      this.changed();
    });
    on('first-picture', (e) => {
      l.firstPictureS = since(e.at);
      l.scale = e.scale;
      this.stage.draw();
    });
    on('scale', (e) => {
      l.scale = e.scale;
      this.stage.show();
    });
    on('plane', (e) => {
      l.shownPlane.set(e.base, e.plane);
      if (this.pkg) void this.readTables(this.pkg, turn, [e.plane]);
      this.stage.show();
    });
    on('fragment', (e) => {
      this.rungsOf(model, e.plane);
      this.stage.show();
    });
    on('decision', (e) => {
      if (Number.isNaN(origin)) origin = since(e.at) - e.issued;
      this.decision(e, origin);
    });
    on('progress', (e) => {
      l.phase = e.phase;
      l.expected = e.bytesExpected;
    });
    on('deadline', (e) => {
      l.doneS = e.actual;
      l.limitS = e.limit;
      this.stage.dueAt = Infinity;
      this.stage.draw();
    });
    on('done', () => {
      l.phase = 'done';
      this.stage.draw();
      if (this.pkg) void this.predict(this.pkg, model, turn).catch(() => {}); // refining has made it better
    });
    // The library makes anew what the GPU has lost; until then there is nothing to be seen.
    on('context', (e) => {
      if (e.lost) this.problem(new Error('The graphics context was lost; waiting for it to come back'));
      else this.solved();
      this.stage.draw();
    });
    on('error', (e) => { if (!e.fatal) this.problem(e.error); }); // a fatal one rejects `done`
  }

  /** The displayed height that decides about scale and planes. */
  private look(): void {
    const px = this.model?.state.displayedPx ?? 0;
    if (px === this.live.displayedPx) return;
    this.live.displayedPx = px;
    this.changed();
  }

  private decision(e: DecisionEvent, origin: number): void {
    const l = this.live;
    if (e.skipped) {
      let set = l.skipped.get(e.plane);
      if (!set) l.skipped.set(e.plane, (set = new Set()));
      for (const f of e.fragments) set.add(f);
      return;
    }
    if (e.done === undefined) return;
    l.turns.push({
      at: origin + e.done, plannedS: e.plannedSeconds, actualS: e.actualSeconds ?? 0, creditS: e.creditSeconds,
      bytesPerSecond: e.bytesPerSecond, bytes: e.bytes, skipped: false,
    });
  }

  private rungsOf(model: LoadedModel, plane: number): void {
    const shown = model.state.planes.find((p) => p.plane === plane);
    if (shown) this.live.rungs.set(plane, shown.rungs);
  }

  /** What the package's measured table says of the picture that stands now. */
  private async predict(pkg: TexmeshPackage, model: LoadedModel, turn: number): Promise<void> {
    const planes = model.state.planes.map((p) => ({ base: p.base, plane: p.plane }));
    const data = await pkg.data(planes.map((p) => p.plane));
    const table = await pkg.quality();
    if (turn !== this.turn) return;
    let [loss, weight] = [0, 0];
    for (const p of model.state.planes) {
      const t = data.tables[p.plane];
      if (!t || !/base-colour|emissive|colour/.test(p.role)) continue;
      const weights = surfaceWeights(t);
      const n = t.columns * t.rows;
      for (const f of t.order) {
        const rung = p.rungs[f] ?? -1;
        const d = rung >= 0 ? t.dssim[rung * n + f] : t.skipDssim[f];
        loss += (weights[f] ?? 0) * (d ?? 1);
        weight += weights[f] ?? 0;
      }
    }
    const quality = weight > 0 ? equivalentQuality(data, planes, loss / weight) : 100;
    this.live.predictedSsim = predictedSsim(table, model.state.scale, quality);
    this.changed();
  }

  /** Says what went wrong beside what is shown. */
  problem(error: unknown): void {
    this.live.problem = error instanceof Error ? error.message : String(error);
    this.live.problems++;
    this.changed();
  }

  private solved(): void {
    this.live.problem = '';
    this.live.problems = 0;
    this.changed();
  }

  private failed(error: unknown): void {
    this.stage.dueAt = Infinity;
    this.live.phase = 'failed';
    this.changed();
    this.onError(error);
  }

  private changed(phase?: string): void {
    if (phase) this.live.phase = phase;
    this.onChange();
  }
}
