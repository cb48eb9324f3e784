import { type Fan, none } from './split_mesh';
import * as m from './split_models';
import type { SplitState } from './split_state';
import type { SplitValues } from './split_values';

/** Splits of a point, the parent, which gets a child: parent and child share the corners, and get new faces between them. */
export class SplitVertices {
  private staysNow_ = 0;

  constructor(
    private readonly state_: SplitState,
    private readonly values_: SplitValues,
  ) {}

  /** Splits a point, and queues whom the split may have changed. */
  decode(v: number): void {
    const { state_: state } = this;
    const { mesh, corners, fans, queue } = state;
    state.countWork(mesh.degree.data[v]);
    mesh.gather(v, corners, fans);
    const u = state.addPoint();
    state.parent = v;
    state.child = u;
    state.childWedges.length = 0;
    state.fresh.length = 0;
    for (let f = 0; f < fans.length; ++f) this.codeMoves_(fans[f], f);
    for (let i = 0; i < corners.count; ++i) if (corners.moves[i]) this.codeTarget_(i);
    mesh.distribute(v, u, corners);
    for (let f = 0; f < fans.length; ++f) this.codeNewFaces_(fans[f]);
    while (state.bit(m.extraFace)) this.codeExtraFace_();
    this.values_.codeSplitPosition(u);
    this.values_.codeFreshValues();
    state.parent = state.child = none;
    queue.push(v);
    queue.push(u);
    for (let i = 0; i < corners.count; ++i) {
      queue.push(corners.a[i]);
      queue.push(corners.b[i]);
    }
  }

  private valence_(p: number): number {
    return Math.min(Math.max(this.state_.mesh.degree.data[p], 4), 8) - 4;
  }

  /** Which corners of a fan go to the child: usually one run of them. */
  private codeMoves_(fan: Fan, fanNumber: number): void {
    const { corners } = this.state_;
    const n = fan.end - fan.begin;
    const ring = Math.min(Math.max(Math.min(n, 10), 3), 10) - 3;
    const open = fan.closed ? 0 : 1;
    let turns = 0;
    let run = 1;
    let moving = false;
    for (let i = 0; i < n; ++i) {
      const c = fan.begin + i;
      const side = 2 * open + (moving ? 1 : 0);
      let turned = false;
      if (i === 0) moving = this.state_.bit(m.first + Math.min(n, m.lefts - 1) * 2 + (fanNumber > 0 ? 1 : 0));
      else if (turns === 0) {
        const left = Math.min(n - i, m.lefts - 1);
        turned = this.state_.bit(m.turn + (side * m.lefts + left) * m.valences + this.valence_(corners.a[c]));
      } else if (turns === 1) {
        const long = Math.min(run, m.runs) - 1;
        turned = this.state_.bit(m.turnBack + ((side * m.runs + long) * m.rings + ring) * m.valences + this.valence_(corners.a[c]));
      } else turned = this.state_.bit(m.turnAgain + side);
      if (turned) {
        moving = !moving;
        ++turns;
        run = 0;
      }
      ++run;
      corners.moves[c] = moving;
    }
  }

  private get splitNumber_(): number {
    return this.state_.child + 1; // 0 is never one
  }
  /** Notes the wedges of which a corner stays at the parent. */
  private noteStays_(): void {
    this.staysNow_ = this.splitNumber_;
    const { corners } = this.state_;
    for (let i = 0; i < corners.count; ++i)
      if (!corners.moves[i]) this.state_.wedges.stays.data[corners.wedge[i]] = this.staysNow_;
  }
  /** Codes the child's wedge at a corner that moves: mostly the wedge that corners of the same wedge got before. */
  private codeTarget_(i: number): void {
    if (this.staysNow_ !== this.splitNumber_) this.noteStays_();
    const wedge = this.state_.corners.wedge[i];
    const known = this.state_.wedges.mapped.data[wedge] === this.splitNumber_;
    const expected = known ? this.state_.wedges.mapTarget.data[wedge] : none;
    const asExpected = this.state_.bit(m.targetExpected + (known ? 1 : 0));
    let target = none;
    if (asExpected && known) target = expected;
    else if (!asExpected)
      for (const w of this.state_.childWedges)
        if (w !== expected && this.state_.bit(m.listedModel)) {
          target = w;
          break;
        }
    if (target === none) target = this.newTarget_(wedge);
    this.state_.corners.target[i] = target;
    if (!known) {
      this.state_.wedges.mapped.data[wedge] = this.splitNumber_;
      this.state_.wedges.mapTarget.data[wedge] = target;
    }
  }
  private newTarget_(wedge: number): number {
    const lost = this.state_.wedges.stays.data[wedge] !== this.staysNow_;
    const copied = this.state_.bit(m.targetCopied + (lost ? 1 : 0));
    const w = this.state_.addWedge(this.state_.child, !copied);
    if (copied) this.state_.mesh.copyValues(wedge, w);
    this.state_.childWedges.push(w);
    return w;
  }

  private codeNewFaces_(fan: Fan): void {
    if (fan.closed) {
      let last = fan.end - 1;
      for (let i = fan.begin; i < fan.end; last = i++) this.codeEdge_(last, i);
    } else {
      this.codeEdge_(none, fan.begin);
      for (let i = fan.begin + 1; i < fan.end; ++i) this.codeEdge_(i - 1, i);
      this.codeEdge_(fan.end - 1, none);
    }
  }
  /** New faces at the edge between two corners of a fan, or at an end of an open one. */
  private codeEdge_(last: number, next: number): void {
    const { corners } = this.state_;
    const c = next >= 0 ? next : last;
    const x = next >= 0 ? corners.a[c] : corners.b[c];
    const inside = last >= 0 && next >= 0;
    const kind = inside ? (corners.moves[last] !== corners.moves[next] ? 1 : 0) : corners.moves[c] ? 3 : 2;
    for (let n = 0; this.state_.bit(m.moreFaces + 2 * kind + Math.min(n, 1)); ++n) {
      this.state_.countWork(1);
      this.codeFace_(x, last, next);
    }
  }
  /** One new face of parent, child and x. */
  private codeFace_(x: number, last: number, next: number): void {
    const { corners, mesh } = this.state_;
    const usual = next >= 0 ? corners.moves[next] : !corners.moves[last];
    const flipped = this.state_.bit(m.flippedModel);
    let moving = none;
    let staying = none;
    for (const i of [next, last]) {
      if (i < 0) continue;
      if (corners.moves[i]) moving = i;
      else staying = i;
    }
    const third = (i: number): number =>
      i < 0 ? none : mesh.wedgeAt(corners.face[i], corners.corner[i] + (i === next ? 1 : 2));
    const mx = third(moving);
    const sx = third(staying);
    let seam = 0;
    let beside = moving >= 0;
    if (moving >= 0 && staying >= 0) {
      const wedge = corners.wedge[moving] !== corners.wedge[staying];
      const far = mx !== sx;
      if (wedge || far) {
        seam = 1;
        beside = this.state_.bit(m.besideMoving + (wedge && far ? 2 : far ? 1 : 0));
      }
    }
    const corner = beside ? moving : staying;
    let child = none;
    if (beside) child = corners.target[moving];
    else if (this.state_.wedges.mapped.data[corners.wedge[staying]] === this.splitNumber_)
      child = this.state_.wedges.mapTarget.data[corners.wedge[staying]];
    this.finishFace_(x, usual !== flipped, corners.wedge[corner], child, beside ? mx : sx, seam, corners.face[corner]);
  }
  private codeExtraFace_(): void {
    const x = this.state_.number(this.state_.mesh.points);
    if (x === this.state_.parent || x === this.state_.child) this.state_.fail('three points of a face', 'S22');
    const forward = this.state_.raw(1) !== 0;
    this.finishFace_(x, forward, none, none, none, 1, none);
  }
  private finishFace_(
    x: number,
    forward: boolean,
    expectedParent: number,
    expectedChild: number,
    expectedThird: number,
    seam: number,
    beside: number,
  ): void {
    const v = this.state_.codeWedge(expectedParent, m.cornerExpected + seam, this.state_.parent);
    const u = this.state_.codeWedge(expectedChild, m.cornerExpected + 2 + seam, this.state_.child);
    const w = this.state_.codeWedge(expectedThird, m.cornerExpected + 4 + seam, x);
    const group = this.state_.codeGroup(beside);
    if (forward) this.state_.addFace(v, w, u, group);
    else this.state_.addFace(v, u, w, group);
  }
}
