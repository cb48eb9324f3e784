// Notes at points of the object, a curator's editor, and measuring: loaded where a package has notes, or when
// a button asks.

import type { NotesLayer } from 'texmesh/notes';
import { byId } from './dom';
import type { Session } from './session/session';
import type { Stage } from './stage/stage';

/** The buttons that measure and add notes; the notes of a package, when its picture stands. */
export class Notes {
  private layer: Promise<NotesLayer | null> | null = null;
  private ends = new Map<string, () => void>();

  constructor(private readonly stage: Stage, private readonly session: Session) {
    byId('measure').addEventListener('click', () => void this.toggle('measure'));
    byId('annotate').addEventListener('click', () => void this.toggle('annotate'));
  }

  /** To be called when something has changed: the notes of a package come once. */
  changed(): void {
    const { pkg } = this.session.inner;
    if (pkg?.manifest.annotations && this.session.live.scale !== null) void this.shown();
  }

  private shown(): Promise<NotesLayer | null> {
    return (this.layer ??= this.show().catch((error: unknown) => {
      this.session.problem(error);
      return null;
    }));
  }
  private async show(): Promise<NotesLayer | null> {
    const { pkg } = this.session.inner;
    if (!pkg) return null;
    const { NotesLayer: Layer, readNotes } = await import('texmesh/notes');
    const layer = new Layer({
      canvas: byId('view'), camera: this.stage.camera, manifest: pkg.manifest,
      load: () => this.session.inner.model ?? undefined,
      look: (position, target) => this.stage.look(position, target),
    }, await readNotes(pkg), navigator.languages);
    byId('view').after(layer.root);
    return layer;
  }
  private async toggle(name: 'measure' | 'annotate'): Promise<void> {
    const layer = await this.shown(), { pkg } = this.session.inner;
    if (!layer || !pkg) return;
    const before = this.ends.get(name);
    for (const [other, end] of this.ends) {
      end();
      byId(other).setAttribute('aria-pressed', 'false');
    }
    this.ends.clear();
    if (before) return;
    const { edit, measure } = await import('texmesh/notes');
    this.ends.set(name, name === 'measure' ? measure(layer, pkg, await pkg.about()) : edit(layer));
    byId(name).setAttribute('aria-pressed', 'true');
  }
}
