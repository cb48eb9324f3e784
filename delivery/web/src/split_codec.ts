import { FormatError } from './errors';
import { BitDecoder, BitModels, ValueDecoder } from './split_coder';
import { Corners, Fan, Growing, SplitMesh } from './split_mesh';

/** Attributes as the codec sees them. */
export interface CodedAttribute {
  normal: boolean;
  components: number;
  bits: number;
}

const degrees = 14;
const lefts = 12;
const runs = 7;
const rings = 8;
const valences = 5;

// Where the models of each kind begin: format/split_codec.h, SplitModels.
let modelCount = 0;
const block = (count: number): number => {
  const at = modelCount;
  modelCount += count;
  return at;
};
const ask = block(degrees * 4 * 2 * 2);
const first = block(lefts * 2);
const turn = block(2 * 2 * lefts * valences);
const turnBack = block(2 * 2 * runs * rings * valences);
const turnAgain = block(4);
const targetExpected = block(2);
const targetCopied = block(2);
const listedModel = block(1);
const moreFaces = block(8);
const flippedModel = block(1);
const extraFace = block(1);
const sameGroup = block(1);
const besideMoving = block(3);
const cornerExpected = block(6);
const seedExists = block(1);
const gateOpen = block(64);
const thirdNew = block(64);
const thirdLeft = block(64);
const thirdRight = block(1);
const patchExpected = block(4);

const bitWidth = (value: number): number => (value === 0 ? 0 : 32 - Math.clz32(value));
const roundedMean = (total: number, count: number): number => Math.trunc((2 * total + count) / (2 * count));

/** A coordinate of the octahedron's vector, scaled to `centre`, rounded towards zero. */
function scaled(value: number, centre: number, total: number): number {
  const product = value * centre;
  if (Math.abs(product) <= Number.MAX_SAFE_INTEGER) return Math.trunc(product / total);
  return Number((BigInt(value) * BigInt(centre)) / BigInt(total));
}
/** A point of the octahedron |x| + |y| + |z| = 2^(bits - 1) - 1. */
export function octahedralVector(u: number, v: number, bits: number): [number, number, number] {
  const centre = 2 ** (bits - 1) - 1;
  const x = u - centre;
  const y = v - centre;
  const z = centre - Math.abs(x) - Math.abs(y);
  if (z >= 0) return [x, y, z];
  return [(centre - Math.abs(y)) * (x < 0 ? -1 : 1), (centre - Math.abs(x)) * (y < 0 ? -1 : 1), z];
}
function octahedralPlace(sum: readonly number[], bits: number, out: number[]): void {
  const centre = 2 ** (bits - 1) - 1;
  const total = Math.abs(sum[0]) + Math.abs(sum[1]) + Math.abs(sum[2]);
  out[0] = out[1] = centre;
  if (total === 0) return;
  let x = scaled(sum[0], centre, total);
  let y = scaled(sum[1], centre, total);
  if (sum[2] < 0)
    [x, y] = [(centre - Math.abs(y)) * (x < 0 ? -1 : 1), (centre - Math.abs(x)) * (y < 0 ? -1 : 1)];
  out[0] += x;
  out[1] += y;
}

/** The reader's side of format/split_codec.h: the same walk, every decision read from the stream. */
export class SplitCodec {
  private readonly models = new BitModels(modelCount, 200);
  private bits = new BitDecoder(new Uint8Array(0));
  private work = 0;
  private readonly queue: number[] = [];
  private at = 0;
  private lastAnswer = false;
  private fruitless = false;
  private readonly asks = new Growing();
  private readonly queued = new Growing();
  private parent = -1;
  private child = -1;
  private readonly corners = new Corners();
  private readonly fans: Fan[] = [];
  private readonly childWedges: number[] = [];
  private readonly fresh: number[] = [];
  private readonly beside: number[] = [];
  private readonly gates: number[] = []; // 3 * face + corner
  private readonly pending = new Growing();
  private readonly listed = new Growing();
  private readonly mapped = new Growing();
  private readonly mapTarget = new Growing();
  private readonly stays = new Growing();
  private now = 0;
  private staysNow = 0;
  private readonly guess = [0, 0, 0, 0];

  /** `limits`: a mesh never grows beyond them. */
  constructor(
    private readonly mesh: SplitMesh,
    private readonly attributes: readonly CodedAttribute[],
    private readonly positionBits: number,
    private readonly groups: number,
    private readonly limits: { points: number; wedges: number; faces: number },
    private readonly positions: ValueDecoder,
    private readonly values: readonly ValueDecoder[],
  ) {}

  /** Connectivity of the next block. */
  start(connectivity: Uint8Array): void {
    this.bits = new BitDecoder(connectivity);
  }

  /** Before the first block of a scale. */
  beginChapter(): void {
    this.queue.length = 0;
    this.at = 0;
    this.fruitless = false;
    this.queued.data.fill(0);
    this.asks.data.fill(0);
  }

  splits(splitCount: number): void {
    for (let count = splitCount; count > 0; ) {
      if (this.at === this.queue.length) this.refill();
      const v = this.queue[this.at++];
      this.queued.data[v] = 0;
      this.spend(1);
      const asks = this.asks.data[v];
      const degree = Math.min(this.mesh.degree.data[v], degrees - 1);
      const model = ask + ((degree * 4 + (asks & 3)) * 2 + ((asks >> 2) & 1)) * 2 + (this.lastAnswer ? 1 : 0);
      this.lastAnswer = this.bit(model);
      if (!this.lastAnswer) {
        if ((asks & 3) < 3) this.asks.data[v] = asks + 1;
        continue;
      }
      this.asks.data[v] = 4;
      this.split(v);
      --count;
      this.fruitless = false;
    }
    if (this.at > 65536 && this.at * 2 > this.queue.length) {
      this.queue.splice(0, this.at);
      this.at = 0;
    }
  }

  patch(faceCount: number): void {
    this.gates.length = 0;
    for (let count = faceCount; count > 0; ) {
      const gate = this.gates.pop();
      if (gate === undefined) {
        this.seedFace();
        --count;
      } else if (this.passGate(gate)) --count;
    }
  }

  private bit(model: number): boolean {
    return this.bits.bit(this.models, model);
  }
  private fail(expected: string, found: string): never {
    throw new FormatError('mesh/stream.bin', '', expected, found);
  }
  /** Work is bounded by the mesh, so that few bytes cannot ask many points again and again. */
  private spend(work: number): void {
    this.work += work;
    if (this.work > 1048576 + 256 * (this.mesh.points + this.mesh.faceCount))
      this.fail('splits that are found in reasonable time', 'more steps than 256 per point and face');
  }

  // ---- points, wedges, faces

  private addPoint(): number {
    if (this.mesh.points >= this.limits.points) this.fail('no more points than the head says', 'more');
    this.asks.push(0);
    this.queued.push(0);
    return this.mesh.addPoint();
  }
  private addWedge(point: number, pending: boolean): number {
    if (this.mesh.wedges >= this.limits.wedges) this.fail('no more wedges than the head says', 'more');
    const w = this.mesh.addWedge(point);
    this.pending.push(pending ? 1 : 0);
    this.listed.push(0);
    this.mapped.push(0);
    this.mapTarget.push(0);
    this.stays.push(0);
    if (pending) this.fresh.push(w);
    return w;
  }
  private addFace(w0: number, w1: number, w2: number, group: number): number {
    if (this.mesh.faceCount >= this.limits.faces) this.fail('no more faces than the head says', 'more');
    return this.mesh.addFace(w0, w1, w2, group);
  }
  private codeGroup(beside: number): number {
    if (beside >= 0 && this.bit(sameGroup)) return this.mesh.faceGroup.data[beside];
    return this.number(this.groups);
  }
  private number(count: number): number {
    const value = this.bits.raw(bitWidth(count - 1));
    if (value >= count) this.fail('an index that exists', `${value}`);
    return value;
  }
  /** Whether the stream takes this wedge of a list, which is offered once. */
  private takes(w: number): boolean {
    if (this.listed.data[w] === this.now) return false;
    this.listed.data[w] = this.now;
    return this.bit(listedModel);
  }
  private listedWedge(point: number): number {
    if (point === this.parent)
      for (let i = 0; i < this.corners.count; ++i) if (this.takes(this.corners.wedge[i])) return this.corners.wedge[i];
    if (point === this.child) {
      for (const w of this.childWedges) if (this.takes(w)) return w;
      return -1;
    }
    this.spend(this.mesh.degree.data[point]);
    for (let c = this.mesh.head.data[point]; c >= 0; c = this.mesh.nextCorner(c)) {
      const w = this.mesh.faces.data[c];
      if (this.takes(w)) return w;
    }
    return -1;
  }
  /** The wedge of a corner of the face under way: the expected one, one of the point's, or a new one. */
  private codeWedge(expected: number, model: number, point: number): number {
    if (expected >= 0 && this.bit(model)) return expected;
    ++this.now;
    if (expected >= 0) this.listed.data[expected] = this.now;
    const found = this.listedWedge(point);
    if (found >= 0) return found;
    const w = this.addWedge(point, true);
    if (point === this.child) this.childWedges.push(w);
    return w;
  }

  // ---- vertex splits

  private push(p: number): void {
    if (this.queued.data[p]) return;
    this.queued.data[p] = 1;
    this.queue.push(p);
  }
  private refill(): void {
    if (this.fruitless) this.fail('a split among all points', 'none');
    this.fruitless = true;
    this.queue.length = 0;
    this.at = 0;
    for (let p = 0; p < this.mesh.points; ++p) this.push(p);
    if (this.queue.length === 0) this.fail('points to split', 'none');
  }

  private split(v: number): void {
    const { mesh, corners, fans } = this;
    this.spend(mesh.degree.data[v]);
    mesh.gather(v, corners, fans);
    const u = this.addPoint();
    this.parent = v;
    this.child = u;
    this.childWedges.length = 0;
    this.fresh.length = 0;
    for (let f = 0; f < fans.length; ++f) this.codeMoves(fans[f], f);
    for (let i = 0; i < corners.count; ++i) if (corners.moves[i]) this.codeTarget(i);
    mesh.distribute(v, u, corners);
    for (let f = 0; f < fans.length; ++f) this.codeNewFaces(fans[f]);
    while (this.bit(extraFace)) this.codeExtraFace();
    this.predictPoint(u);
    this.codeFreshValues();
    this.parent = this.child = -1;
    this.push(v);
    this.push(u);
    for (let i = 0; i < corners.count; ++i) {
      this.push(corners.a[i]);
      this.push(corners.b[i]);
    }
  }

  private valence(p: number): number {
    return Math.min(Math.max(this.mesh.degree.data[p], 4), 8) - 4;
  }

  /** Which corners of a fan go to the child: usually one run of them. */
  private codeMoves(fan: Fan, fanNumber: number): void {
    const { corners } = this;
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
      if (i === 0) moving = this.bit(first + Math.min(n, lefts - 1) * 2 + (fanNumber > 0 ? 1 : 0));
      else if (turns === 0) {
        const left = Math.min(n - i, lefts - 1);
        turned = this.bit(turn + (side * lefts + left) * valences + this.valence(corners.a[c]));
      } else if (turns === 1) {
        const long = Math.min(run, runs) - 1;
        turned = this.bit(turnBack + ((side * runs + long) * rings + ring) * valences + this.valence(corners.a[c]));
      } else turned = this.bit(turnAgain + side);
      if (turned) {
        moving = !moving;
        ++turns;
        run = 0;
      }
      ++run;
      corners.moves[c] = moving;
    }
  }

  private get splitNumber(): number {
    return this.child + 1; // 0 is never one
  }
  private noteStays(): void {
    this.staysNow = this.splitNumber;
    const { corners } = this;
    for (let i = 0; i < corners.count; ++i)
      if (!corners.moves[i]) this.stays.data[corners.wedge[i]] = this.staysNow;
  }
  /** The child's wedge at a corner that moves: the one that corners of the same wedge got before. */
  private codeTarget(i: number): void {
    if (this.staysNow !== this.splitNumber) this.noteStays();
    const wedge = this.corners.wedge[i];
    const known = this.mapped.data[wedge] === this.splitNumber;
    const expected = known ? this.mapTarget.data[wedge] : -1;
    const asExpected = this.bit(targetExpected + (known ? 1 : 0));
    let target = -1;
    if (asExpected && known) target = expected;
    else if (!asExpected)
      for (const w of this.childWedges)
        if (w !== expected && this.bit(listedModel)) {
          target = w;
          break;
        }
    if (target < 0) target = this.newTarget(wedge);
    this.corners.target[i] = target;
    if (!known) {
      this.mapped.data[wedge] = this.splitNumber;
      this.mapTarget.data[wedge] = target;
    }
  }
  private newTarget(wedge: number): number {
    const lost = this.stays.data[wedge] !== this.staysNow;
    const copied = this.bit(targetCopied + (lost ? 1 : 0));
    const w = this.addWedge(this.child, !copied);
    if (copied) this.mesh.copyValues(wedge, w);
    this.childWedges.push(w);
    return w;
  }

  private codeNewFaces(fan: Fan): void {
    if (fan.closed) {
      let last = fan.end - 1;
      for (let i = fan.begin; i < fan.end; last = i++) this.codeEdge(last, i);
    } else {
      this.codeEdge(-1, fan.begin);
      for (let i = fan.begin + 1; i < fan.end; ++i) this.codeEdge(i - 1, i);
      this.codeEdge(fan.end - 1, -1);
    }
  }
  /** New faces at the edge between two corners of a fan, or at an end of an open one. */
  private codeEdge(last: number, next: number): void {
    const { corners } = this;
    const c = next >= 0 ? next : last;
    const x = next >= 0 ? corners.a[c] : corners.b[c];
    const inside = last >= 0 && next >= 0;
    const kind = inside ? (corners.moves[last] !== corners.moves[next] ? 1 : 0) : corners.moves[c] ? 3 : 2;
    for (let n = 0; this.bit(moreFaces + 2 * kind + Math.min(n, 1)); ++n) {
      this.spend(1);
      this.codeFace(x, last, next);
    }
  }
  /** One new face of parent, child and x. */
  private codeFace(x: number, last: number, next: number): void {
    const { corners, mesh } = this;
    const usual = next >= 0 ? corners.moves[next] : !corners.moves[last];
    const flipped = this.bit(flippedModel);
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
        beside = this.bit(besideMoving + (wedge && far ? 2 : far ? 1 : 0));
      }
    }
    const corner = beside ? moving : staying;
    let child = -1;
    if (beside) child = corners.target[moving];
    else if (this.mapped.data[corners.wedge[staying]] === this.splitNumber)
      child = this.mapTarget.data[corners.wedge[staying]];
    this.finishFace(x, usual !== flipped, corners.wedge[corner], child, beside ? mx : sx, seam, corners.face[corner]);
  }
  private codeExtraFace(): void {
    const x = this.number(this.mesh.points);
    if (x === this.parent || x === this.child) this.fail('three points of a face', 'two');
    const forward = this.bits.raw(1) !== 0;
    this.finishFace(x, forward, -1, -1, -1, 1, -1);
  }
  private finishFace(
    x: number,
    forward: boolean,
    expectedParent: number,
    expectedChild: number,
    expectedThird: number,
    seam: number,
    beside: number,
  ): void {
    const v = this.codeWedge(expectedParent, cornerExpected + seam, this.parent);
    const u = this.codeWedge(expectedChild, cornerExpected + 2 + seam, this.child);
    const w = this.codeWedge(expectedThird, cornerExpected + 4 + seam, x);
    const group = this.codeGroup(beside);
    if (forward) this.addFace(v, w, u, group);
    else this.addFace(v, u, w, group);
  }

  // ---- patches

  private seedFace(): void {
    this.fresh.length = 0;
    const points: number[] = [];
    const wedges: number[] = [];
    for (let k = 0; k < 3; ++k) {
      if (this.mesh.points > 0 && this.bit(seedExists)) {
        const p = this.number(this.mesh.points);
        if (k > 0 && (p === points[0] || p === points[k - 1])) this.fail('three points of a face', 'two');
        points.push(p);
        wedges.push(this.codeWedge(-1, listedModel, p));
      } else {
        const before = k > 0 ? points[0] : this.mesh.points - 1;
        for (let i = 0; i < 3; ++i) this.guess[i] = before < 0 ? 0 : this.mesh.places.data[3 * before + i];
        points.push(this.newPatchPoint());
        wedges.push(this.addWedge(points[k], true));
      }
    }
    this.finishPatchFace(wedges[0], wedges[1], wedges[2], -1);
  }
  /** A point at the prediction in `guess`. */
  private newPatchPoint(): number {
    const p = this.addPoint();
    this.positions.values(this.mesh.places.data, 3 * p, this.guess, 3, this.positionBits);
    return p;
  }
  private finishPatchFace(w0: number, w1: number, w2: number, beside: number): void {
    const face = this.addFace(w0, w1, w2, this.codeGroup(beside));
    this.codeFreshValues();
    for (let k = 0; k < 3; ++k) this.gates.push(3 * face + k);
  }
  /** The fan around a point that holds a corner of a face. */
  private fanOf(point: number, face: number): Fan {
    const { corners, fans } = this;
    this.spend(this.mesh.degree.data[point]);
    this.mesh.gather(point, corners, fans);
    for (const fan of fans) for (let i = fan.begin; i < fan.end; ++i) if (corners.face[i] === face) return fan;
    return this.fail('a face at its own point', 'none');
  }
  /** The face behind an open edge, if there is one; false when not. */
  private passGate(gate: number): boolean {
    const { mesh, corners } = this;
    const face = Math.floor(gate / 3);
    const corner = gate - 3 * face;
    const wa = mesh.wedgeAt(face, corner);
    const wb = mesh.wedgeAt(face, corner + 1);
    const [a, b, d] = [0, 1, 2].map((k) => mesh.pointAt(face, corner + k));
    const atA = this.fanOf(a, face);
    if (atA.closed || corners.face[atA.begin] !== face) return false; // the edge has two faces already
    const sizeA = Math.min(atA.end - atA.begin, 8) - 1;
    const l = atA.end - 1;
    const left = { b: corners.b[l], wedge: mesh.wedgeAt(corners.face[l], corners.corner[l] + 2) };
    const atB = this.fanOf(b, face);
    const sizeB = Math.min(atB.end - atB.begin, 8) - 1;
    const r = atB.begin;
    const right = { a: corners.a[r], wedge: mesh.wedgeAt(corners.face[r], corners.corner[r] + 1) };
    const fans = 8 * sizeA + sizeB;
    if (!this.bit(gateOpen + fans)) return false;
    this.fresh.length = 0;
    const newB = this.codeWedge(wb, patchExpected, b);
    const newA = this.codeWedge(wa, patchExpected + 1, a);
    const c = this.codeThird(a, b, d, left, right, fans);
    this.finishPatchFace(newB, newA, c, face);
    return true;
  }
  private codeThird(
    a: number,
    b: number,
    d: number,
    left: { b: number; wedge: number },
    right: { a: number; wedge: number },
    fans: number,
  ): number {
    const places = this.mesh.places.data;
    if (this.bit(thirdNew + fans)) {
      for (let k = 0; k < 3; ++k) this.guess[k] = places[3 * a + k] + places[3 * b + k] - places[3 * d + k];
      return this.addWedge(this.newPatchPoint(), true);
    }
    if (left.b !== b && this.bit(thirdLeft + fans)) return this.codeWedge(left.wedge, patchExpected + 2, left.b);
    if (right.a !== a && right.a !== left.b && this.bit(thirdRight))
      return this.codeWedge(right.wedge, patchExpected + 3, right.a);
    const p = this.number(this.mesh.points);
    if (p === a || p === b) this.fail('three points of a face', 'two');
    return this.codeWedge(-1, listedModel, p);
  }

  // ---- values

  private predictPoint(u: number): void {
    const { mesh, guess } = this;
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
    for (let k = 0; k < 3; ++k) guess[k] = count > 0 ? roundedMean(sums[k], count) : places[3 * this.parent + k];
    this.positions.values(places, 3 * u, guess, 3, this.positionBits);
  }

  private codeFreshValues(): void {
    for (const w of this.fresh) {
      const sibling = this.lookAround(w);
      for (let k = 0; k < this.attributes.length; ++k) {
        const { components, bits } = this.attributes[k];
        const data = this.mesh.values[k].data;
        if (sibling >= 0 && this.values[k].same()) {
          data.copyWithin(w * components, sibling * components, (sibling + 1) * components);
          continue;
        }
        this.predictValue(k, sibling);
        this.values[k].values(data, w * components, this.guess, components, bits);
      }
      this.pending.data[w] = 0;
    }
    this.fresh.length = 0;
  }
  /** Fills `beside` with the wedges beside w in its chart; gives another wedge of its point, or -1. */
  private lookAround(w: number): number {
    const { mesh, beside } = this;
    const p = mesh.wedgePoint.data[w];
    let sibling = -1;
    beside.length = 0;
    this.spend(mesh.degree.data[p]);
    for (let c = mesh.head.data[p]; c >= 0; c = mesh.nextCorner(c)) {
      const own = mesh.faces.data[c];
      if (own !== w) {
        if (sibling < 0 && !this.pending.data[own]) sibling = own;
        continue;
      }
      const face = Math.floor(c / 3);
      for (let k = 1; k <= 2; ++k) {
        const other = mesh.wedgeAt(face, c - 3 * face + k);
        if (!this.pending.data[other]) beside.push(other);
      }
    }
    return sibling;
  }
  /** Leaves in `guess` the mean of the wedges beside. */
  private predictValue(k: number, sibling: number): void {
    const { beside, guess, mesh } = this;
    if (beside.length === 0) {
      if (sibling >= 0) beside.push(sibling);
      else if (this.parent >= 0 && this.corners.count > 0) beside.push(this.corners.wedge[0]);
    }
    guess.fill(0);
    if (beside.length === 0) return;
    const { normal, components, bits } = this.attributes[k];
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
