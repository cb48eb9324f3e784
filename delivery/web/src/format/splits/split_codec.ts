import type { ValueDecoder } from './split_coder';
import { type Fan, type SplitMesh, none } from './split_mesh';
import { type SplitLimits, SplitState } from './split_state';
import * as m from './split_models';
import { type CodedAttribute, SplitValues } from './split_values';

/** Splits of a point, the parent: its child shares the corners, and new faces stand between the two. */
class SplitVertices {
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
        turned = this.state_.bit(m.turnBack + ((side * m.runs + long) * m.rings + ring) * m.valences +
          this.valence_(corners.a[c]));
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
  /** Codes the child's wedge at a corner that moves: mostly that of earlier corners of the same wedge. */
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
    this.finishFace_(x, usual !== flipped, corners.wedge[corner], child, beside ? mx : sx, seam,
      corners.face[corner]);
  }
  private codeExtraFace_(): void {
    const x = this.state_.number(this.state_.mesh.points);
    if (x === this.state_.parent || x === this.state_.child)
      this.state_.fail('three points of a face', 'S22');
    const forward = this.state_.raw(1) !== 0;
    this.finishFace_(x, forward, none, none, none, 1, none);
  }
  private finishFace_(x: number, forward: boolean, expectedParent: number, expectedChild: number,
      expectedThird: number, seam: number, beside: number): void {
    const v = this.state_.codeWedge(expectedParent, m.cornerExpected + seam, this.state_.parent);
    const u = this.state_.codeWedge(expectedChild, m.cornerExpected + 2 + seam, this.state_.child);
    const w = this.state_.codeWedge(expectedThird, m.cornerExpected + 4 + seam, x);
    const group = this.state_.codeGroup(beside);
    if (forward) this.state_.addFace(v, w, u, group);
    else this.state_.addFace(v, u, w, group);
  }
}

/** The neighbour at the end of a fan, and the wedge there. */
interface FanEnd {
  point: number;
  wedge: number;
}

/** Faces of a patch, one after the other: each at an open edge of a face before, or a seed by itself. */
class SplitPatches {
  private readonly gates_: number[] = []; // 3 * face + corner

  constructor(
    private readonly state_: SplitState,
    private readonly values_: SplitValues,
  ) {}

  decode(faceCount: number): void {
    this.gates_.length = 0;
    for (let count = faceCount; count > 0; ) {
      const gate = this.gates_.pop();
      if (gate === undefined) {
        this.seedFace_();
        --count;
      } else if (this.passGate_(gate)) --count;
    }
  }

  private seedFace_(): void {
    const { state_: state } = this;
    const { mesh, guess } = state;
    state.fresh.length = 0;
    const points: number[] = [];
    const wedges: number[] = [];
    for (let k = 0; k < 3; ++k) {
      if (mesh.points > 0 && state.bit(m.seedExists)) {
        const p = state.number(mesh.points);
        if (k > 0 && (p === points[0] || p === points[k - 1])) state.fail('three points of a face', 'S22');
        points.push(p);
        wedges.push(state.codeWedge(none, m.listedModel, p));
      } else {
        const before = k > 0 ? points[0] : mesh.points - 1;
        for (let i = 0; i < 3; ++i) guess[i] = before < 0 ? 0 : mesh.places.data[3 * before + i];
        points.push(this.newPoint_());
        wedges.push(state.addWedge(points[k], true));
      }
    }
    this.finishFace_(wedges[0], wedges[1], wedges[2], none);
  }
  /** A point at the prediction in `guess`. */
  private newPoint_(): number {
    const p = this.state_.addPoint();
    this.values_.codePosition(p);
    return p;
  }
  private finishFace_(w0: number, w1: number, w2: number, beside: number): void {
    const face = this.state_.addFace(w0, w1, w2, this.state_.codeGroup(beside));
    this.values_.codeFreshValues();
    for (let k = 0; k < 3; ++k) this.gates_.push(3 * face + k);
  }
  /** The fan around a point that holds a corner of a face. */
  private fanOf_(point: number, face: number): Fan {
    const { corners, fans, mesh } = this.state_;
    this.state_.countWork(mesh.degree.data[point]);
    mesh.gather(point, corners, fans);
    for (const fan of fans) for (let i = fan.begin; i < fan.end; ++i) if (corners.face[i] === face)
      return fan;
    return this.state_.fail('a face at its own point');
  }
  /** The face behind an open edge, if there is one; false when not. */
  private passGate_(gate: number): boolean {
    const { state_: state } = this;
    const { mesh, corners } = state;
    const face = Math.floor(gate / 3);
    const corner = gate - 3 * face;
    const wa = mesh.wedgeAt(face, corner);
    const wb = mesh.wedgeAt(face, corner + 1);
    const [a, b, d] = [0, 1, 2].map((k) => mesh.pointAt(face, corner + k));
    const atA = this.fanOf_(a, face);
    if (atA.closed || corners.face[atA.begin] !== face) return false; // the edge has two faces already
    const sizeA = Math.min(atA.end - atA.begin, 8) - 1;
    const l = atA.end - 1;
    const left = { point: corners.b[l], wedge: mesh.wedgeAt(corners.face[l], corners.corner[l] + 2) };
    const atB = this.fanOf_(b, face);
    const sizeB = Math.min(atB.end - atB.begin, 8) - 1;
    const r = atB.begin;
    const right = { point: corners.a[r], wedge: mesh.wedgeAt(corners.face[r], corners.corner[r] + 1) };
    const fans = 8 * sizeA + sizeB;
    if (!state.bit(m.gateOpen + fans)) return false;
    state.fresh.length = 0;
    const newB = state.codeWedge(wb, m.patchExpected, b);
    const newA = state.codeWedge(wa, m.patchExpected + 1, a);
    const c = this.codeThird_(a, b, d, left, right, fans);
    this.finishFace_(newB, newA, c, face);
    return true;
  }
  /** The third wedge of a face at the edge from a to b, which another face with point d has, too. */
  private codeThird_(a: number, b: number, d: number, left: FanEnd, right: FanEnd, fans: number): number {
    const { state_: state } = this;
    const places = state.mesh.places.data;
    if (state.bit(m.thirdNew + fans)) {
      for (let k = 0; k < 3; ++k) state.guess[k] = places[3 * a + k] + places[3 * b + k] - places[3 * d + k];
      return state.addWedge(this.newPoint_(), true);
    }
    if (left.point !== b && state.bit(m.thirdLeft + fans))
      return state.codeWedge(left.wedge, m.patchExpected + 2, left.point);
    if (right.point !== a && right.point !== left.point && state.bit(m.thirdRight))
      return state.codeWedge(right.wedge, m.patchExpected + 3, right.point);
    const p = state.number(state.mesh.points);
    if (p === a || p === b) state.fail('three points of a face', 'S22');
    return state.codeWedge(none, m.listedModel, p);
  }
}

/**
 * The reader's side of format/split/split_codec.h: points are asked in the same order, every decision is read
 * from the stream.
 */
export class SplitCodec {
  private readonly state_: SplitState;
  private readonly vertices_: SplitVertices;
  private readonly patches_: SplitPatches;
  private lastAnswer_ = false;
  private fruitless_ = false; // nobody has split since all points were queued

  constructor(mesh: SplitMesh, attributes: readonly CodedAttribute[], positionBits: number, groups: number,
      limits: SplitLimits, positions: ValueDecoder, values: readonly ValueDecoder[]) {
    this.state_ = new SplitState(mesh, groups, limits);
    const coded = new SplitValues(this.state_, attributes, positionBits, positions, values);
    this.vertices_ = new SplitVertices(this.state_, coded);
    this.patches_ = new SplitPatches(this.state_, coded);
  }

  /** Connectivity of the next block. */
  start(connectivity: Uint8Array): void {
    this.state_.start(connectivity);
  }
  /** Before the first block of a scale. */
  beginChapter(): void {
    this.fruitless_ = false;
    this.state_.queue.reset();
  }
  splits(splitCount: number): void {
    const { queue } = this.state_;
    for (let count = splitCount; count > 0; ) {
      if (queue.isEmpty) this.refillQueue_();
      if (!this.askToSplit_(queue.shift())) continue;
      --count;
      this.fruitless_ = false;
    }
    queue.compact();
  }
  patch(faceCount: number): void {
    this.patches_.decode(faceCount);
  }

  /** Whether a point splits; it has then. */
  private askToSplit_(v: number): boolean {
    const { state_: state } = this;
    const { asks } = state.queue;
    state.countWork(1);
    const asked = asks.data[v];
    const degree = Math.min(state.mesh.degree.data[v], m.degrees - 1);
    const model = m.ask + ((degree * 4 + (asked & 3)) * 2 + ((asked >> 2) & 1)) * 2 +
      (this.lastAnswer_ ? 1 : 0);
    this.lastAnswer_ = state.bit(model);
    if (!this.lastAnswer_) {
      if ((asked & 3) < 3) asks.data[v] = asked + 1;
      return false;
    }
    asks.data[v] = 4;
    this.vertices_.decode(v);
    return true;
  }
  private refillQueue_(): void {
    const { queue, mesh } = this.state_;
    if (this.fruitless_) this.state_.fail('a split among all points');
    this.fruitless_ = true;
    queue.refill(mesh.points);
    if (queue.isEmpty) this.state_.fail('points to split');
  }
}
