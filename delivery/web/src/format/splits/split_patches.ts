import { type Fan, none } from './split_mesh';
import * as m from './split_models';
import type { SplitState } from './split_state';
import type { SplitValues } from './split_values';

/** The neighbour at the end of a fan, and the wedge there. */
interface FanEnd {
  point: number;
  wedge: number;
}

/** Faces of a patch, one after the other: each at an open edge of a face before, or a seed by itself. */
export class SplitPatches {
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
    for (const fan of fans) for (let i = fan.begin; i < fan.end; ++i) if (corners.face[i] === face) return fan;
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
    if (left.point !== b && state.bit(m.thirdLeft + fans)) return state.codeWedge(left.wedge, m.patchExpected + 2, left.point);
    if (right.point !== a && right.point !== left.point && state.bit(m.thirdRight))
      return state.codeWedge(right.wedge, m.patchExpected + 3, right.point);
    const p = state.number(state.mesh.points);
    if (p === a || p === b) state.fail('three points of a face', 'S22');
    return state.codeWedge(none, m.listedModel, p);
  }
}
