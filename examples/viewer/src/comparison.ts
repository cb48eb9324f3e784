import { byId } from './dom';
import type { Session } from './session/session';
import type { Stage } from './stage/stage';

/** The comparison with the original: a border that can be moved, left of which the original is shown. */
export class Comparison {
  private readonly divider = byId('divider');
  private share = 0.5; // of the picture's width, left of the border

  constructor(private readonly stage: Stage, private readonly session: Session) {
    const { divider } = this;
    divider.addEventListener('pointerdown', (e) => divider.setPointerCapture(e.pointerId));
    divider.addEventListener('pointermove', (e) => {
      if (!divider.hasPointerCapture(e.pointerId)) return;
      const box = byId('stage').getBoundingClientRect();
      this.moveTo((e.clientX - box.left) / box.width);
    });
    divider.addEventListener('keydown', (e) => {
      if (e.key !== 'ArrowLeft' && e.key !== 'ArrowRight') return;
      this.moveTo(this.share + (e.key === 'ArrowLeft' ? -0.03 : 0.03));
      e.preventDefault();
    });
    byId('split').addEventListener('click', () => this.toggle());
  }

  toggle(): void {
    this.divider.hidden = !this.divider.hidden;
    byId('split').setAttribute('aria-pressed', String(!this.divider.hidden));
    this.place();
    this.load();
  }

  /** Loads the original where the comparison is open; a failure shows the current picture again. */
  load(): void {
    if (!this.divider.hidden) void this.loadOriginal();
  }

  private async loadOriginal(): Promise<void> {
    const loading = (is: boolean): void => {
      byId('side-original').textContent = is ? 'original, loading' : 'original';
    };
    try {
      await this.session.showOriginal(loading);
    } catch (error) {
      loading(false);
      if (!this.divider.hidden) this.toggle();
      this.session.onError(error);
    }
  }

  private moveTo(share: number): void {
    this.share = Math.min(Math.max(share, 0.03), 0.97);
    this.place();
  }

  private place(): void {
    this.divider.style.left = `${100 * this.share}%`;
    this.divider.setAttribute('aria-valuenow', (100 * this.share).toFixed(0));
    this.stage.setSplit(this.divider.hidden ? 0 : this.share);
  }
}
