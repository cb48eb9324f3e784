import { FormatError } from '../errors';
import { BitDecoder, BitModels } from './split_coder';
import { Corners, type Fan, Growing, type SplitMesh, none } from './split_mesh';
import * as m from './split_models';

/** Points that wait to be asked whether they split, in the order in which they joined; each waits once. */
class SplitQueue {
  /** By point: how often it was asked without a split (3: or more often); 4: it split the last time. */
  readonly asks = new Growing();
  private readonly queued_ = new Growing(); // by point
  private readonly points_: number[] = [];
  private next_ = 0;

  addPoint(): void {
    this.asks.push(0);
    this.queued_.push(0);
  }
  get isEmpty(): boolean {
    return this.next_ === this.points_.length;
  }
  push(point: number): void {
    if (this.queued_.data[point]) return;
    this.queued_.data[point] = 1;
    this.points_.push(point);
  }
  shift(): number {
    const point = this.points_[this.next_++];
    this.queued_.data[point] = 0;
    return point;
  }
  /** Queues all points of the mesh. */
  refill(points: number): void {
    this.points_.length = 0;
    this.next_ = 0;
    for (let p = 0; p < points; ++p) this.push(p);
  }
  /** Empties the queue, and forgets who was asked. */
  reset(): void {
    this.points_.length = 0;
    this.next_ = 0;
    this.queued_.data.fill(0);
    this.asks.data.fill(0);
  }
  /** Frees the room of points that wait no more. */
  compact(): void {
    if (this.next_ <= 65536 || this.next_ * 2 <= this.points_.length) return;
    this.points_.splice(0, this.next_);
    this.next_ = 0;
  }
}

/** A mesh never grows beyond these counts. */
export interface SplitLimits {
  points: number;
  wedges: number;
  faces: number;
}

const bitWidth = (value: number): number => (value === 0 ? 0 : 32 - Math.clz32(value));

/** Notes about each wedge besides the mesh. */
class WedgeNotes {
  /** 1: the values of the wedge are still to come. */
  readonly pending = new Growing();
  /** Number of the list that last offered the wedge. */
  readonly listed = new Growing();
  /** Number of the split that last gave corners of the wedge to `mapTarget`. */
  readonly mapped = new Growing();
  readonly mapTarget = new Growing();
  /** Number of the split in which a corner of the wedge last stayed. */
  readonly stays = new Growing();

  add(pending: boolean): void {
    this.pending.push(pending ? 1 : 0);
    for (const notes of [this.listed, this.mapped, this.mapTarget, this.stays]) notes.push(0);
  }
}

/** What splits, patches and values share while a stream is decoded: mesh, bits, the present point. */
export class SplitState {
  /** Corners and fans of the point under way. */
  readonly corners = new Corners();
  readonly fans: Fan[] = [];
  /** Points of the split under way. */
  parent = none;
  child = none;
  readonly childWedges: number[] = [];
  /** Wedges whose values are still to come. */
  readonly fresh: number[] = [];
  /** Prediction of the next position or value. */
  readonly guess = [0, 0, 0, 0];
  readonly wedges = new WedgeNotes();
  readonly queue = new SplitQueue();
  private readonly models_ = new BitModels(m.modelCount, m.limit);
  private bits_ = new BitDecoder(new Uint8Array(0));
  private work_ = 0;
  private list_ = 0; // number of the list of wedges that is offered

  constructor(
    readonly mesh: SplitMesh,
    private readonly groups_: number,
    private readonly limits_: SplitLimits,
  ) {}

  // ---- reading

  /** Connectivity of the next block. */
  start(connectivity: Uint8Array): void {
    this.bits_ = new BitDecoder(connectivity);
  }
  bit(model: number): boolean {
    return this.bits_.bit(this.models_, model);
  }
  /** Bits at even odds. */
  raw(count: number): number {
    return this.bits_.raw(count);
  }
  /** A number below `count`. */
  number(count: number): number {
    const value = this.bits_.raw(bitWidth(count - 1));
    if (value >= count) this.fail('an index that exists');
    return value;
  }
  fail(expected: string, rule = 'S19'): never {
    throw new FormatError('mesh/stream.bin', '', expected, '', rule);
  }
  /** Work is bounded by the mesh, so that few bytes cannot ask many points again and again. */
  countWork(work: number): void {
    this.work_ += work;
    if (this.work_ > 1048576 + 256 * (this.mesh.points + this.mesh.faceCount))
      this.fail('256 steps per point and face', 'S20');
  }

  // ---- points, wedges, faces

  addPoint(): number {
    if (this.mesh.points >= this.limits_.points) this.fail('no more points');
    this.queue.addPoint();
    return this.mesh.addPoint();
  }
  addWedge(point: number, pending: boolean): number {
    if (this.mesh.wedges >= this.limits_.wedges) this.fail('no more wedges');
    const w = this.mesh.addWedge(point);
    this.wedges.add(pending);
    if (pending) this.fresh.push(w);
    return w;
  }
  addFace(w0: number, w1: number, w2: number, group: number): number {
    if (this.mesh.faceCount >= this.limits_.faces) this.fail('no more faces');
    return this.mesh.addFace(w0, w1, w2, group);
  }
  /** The group of a new face: mostly that of the face beside. */
  codeGroup(beside: number): number {
    if (beside !== none && this.bit(m.sameGroup)) return this.mesh.faceGroup.data[beside];
    return this.number(this.groups_);
  }
  /** The wedge of a corner of the face under way: the expected one, one of the point's, or a new one. */
  codeWedge(expected: number, model: number, point: number): number {
    if (expected !== none && this.bit(model)) return expected;
    ++this.list_;
    if (expected !== none) this.wedges.listed.data[expected] = this.list_;
    const found = this.listedWedge_(point);
    if (found !== none) return found;
    const w = this.addWedge(point, true);
    if (point === this.child) this.childWedges.push(w);
    return w;
  }
  private listedWedge_(point: number): number {
    const { corners, mesh } = this;
    if (point === this.parent)
      for (let i = 0; i < corners.count; ++i) if (this.isChosen_(corners.wedge[i])) return corners.wedge[i];
    if (point === this.child) {
      for (const w of this.childWedges) if (this.isChosen_(w)) return w;
      return none;
    }
    this.countWork(mesh.degree.data[point]);
    for (let c = mesh.head.data[point]; c >= 0; c = mesh.nextCorner(c)) {
      const w = mesh.faces.data[c];
      if (this.isChosen_(w)) return w;
    }
    return none;
  }
  /** Whether the stream chooses this wedge of a list; a list offers each wedge once. */
  private isChosen_(w: number): boolean {
    const { listed } = this.wedges;
    if (listed.data[w] === this.list_) return false;
    listed.data[w] = this.list_;
    return this.bit(m.listedModel);
  }
}
