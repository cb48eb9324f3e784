import { Growing } from './split_mesh';

/** Points that wait to be asked whether they split, in the order in which they joined; each waits once. */
export class SplitQueue {
  /** By point: how often the point was asked without a split (3: or more often); 4: the point split the last time. */
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
