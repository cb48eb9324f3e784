/** No point, wedge, corner or face: SplitMesh::kNone. */
export const none = -1;

/** A typed array that grows. */
export class Growing {
  data: Int32Array;
  length = 0;
  constructor(capacity = 256) {
    this.data = new Int32Array(capacity);
  }
  reserve(length: number): void {
    if (length <= this.data.length) return;
    const data = new Int32Array(Math.max(length, this.data.length * 2));
    data.set(this.data.subarray(0, this.length));
    this.data = data;
  }
  push(value: number): void {
    if (this.length === this.data.length) this.reserve(this.length + 1);
    this.data[this.length++] = value;
  }
  /** Makes room for `count` zeros at the end. */
  extend(count: number): void {
    this.reserve(this.length + count);
    this.data.fill(0, this.length, this.length + count);
    this.length += count;
  }
}

/** Corners at a point, as gather() leaves them; the face is (point, a, b) in its own direction. */
export class Corners {
  readonly face: number[] = [];
  readonly corner: number[] = [];
  readonly a: number[] = [];
  readonly b: number[] = [];
  readonly wedge: number[] = [];
  /** The corner goes to the new point of a split, and gets the wedge `target` there. */
  readonly moves: boolean[] = [];
  readonly target: number[] = [];
  count = 0;
  set(i: number, from: Corners, k: number): void {
    this.face[i] = from.face[k];
    this.corner[i] = from.corner[k];
    this.a[i] = from.a[k];
    this.b[i] = from.b[k];
    this.wedge[i] = from.wedge[k];
    this.moves[i] = false;
    this.target[i] = -1;
  }
}
/** Corners begin .. end, each next to the corner before. A closed fan goes round. */
export interface Fan {
  begin: number;
  end: number;
  closed: boolean;
}

const after = [0, 1, 2, 0, 1];

/** A mesh that vertex splits refine (format/split/split_mesh.h): points and wedges only grow. */
export class SplitMesh {
  readonly places = new Growing(768); // 3 per point
  readonly wedgePoint = new Growing();
  readonly faces = new Growing(768); // 3 wedges per face
  readonly faceGroup = new Growing();
  readonly values: Growing[];
  readonly head = new Growing(); // per point: its first corner
  readonly degree = new Growing();
  private readonly next_ = new Growing(768); // per corner: the next at its point
  private readonly firstA_ = new Growing();
  private readonly countB_ = new Growing();
  private readonly loose_ = new Corners();
  private readonly chain_: number[] = [];
  private readonly taken_: boolean[] = [];

  /** `components`: per attribute, how many numbers each wedge has. */
  constructor(readonly components: readonly number[]) {
    this.values = components.map(() => new Growing());
  }
  get points(): number {
    return this.head.length;
  }
  get wedges(): number {
    return this.wedgePoint.length;
  }
  get faceCount(): number {
    return this.faceGroup.length;
  }

  addPoint(): number {
    this.places.extend(3);
    this.head.push(none);
    this.degree.push(0);
    this.firstA_.push(none);
    this.countB_.push(0);
    return this.head.length - 1;
  }
  addWedge(point: number): number {
    this.wedgePoint.push(point);
    for (let k = 0; k < this.values.length; ++k) this.values[k].extend(this.components[k]);
    return this.wedgePoint.length - 1;
  }
  copyValues(from: number, to: number): void {
    for (let k = 0; k < this.values.length; ++k) {
      const n = this.components[k];
      this.values[k].data.copyWithin(to * n, from * n, from * n + n);
    }
  }
  addFace(w0: number, w1: number, w2: number, group: number): number {
    const face = this.faceGroup.length;
    this.faces.push(w0);
    this.faces.push(w1);
    this.faces.push(w2);
    this.faceGroup.push(group);
    for (let k = 0; k < 3; ++k) {
      const p = this.wedgePoint.data[this.faces.data[3 * face + k]];
      this.next_.push(this.head.data[p]);
      this.head.data[p] = 3 * face + k;
      ++this.degree.data[p];
    }
    return face;
  }
  wedgeAt(face: number, corner: number): number {
    return this.faces.data[3 * face + after[corner]];
  }
  pointAt(face: number, corner: number): number {
    return this.wedgePoint.data[this.faces.data[3 * face + after[corner]]];
  }
  nextCorner(corner: number): number {
    return this.next_.data[corner];
  }

  /** The corners at a point, sorted into fans: open ones first, each in the order of its first corner. */
  gather(point: number, corners: Corners, fans: Fan[]): void {
    const { loose_: loose, chain_: chain, taken_: taken } = this;
    corners.count = 0;
    fans.length = 0;
    let n = 0;
    for (let c = this.head.data[point]; c >= 0; c = this.next_.data[c], ++n) {
      const face = Math.floor(c / 3);
      const corner = c - 3 * face;
      loose.face[n] = face;
      loose.corner[n] = corner;
      loose.a[n] = this.pointAt(face, corner + 1);
      loose.b[n] = this.pointAt(face, corner + 2);
      loose.wedge[n] = this.faces.data[c];
      taken[n] = false;
    }
    const firstA = this.firstA_.data;
    const countB = this.countB_.data;
    for (let i = n - 1; i >= 0; --i) {
      chain[i] = firstA[loose.a[i]];
      firstA[loose.a[i]] = i;
      ++countB[loose.b[i]];
    }
    for (let i = 0; i < n; ++i) if (!taken[i] && countB[loose.a[i]] === 0) this.appendFan_(i, corners, fans);
    for (let i = 0; i < n; ++i) if (!taken[i]) this.appendFan_(i, corners, fans);
    for (let i = 0; i < n; ++i) {
      firstA[loose.a[i]] = none;
      countB[loose.b[i]] = 0;
    }
  }
  /** Appends the fan that begins with a loose corner. */
  private appendFan_(start: number, corners: Corners, fans: Fan[]): void {
    const { loose_: loose, chain_: chain, taken_: taken } = this;
    const firstA = this.firstA_.data;
    const begin = corners.count;
    for (let at = start; at >= 0; ) {
      taken[at] = true;
      corners.set(corners.count++, loose, at);
      const b = loose.b[at];
      while (firstA[b] >= 0 && taken[firstA[b]]) firstA[b] = chain[firstA[b]];
      at = firstA[b];
    }
    const end = corners.count;
    fans.push({ begin, end, closed: corners.a[begin] === corners.b[end - 1] });
  }
  /** Gives the corners that move their target wedges, all of point `to`, which had no corner before. */
  distribute(from: number, to: number, corners: Corners): void {
    const head = this.head.data;
    const degree = this.degree.data;
    head[from] = head[to] = none;
    degree[from] = degree[to] = 0;
    for (let i = corners.count - 1; i >= 0; --i) {
      const id = 3 * corners.face[i] + corners.corner[i];
      const p = corners.moves[i] ? to : from;
      if (corners.moves[i]) this.faces.data[id] = corners.target[i];
      this.next_.data[id] = head[p];
      head[p] = id;
      ++degree[p];
    }
  }
  /** Whether a face's three points are at different places. */
  isVisible(face: number): boolean {
    const a = this.pointAt(face, 0);
    const b = this.pointAt(face, 1);
    const c = this.pointAt(face, 2);
    return !this.samePlace_(a, b) && !this.samePlace_(b, c) && !this.samePlace_(c, a);
  }
  private samePlace_(a: number, b: number): boolean {
    const p = this.places.data;
    return p[3 * a] === p[3 * b] && p[3 * a + 1] === p[3 * b + 1] && p[3 * a + 2] === p[3 * b + 2];
  }
}
