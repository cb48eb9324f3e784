import type { ValueDecoder } from './split_coder';
import { none } from './split_mesh';
import type { SplitState } from './split_state';

// Unit vectors as points of an octahedron: format/split/split_stream.cpp.

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
/** Code of the direction of a vector, each coordinate rounded towards zero. */
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

/** Attributes as the codec sees them. */
export interface CodedAttribute {
  normal: boolean;
  components: number;
  bits: number;
}

const roundedMean = (total: number, count: number): number => Math.trunc((2 * total + count) / (2 * count));

/** Positions of points and values of wedges: a prediction from what stands beside, and a residual. */
export class SplitValues {
  private readonly beside_: number[] = []; // wedges

  constructor(
    private readonly state_: SplitState,
    private readonly attributes_: readonly CodedAttribute[],
    private readonly positionBits_: number,
    private readonly positions_: ValueDecoder,
    private readonly values_: readonly ValueDecoder[],
  ) {}

  /** The position of a point whose prediction stands in `guess`. */
  codePosition(p: number): void {
    this.positions_.values(this.state_.mesh.places.data, 3 * p, this.state_.guess, 3, this.positionBits_);
  }
  /** The position of the new point of a split, near the mean of the points beside. */
  codeSplitPosition(u: number): void {
    const { mesh, guess, parent } = this.state_;
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
    for (let k = 0; k < 3; ++k) guess[k] = count > 0 ? roundedMean(sums[k], count) : places[3 * parent + k];
    this.codePosition(u);
  }

  /** The values of all fresh wedges. */
  codeFreshValues(): void {
    const { fresh, mesh, guess, wedges } = this.state_;
    for (const w of fresh) {
      const sibling = this.lookAround_(w);
      for (let k = 0; k < this.attributes_.length; ++k) {
        const { components, bits } = this.attributes_[k];
        const data = mesh.values[k].data;
        if (sibling !== none && this.values_[k].same()) {
          data.copyWithin(w * components, sibling * components, (sibling + 1) * components);
          continue;
        }
        this.predictValue_(k, sibling);
        this.values_[k].values(data, w * components, guess, components, bits);
      }
      wedges.pending.data[w] = 0;
    }
    fresh.length = 0;
  }
  /** Fills `beside` with the wedges beside w in its chart; gives another wedge of its point, or none. */
  private lookAround_(w: number): number {
    const { beside_: beside, state_: { mesh, wedges } } = this;
    const p = mesh.wedgePoint.data[w];
    let sibling = none;
    beside.length = 0;
    this.state_.countWork(mesh.degree.data[p]);
    for (let c = mesh.head.data[p]; c >= 0; c = mesh.nextCorner(c)) {
      const there = mesh.faces.data[c];
      if (there !== w) {
        if (sibling === none && !wedges.pending.data[there]) sibling = there;
        continue;
      }
      const face = Math.floor(c / 3);
      for (let k = 1; k <= 2; ++k) {
        const other = mesh.wedgeAt(face, c - 3 * face + k);
        if (!wedges.pending.data[other]) beside.push(other);
      }
    }
    return sibling;
  }
  /** Leaves in `guess` the mean of the wedges beside. */
  private predictValue_(k: number, sibling: number): void {
    const { beside_: beside, state_: { guess, mesh, parent, corners } } = this;
    if (beside.length === 0) {
      if (sibling !== none) beside.push(sibling);
      else if (parent !== none && corners.count > 0) beside.push(corners.wedge[0]);
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
