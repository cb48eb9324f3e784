import type { DecisionEvent, LoadedModel, RequestRecord, TexmeshPackage } from 'texmesh';
import { emptyLive } from '../live';
import type { Live } from '../live';
import type { Stage } from '../stage/stage';

/** What a session reads when events ask for it. */
export interface Readers {
  /** Reads the tables of a plane. */
  tables: (plane: number) => void;
  /** Predicts anew how much the picture differs from the source's. */
  prediction: () => void;
}

/** Hears one load: keeps what the panel shows of the load in `live`, and asks the stage for frames. */
export class Listener {
  readonly live: Live = emptyLive();

  /** `onChange`: `live` has changed. After `signal`, which a newer load gives, no event is heard. */
  constructor(
    private readonly stage: Stage,
    private readonly signal: AbortSignal,
    private readonly onChange: () => void,
  ) {}

  /** Takes over the package's head and hears all its requests, those of before included. */
  hearPackage(pkg: TexmeshPackage): void {
    const { manifest } = pkg;
    this.live.manifest = manifest;
    this.live.title = manifest.title;
    this.live.packageBytes = manifest.provenance.offset + manifest.provenance.bytes;
    for (const record of pkg.requests) this.addTransfer(record);
    pkg.onRequest((record) => {
      if (this.signal.aborted) return; // disposing has cancelled the request
      this.addTransfer(record);
      this.changed();
    });
    this.changed('first-picture');
  }

  /** Hears a model's events. */
  hearModel(model: LoadedModel, read: Readers): void {
    const on: LoadedModel['on'] = (name, f) => model.on(name, (e) => {
      if (this.signal.aborted) return;
      f(e);
      this.look(model);
      this.changed();
    });
    this.hearPicture(on, model, read);
    this.hearPlan(on);
    this.hearEnd(on, read);
    this.hearTrouble(on);
  }

  /** Takes over the displayed height, which decides about scale and planes. */
  look(model: LoadedModel): void {
    const { displayedPx } = model.state;
    if (displayedPx === this.live.displayedPx) return;
    this.live.displayedPx = displayedPx;
    this.changed();
  }

  /** Says what went wrong beside what is shown. */
  addProblem(error: unknown): void {
    this.live.problem = error instanceof Error ? error.message : String(error);
    this.live.problems++;
    this.changed();
  }

  /** Tells that `live` has changed; `phase`: its new phase. */
  changed(phase?: string): void {
    if (phase) this.live.phase = phase;
    this.onChange();
  }

  /** What comes into the picture. */
  private hearPicture(on: LoadedModel['on'], model: LoadedModel, read: Readers): void {
    on('first-picture', (e) => {
      this.live.firstPictureS = this.secondsAt(e.at);
      this.live.scale = e.scale;
      this.live.proxy = e.proxy;
      this.stage.draw();
    });
    on('proxy', (e) => {
      this.live.scale = -1;
      this.live.proxy = e.proxy;
      this.stage.show();
    });
    on('scale', (e) => {
      this.live.scale = e.scale;
      this.live.proxy = -1;
      this.stage.show();
    });
    on('plane', (e) => {
      this.live.shownPlane.set(e.base, e.plane);
      read.tables(e.plane);
      this.stage.show();
    });
    on('fragment', (e) => {
      const shown = model.state.planes.find((p) => p.plane === e.plane);
      if (shown) this.live.rungs.set(e.plane, shown.rungs);
      this.stage.show();
    });
  }

  /** What the plan decides, and how far it has come. */
  private hearPlan(on: LoadedModel['on']): void {
    let planBeganS = NaN; // since the load began
    on('decision', (e) => {
      if (Number.isNaN(planBeganS)) planBeganS = this.secondsAt(e.at) - e.issued;
      this.addDecision(e, planBeganS);
    });
    on('progress', (e) => {
      this.live.phase = e.phase;
      this.live.expected = e.bytesExpected;
    });
  }

  private hearEnd(on: LoadedModel['on'], read: Readers): void {
    on('deadline', (e) => {
      this.live.doneS = e.actual;
      this.live.limitS = e.limit;
      this.stage.dueAt = Infinity;
      this.stage.draw();
    });
    on('done', () => {
      this.live.phase = 'done';
      this.stage.draw();
      read.prediction(); // refining has made the picture better
    });
  }

  private hearTrouble(on: LoadedModel['on']): void {
    // The library makes anew what the GPU has lost; until then nothing is seen.
    on('context', (e) => {
      if (e.lost) this.addProblem(new Error('The graphics context was lost; waiting for it to come back'));
      else this.forgetProblems();
      this.stage.draw();
    });
    on('memory',
      () => this.addProblem(new Error('There is little graphics memory: a coarser picture is shown')));
    on('error', (e) => { if (!e.fatal) this.addProblem(e.error); }); // a fatal error rejects `done`
  }

  private forgetProblems(): void {
    this.live.problem = '';
    this.live.problems = 0;
    this.changed();
  }

  /** Seconds since the load began, of a time of performance.now(). */
  private secondsAt(ms: number): number {
    return (ms - this.live.startedAt) / 1000;
  }

  private addTransfer({ kind, received, started, ended }: RequestRecord): void {
    const start = this.live.startedAt / 1000;
    this.live.transfers.push({ kind, bytes: received, start: started - start, end: ended - start });
    this.live.bytes += received;
    this.live.requests++;
  }

  private addDecision(e: DecisionEvent, planBeganS: number): void {
    const { skipped, turns } = this.live;
    if (e.skipped) {
      let fragments = skipped.get(e.plane);
      if (!fragments) skipped.set(e.plane, (fragments = new Set()));
      for (const f of e.fragments) fragments.add(f);
    } else if (e.done !== undefined) {
      turns.push({
        at: planBeganS + e.done, plannedS: e.plannedSeconds, actualS: e.actualSeconds ?? 0,
        creditS: e.creditSeconds,
        bytesPerSecond: e.bytesPerSecond, bytes: e.bytes, skipped: false,
      });
    }
  }
}
