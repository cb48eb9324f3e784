import type { ValueDecoder } from './split_coder';
import type { SplitMesh } from './split_mesh';
import * as m from './split_models';
import { SplitPatches } from './split_patches';
import { type SplitLimits, SplitState } from './split_state';
import { type CodedAttribute, SplitValues } from './split_values';
import { SplitVertices } from './split_vertices';

/** The reader's side of format/split/codec/split_codec.h: points are asked in the same order, every decision is read from the stream. */
export class SplitCodec {
  private readonly state_: SplitState;
  private readonly vertices_: SplitVertices;
  private readonly patches_: SplitPatches;
  private lastAnswer_ = false;
  private fruitless_ = false; // nobody has split since all points were queued

  constructor(
    mesh: SplitMesh,
    attributes: readonly CodedAttribute[],
    positionBits: number,
    groups: number,
    limits: SplitLimits,
    positions: ValueDecoder,
    values: readonly ValueDecoder[],
  ) {
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
    const model = m.ask + ((degree * 4 + (asked & 3)) * 2 + ((asked >> 2) & 1)) * 2 + (this.lastAnswer_ ? 1 : 0);
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
