import { FormatError } from '../errors';
import { BitDecoder, BitModels, ValueDecoder } from './split_coder';
import { octahedralPlace, octahedralVector } from './octahedron';
import { Corners, Fan, Growing, SplitMesh } from './split_mesh';
import * as m from './split_models';

/** Attributes as the codec sees them. */
export interface CodedAttribute {
  normal: boolean;
  components: number;
  bits: number;
}

const bitWidth = (value: number): number => (value === 0 ? 0 : 32 - Math.clz32(value));
const roundedMean = (total: number, count: number): number => Math.trunc((2 * total + count) / (2 * count));

/** The reader's side of format/split_codec.h: the same walk, every decision read from the stream. */
export class SplitCodec {
  private readonly models_ = new BitModels(m.modelCount, 200);
  private bits_ = new BitDecoder(new Uint8Array(0));
  private work_ = 0;
  private readonly queue_: number[] = [];
  private at_ = 0;
  private lastAnswer_ = false;
  private fruitless_ = false;
  private readonly asks_ = new Growing();
  private readonly queued_ = new Growing();
  private parent_ = -1;
  private child_ = -1;
  private readonly corners_ = new Corners();
  private readonly fans_: Fan[] = [];
  private readonly childWedges_: number[] = [];
  private readonly fresh_: number[] = [];
  private readonly beside_: number[] = [];
  private readonly gates_: number[] = []; // 3 * face + corner
  private readonly pending_ = new Growing();
  private readonly listed_ = new Growing();
  private readonly mapped_ = new Growing();
  private readonly mapTarget_ = new Growing();
  private readonly stays_ = new Growing();
  private now_ = 0;
  private staysNow_ = 0;
  private readonly guess_ = [0, 0, 0, 0];

  /** `limits`: a mesh never grows beyond them. */
  constructor(
    private readonly mesh_: SplitMesh,
    private readonly attributes_: readonly CodedAttribute[],
    private readonly positionBits_: number,
    private readonly groups_: number,
    private readonly limits_: { points: number; wedges: number; faces: number },
    private readonly positions_: ValueDecoder,
    private readonly values_: readonly ValueDecoder[],
  ) {}

  /** Connectivity of the next block. */
  start(connectivity: Uint8Array): void {
    this.bits_ = new BitDecoder(connectivity);
  }

  /** Before the first block of a scale. */
  beginChapter(): void {
    this.queue_.length = 0;
    this.at_ = 0;
    this.fruitless_ = false;
    this.queued_.data.fill(0);
    this.asks_.data.fill(0);
  }

  splits(splitCount: number): void {
    for (let count = splitCount; count > 0; ) {
      if (this.at_ === this.queue_.length) this.refill_();
      const v = this.queue_[this.at_++];
      this.queued_.data[v] = 0;
      this.spend_(1);
      const asks = this.asks_.data[v];
      const degree = Math.min(this.mesh_.degree.data[v], m.degrees - 1);
      const model = m.ask + ((degree * 4 + (asks & 3)) * 2 + ((asks >> 2) & 1)) * 2 + (this.lastAnswer_ ? 1 : 0);
      this.lastAnswer_ = this.bit_(model);
      if (!this.lastAnswer_) {
        if ((asks & 3) < 3) this.asks_.data[v] = asks + 1;
        continue;
      }
      this.asks_.data[v] = 4;
      this.split_(v);
      --count;
      this.fruitless_ = false;
    }
    if (this.at_ > 65536 && this.at_ * 2 > this.queue_.length) {
      this.queue_.splice(0, this.at_);
      this.at_ = 0;
    }
  }

  patch(faceCount: number): void {
    this.gates_.length = 0;
    for (let count = faceCount; count > 0; ) {
      const gate = this.gates_.pop();
      if (gate === undefined) {
        this.seedFace_();
        --count;
      } else if (this.passGate_(gate)) --count;
    }
  }

  private bit_(model: number): boolean {
    return this.bits_.bit(this.models_, model);
  }
  private fail_(expected: string, found: string): never {
    throw new FormatError('mesh/stream.bin', '', expected, found);
  }
  /** Work is bounded by the mesh, so that few bytes cannot ask many points again and again. */
  private spend_(work: number): void {
    this.work_ += work;
    if (this.work_ > 1048576 + 256 * (this.mesh_.points + this.mesh_.faceCount))
      this.fail_('splits that are found in reasonable time', 'more steps than 256 per point and face');
  }

  // ---- points, wedges, faces

  private addPoint_(): number {
    if (this.mesh_.points >= this.limits_.points) this.fail_('no more points than the head says', 'more');
    this.asks_.push(0);
    this.queued_.push(0);
    return this.mesh_.addPoint();
  }
  private addWedge_(point: number, pending: boolean): number {
    if (this.mesh_.wedges >= this.limits_.wedges) this.fail_('no more wedges than the head says', 'more');
    const w = this.mesh_.addWedge(point);
    this.pending_.push(pending ? 1 : 0);
    this.listed_.push(0);
    this.mapped_.push(0);
    this.mapTarget_.push(0);
    this.stays_.push(0);
    if (pending) this.fresh_.push(w);
    return w;
  }
  private addFace_(w0: number, w1: number, w2: number, group: number): number {
    if (this.mesh_.faceCount >= this.limits_.faces) this.fail_('no more faces than the head says', 'more');
    return this.mesh_.addFace(w0, w1, w2, group);
  }
  private codeGroup_(beside: number): number {
    if (beside >= 0 && this.bit_(m.sameGroup)) return this.mesh_.faceGroup.data[beside];
    return this.number_(this.groups_);
  }
  private number_(count: number): number {
    const value = this.bits_.raw(bitWidth(count - 1));
    if (value >= count) this.fail_('an index that exists', `${value}`);
    return value;
  }
  /** Whether the stream takes this wedge of a list, which is offered once. */
  private takes_(w: number): boolean {
    if (this.listed_.data[w] === this.now_) return false;
    this.listed_.data[w] = this.now_;
    return this.bit_(m.listedModel);
  }
  private listedWedge_(point: number): number {
    if (point === this.parent_)
      for (let i = 0; i < this.corners_.count; ++i) if (this.takes_(this.corners_.wedge[i])) return this.corners_.wedge[i];
    if (point === this.child_) {
      for (const w of this.childWedges_) if (this.takes_(w)) return w;
      return -1;
    }
    this.spend_(this.mesh_.degree.data[point]);
    for (let c = this.mesh_.head.data[point]; c >= 0; c = this.mesh_.nextCorner(c)) {
      const w = this.mesh_.faces.data[c];
      if (this.takes_(w)) return w;
    }
    return -1;
  }
  /** The wedge of a corner of the face under way: the expected one, one of the point's, or a new one. */
  private codeWedge_(expected: number, model: number, point: number): number {
    if (expected >= 0 && this.bit_(model)) return expected;
    ++this.now_;
    if (expected >= 0) this.listed_.data[expected] = this.now_;
    const found = this.listedWedge_(point);
    if (found >= 0) return found;
    const w = this.addWedge_(point, true);
    if (point === this.child_) this.childWedges_.push(w);
    return w;
  }

  // ---- vertex splits

  private push_(p: number): void {
    if (this.queued_.data[p]) return;
    this.queued_.data[p] = 1;
    this.queue_.push(p);
  }
  private refill_(): void {
    if (this.fruitless_) this.fail_('a split among all points', 'none');
    this.fruitless_ = true;
    this.queue_.length = 0;
    this.at_ = 0;
    for (let p = 0; p < this.mesh_.points; ++p) this.push_(p);
    if (this.queue_.length === 0) this.fail_('points to split', 'none');
  }

  private split_(v: number): void {
    const { mesh_: mesh, corners_: corners, fans_: fans } = this;
    this.spend_(mesh.degree.data[v]);
    mesh.gather(v, corners, fans);
    const u = this.addPoint_();
    this.parent_ = v;
    this.child_ = u;
    this.childWedges_.length = 0;
    this.fresh_.length = 0;
    for (let f = 0; f < fans.length; ++f) this.codeMoves_(fans[f], f);
    for (let i = 0; i < corners.count; ++i) if (corners.moves[i]) this.codeTarget_(i);
    mesh.distribute(v, u, corners);
    for (let f = 0; f < fans.length; ++f) this.codeNewFaces_(fans[f]);
    while (this.bit_(m.extraFace)) this.codeExtraFace_();
    this.predictPoint_(u);
    this.codeFreshValues_();
    this.parent_ = this.child_ = -1;
    this.push_(v);
    this.push_(u);
    for (let i = 0; i < corners.count; ++i) {
      this.push_(corners.a[i]);
      this.push_(corners.b[i]);
    }
  }

  private valence_(p: number): number {
    return Math.min(Math.max(this.mesh_.degree.data[p], 4), 8) - 4;
  }

  /** Which corners of a fan go to the child: usually one run of them. */
  private codeMoves_(fan: Fan, fanNumber: number): void {
    const { corners_: corners } = this;
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
      if (i === 0) moving = this.bit_(m.first + Math.min(n, m.lefts - 1) * 2 + (fanNumber > 0 ? 1 : 0));
      else if (turns === 0) {
        const left = Math.min(n - i, m.lefts - 1);
        turned = this.bit_(m.turn + (side * m.lefts + left) * m.valences + this.valence_(corners.a[c]));
      } else if (turns === 1) {
        const long = Math.min(run, m.runs) - 1;
        turned = this.bit_(m.turnBack + ((side * m.runs + long) * m.rings + ring) * m.valences + this.valence_(corners.a[c]));
      } else turned = this.bit_(m.turnAgain + side);
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
    return this.child_ + 1; // 0 is never one
  }
  private noteStays_(): void {
    this.staysNow_ = this.splitNumber_;
    const { corners_: corners } = this;
    for (let i = 0; i < corners.count; ++i)
      if (!corners.moves[i]) this.stays_.data[corners.wedge[i]] = this.staysNow_;
  }
  /** The child's wedge at a corner that moves: the one that corners of the same wedge got before. */
  private codeTarget_(i: number): void {
    if (this.staysNow_ !== this.splitNumber_) this.noteStays_();
    const wedge = this.corners_.wedge[i];
    const known = this.mapped_.data[wedge] === this.splitNumber_;
    const expected = known ? this.mapTarget_.data[wedge] : -1;
    const asExpected = this.bit_(m.targetExpected + (known ? 1 : 0));
    let target = -1;
    if (asExpected && known) target = expected;
    else if (!asExpected)
      for (const w of this.childWedges_)
        if (w !== expected && this.bit_(m.listedModel)) {
          target = w;
          break;
        }
    if (target < 0) target = this.newTarget_(wedge);
    this.corners_.target[i] = target;
    if (!known) {
      this.mapped_.data[wedge] = this.splitNumber_;
      this.mapTarget_.data[wedge] = target;
    }
  }
  private newTarget_(wedge: number): number {
    const lost = this.stays_.data[wedge] !== this.staysNow_;
    const copied = this.bit_(m.targetCopied + (lost ? 1 : 0));
    const w = this.addWedge_(this.child_, !copied);
    if (copied) this.mesh_.copyValues(wedge, w);
    this.childWedges_.push(w);
    return w;
  }

  private codeNewFaces_(fan: Fan): void {
    if (fan.closed) {
      let last = fan.end - 1;
      for (let i = fan.begin; i < fan.end; last = i++) this.codeEdge_(last, i);
    } else {
      this.codeEdge_(-1, fan.begin);
      for (let i = fan.begin + 1; i < fan.end; ++i) this.codeEdge_(i - 1, i);
      this.codeEdge_(fan.end - 1, -1);
    }
  }
  /** New faces at the edge between two corners of a fan, or at an end of an open one. */
  private codeEdge_(last: number, next: number): void {
    const { corners_: corners } = this;
    const c = next >= 0 ? next : last;
    const x = next >= 0 ? corners.a[c] : corners.b[c];
    const inside = last >= 0 && next >= 0;
    const kind = inside ? (corners.moves[last] !== corners.moves[next] ? 1 : 0) : corners.moves[c] ? 3 : 2;
    for (let n = 0; this.bit_(m.moreFaces + 2 * kind + Math.min(n, 1)); ++n) {
      this.spend_(1);
      this.codeFace_(x, last, next);
    }
  }
  /** One new face of parent, child and x. */
  private codeFace_(x: number, last: number, next: number): void {
    const { corners_: corners, mesh_: mesh } = this;
    const usual = next >= 0 ? corners.moves[next] : !corners.moves[last];
    const flipped = this.bit_(m.flippedModel);
    let moving = -1;
    let staying = -1;
    for (const i of [next, last]) {
      if (i < 0) continue;
      if (corners.moves[i]) moving = i;
      else staying = i;
    }
    const third = (i: number): number =>
      i < 0 ? -1 : mesh.wedgeAt(corners.face[i], corners.corner[i] + (i === next ? 1 : 2));
    const mx = third(moving);
    const sx = third(staying);
    let seam = 0;
    let beside = moving >= 0;
    if (moving >= 0 && staying >= 0) {
      const wedge = corners.wedge[moving] !== corners.wedge[staying];
      const far = mx !== sx;
      if (wedge || far) {
        seam = 1;
        beside = this.bit_(m.besideMoving + (wedge && far ? 2 : far ? 1 : 0));
      }
    }
    const corner = beside ? moving : staying;
    let child = -1;
    if (beside) child = corners.target[moving];
    else if (this.mapped_.data[corners.wedge[staying]] === this.splitNumber_)
      child = this.mapTarget_.data[corners.wedge[staying]];
    this.finishFace_(x, usual !== flipped, corners.wedge[corner], child, beside ? mx : sx, seam, corners.face[corner]);
  }
  private codeExtraFace_(): void {
    const x = this.number_(this.mesh_.points);
    if (x === this.parent_ || x === this.child_) this.fail_('three points of a face', 'two');
    const forward = this.bits_.raw(1) !== 0;
    this.finishFace_(x, forward, -1, -1, -1, 1, -1);
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
    const v = this.codeWedge_(expectedParent, m.cornerExpected + seam, this.parent_);
    const u = this.codeWedge_(expectedChild, m.cornerExpected + 2 + seam, this.child_);
    const w = this.codeWedge_(expectedThird, m.cornerExpected + 4 + seam, x);
    const group = this.codeGroup_(beside);
    if (forward) this.addFace_(v, w, u, group);
    else this.addFace_(v, u, w, group);
  }

  // ---- patches

  private seedFace_(): void {
    this.fresh_.length = 0;
    const points: number[] = [];
    const wedges: number[] = [];
    for (let k = 0; k < 3; ++k) {
      if (this.mesh_.points > 0 && this.bit_(m.seedExists)) {
        const p = this.number_(this.mesh_.points);
        if (k > 0 && (p === points[0] || p === points[k - 1])) this.fail_('three points of a face', 'two');
        points.push(p);
        wedges.push(this.codeWedge_(-1, m.listedModel, p));
      } else {
        const before = k > 0 ? points[0] : this.mesh_.points - 1;
        for (let i = 0; i < 3; ++i) this.guess_[i] = before < 0 ? 0 : this.mesh_.places.data[3 * before + i];
        points.push(this.newPatchPoint_());
        wedges.push(this.addWedge_(points[k], true));
      }
    }
    this.finishPatchFace_(wedges[0], wedges[1], wedges[2], -1);
  }
  /** A point at the prediction in `guess`. */
  private newPatchPoint_(): number {
    const p = this.addPoint_();
    this.positions_.values(this.mesh_.places.data, 3 * p, this.guess_, 3, this.positionBits_);
    return p;
  }
  private finishPatchFace_(w0: number, w1: number, w2: number, beside: number): void {
    const face = this.addFace_(w0, w1, w2, this.codeGroup_(beside));
    this.codeFreshValues_();
    for (let k = 0; k < 3; ++k) this.gates_.push(3 * face + k);
  }
  /** The fan around a point that holds a corner of a face. */
  private fanOf_(point: number, face: number): Fan {
    const { corners_: corners, fans_: fans } = this;
    this.spend_(this.mesh_.degree.data[point]);
    this.mesh_.gather(point, corners, fans);
    for (const fan of fans) for (let i = fan.begin; i < fan.end; ++i) if (corners.face[i] === face) return fan;
    return this.fail_('a face at its own point', 'none');
  }
  /** The face behind an open edge, if there is one; false when not. */
  private passGate_(gate: number): boolean {
    const { mesh_: mesh, corners_: corners } = this;
    const face = Math.floor(gate / 3);
    const corner = gate - 3 * face;
    const wa = mesh.wedgeAt(face, corner);
    const wb = mesh.wedgeAt(face, corner + 1);
    const [a, b, d] = [0, 1, 2].map((k) => mesh.pointAt(face, corner + k));
    const atA = this.fanOf_(a, face);
    if (atA.closed || corners.face[atA.begin] !== face) return false; // the edge has two faces already
    const sizeA = Math.min(atA.end - atA.begin, 8) - 1;
    const l = atA.end - 1;
    const left = { b: corners.b[l], wedge: mesh.wedgeAt(corners.face[l], corners.corner[l] + 2) };
    const atB = this.fanOf_(b, face);
    const sizeB = Math.min(atB.end - atB.begin, 8) - 1;
    const r = atB.begin;
    const right = { a: corners.a[r], wedge: mesh.wedgeAt(corners.face[r], corners.corner[r] + 1) };
    const fans = 8 * sizeA + sizeB;
    if (!this.bit_(m.gateOpen + fans)) return false;
    this.fresh_.length = 0;
    const newB = this.codeWedge_(wb, m.patchExpected, b);
    const newA = this.codeWedge_(wa, m.patchExpected + 1, a);
    const c = this.codeThird_(a, b, d, left, right, fans);
    this.finishPatchFace_(newB, newA, c, face);
    return true;
  }
  private codeThird_(
    a: number,
    b: number,
    d: number,
    left: { b: number; wedge: number },
    right: { a: number; wedge: number },
    fans: number,
  ): number {
    const places = this.mesh_.places.data;
    if (this.bit_(m.thirdNew + fans)) {
      for (let k = 0; k < 3; ++k) this.guess_[k] = places[3 * a + k] + places[3 * b + k] - places[3 * d + k];
      return this.addWedge_(this.newPatchPoint_(), true);
    }
    if (left.b !== b && this.bit_(m.thirdLeft + fans)) return this.codeWedge_(left.wedge, m.patchExpected + 2, left.b);
    if (right.a !== a && right.a !== left.b && this.bit_(m.thirdRight))
      return this.codeWedge_(right.wedge, m.patchExpected + 3, right.a);
    const p = this.number_(this.mesh_.points);
    if (p === a || p === b) this.fail_('three points of a face', 'two');
    return this.codeWedge_(-1, m.listedModel, p);
  }

  // ---- values

  private predictPoint_(u: number): void {
    const { mesh_: mesh, guess_: guess } = this;
    const places = mesh.places.data;
    let [x, y, z, count] = [0, 0, 0, 0];
    for (let c = mesh.head.data[u]; c >= 0; c = mesh.nextCorner(c)) {
      const face = Math.floor(c / 3);
      for (let k = 1; k <= 2; ++k) {
        const p = 3 * mesh.pointAt(face, c - 3 * face + k);
        x += places[p];
        y += places[p + 1];
        z += places[p + 2];
        ++count;
      }
    }
    const sums = [x, y, z];
    for (let k = 0; k < 3; ++k) guess[k] = count > 0 ? roundedMean(sums[k], count) : places[3 * this.parent_ + k];
    this.positions_.values(places, 3 * u, guess, 3, this.positionBits_);
  }

  private codeFreshValues_(): void {
    for (const w of this.fresh_) {
      const sibling = this.lookAround_(w);
      for (let k = 0; k < this.attributes_.length; ++k) {
        const { components, bits } = this.attributes_[k];
        const data = this.mesh_.values[k].data;
        if (sibling >= 0 && this.values_[k].same()) {
          data.copyWithin(w * components, sibling * components, (sibling + 1) * components);
          continue;
        }
        this.predictValue_(k, sibling);
        this.values_[k].values(data, w * components, this.guess_, components, bits);
      }
      this.pending_.data[w] = 0;
    }
    this.fresh_.length = 0;
  }
  /** Fills `beside` with the wedges beside w in its chart; gives another wedge of its point, or -1. */
  private lookAround_(w: number): number {
    const { mesh_: mesh, beside_: beside } = this;
    const p = mesh.wedgePoint.data[w];
    let sibling = -1;
    beside.length = 0;
    this.spend_(mesh.degree.data[p]);
    for (let c = mesh.head.data[p]; c >= 0; c = mesh.nextCorner(c)) {
      const own = mesh.faces.data[c];
      if (own !== w) {
        if (sibling < 0 && !this.pending_.data[own]) sibling = own;
        continue;
      }
      const face = Math.floor(c / 3);
      for (let k = 1; k <= 2; ++k) {
        const other = mesh.wedgeAt(face, c - 3 * face + k);
        if (!this.pending_.data[other]) beside.push(other);
      }
    }
    return sibling;
  }
  /** Leaves in `guess` the mean of the wedges beside. */
  private predictValue_(k: number, sibling: number): void {
    const { beside_: beside, guess_: guess, mesh_: mesh } = this;
    if (beside.length === 0) {
      if (sibling >= 0) beside.push(sibling);
      else if (this.parent_ >= 0 && this.corners_.count > 0) beside.push(this.corners_.wedge[0]);
    }
    guess.fill(0);
    if (beside.length === 0) return;
    const { normal, components, bits } = this.attributes_[k];
    const data = mesh.values[k].data;
    const sums = [0, 0, 0, 0];
    for (const w of beside) {
      if (normal) octahedralVector(data[2 * w], data[2 * w + 1], bits).forEach((v, i) => (sums[i] += v));
      else for (let i = 0; i < components; ++i) sums[i] += data[w * components + i];
    }
    if (normal) octahedralPlace(sums, bits, guess);
    else for (let i = 0; i < components; ++i) guess[i] = roundedMean(sums[i], beside.length);
  }
}
