import { splitBelow, splitLongest, splitPrior, splitSteps, splitValueLimit } from '../shared_numbers';

// The entropy decoder of mesh/stream.bin: format/split/split_element_codec.h, with 32-bit numbers.

/** Adaptive probabilities that a bit is 1, by index. */
export class BitModels {
  readonly p: Uint16Array;
  readonly seen: Uint8Array;
  constructor(count: number, readonly limit: number) {
    this.p = new Uint16Array(count).fill(0x8000);
    this.seen = new Uint8Array(count);
  }
}

const weights =
  Uint32Array.from({ length: 256 }, (_, seen) => Math.floor(65535 / (seen + 2)));

/** Decodes bits; behind the end of the bytes are zeros. */
export class BitDecoder {
  private at_ = 0;
  private range_ = 0xffffffff;
  private code_ = 0;
  constructor(private readonly bytes_: Uint8Array) {
    for (let i = 0; i < 4; ++i) this.code_ = ((this.code_ << 8) | this.next_()) >>> 0;
  }
  private next_(): number {
    return this.at_ < this.bytes_.length ? this.bytes_[this.at_++] : 0;
  }
  private decodeBit_(odds: number): boolean {
    const bound = (this.range_ >>> 12) * odds;
    const bit = this.code_ < bound;
    if (bit) this.range_ = bound;
    else {
      this.code_ -= bound;
      this.range_ -= bound;
    }
    while (this.range_ < 0x1000000) {
      this.range_ = (this.range_ << 8) >>> 0;
      this.code_ = ((this.code_ << 8) | this.next_()) >>> 0;
    }
    return bit;
  }
  bit(models: BitModels, i: number): boolean {
    const p = models.p[i];
    const odds = p >> 4;
    const bit = this.decodeBit_(odds < 1 ? 1 : odds);
    const seen = models.seen[i];
    const weight = weights[seen];
    models.p[i] = bit ? p + (((65535 - p) * weight) >>> 16) : p - ((p * weight) >>> 16);
    if (seen < models.limit) models.seen[i] = seen + 1;
    return bit;
  }
  /** `count` bits at even odds, highest first. */
  raw(count: number): number {
    let value = 0;
    for (let i = 0; i < count; ++i) value = value * 2 + (this.decodeBit_(2048) ? 1 : 0);
    return value;
  }
}

/** Number of models of one part of values. */
export const valueModelCount = 4 * splitSteps + 3 * splitBelow + 1;

/** Decodes the values of one part. Where the part was left out every residual is 0. */
export class ValueDecoder {
  private present_ = false;
  private bits_ = new BitDecoder(new Uint8Array(0));
  private readonly models_ = new BitModels(valueModelCount, splitValueLimit);
  private readonly mean_ = new Int32Array(4);

  start(bytes: Uint8Array, models: Uint8Array): void {
    this.present_ = bytes.length > 0;
    if (!this.present_) return;
    for (let i = 0; i < models.length; ++i) this.models_.p[i] = models[i] << 8;
    this.models_.seen.fill(splitPrior);
    this.mean_.fill(bytes[0] * 2);
    this.bits_ = new BitDecoder(bytes.subarray(1));
  }
  /** Whether another wedge of the point has the same value. */
  same(): boolean {
    return this.present_ && this.bits_.bit(this.models_, valueModelCount - 1);
  }
  /** Writes `components` numbers at out[at]: prediction and residual. */
  values(out: Int32Array, at: number, guess: ArrayLike<number>, components: number, bits: number): void {
    const largest = 2 ** bits - 1;
    for (let i = 0; i < components; ++i) {
      const g = guess[i];
      const clipped = g < 0 ? 0 : g > largest ? largest : g;
      out[at + i] = (clipped + (this.present_ ? this.residual_(i) : 0)) & largest;
    }
  }
  private residual_(component: number): number {
    const length = this.length_(this.mean_[component]);
    this.mean_[component] += (length * 16 - this.mean_[component]) >> 3;
    if (length === 0) return 0;
    const { bits_: bits, models_: models } = this;
    const row = Math.min(length, splitBelow - 1);
    let coded = 1;
    let left = length - 1;
    if (left > 0) {
      coded = coded * 2 + (bits.bit(models, 4 * splitSteps + row) ? 1 : 0);
      --left;
    }
    if (left > 0) {
      coded = coded * 2 + (bits.bit(models, 4 * splitSteps + splitBelow + 2 * row + (coded & 1)) ? 1 : 0);
      --left;
    }
    if (left > 0) coded = coded * 2 ** left + bits.raw(left);
    return bits.raw(1) ? -coded : coded;
  }
  private length_(mean: number): number {
    const middle = mean >> 4;
    const row = ((mean >> 2) & 3) * splitSteps;
    const longer = (than: number): boolean => {
      const step = Math.min(Math.max(than - middle + 10, 0), splitSteps - 1);
      return this.bits_.bit(this.models_, row + step);
    };
    let at = Math.min(Math.max(middle - 2, 0), splitLongest - 1);
    if (longer(at)) {
      do ++at;
      while (at < splitLongest && longer(at));
    } else while (at > 0 && !longer(at - 1)) --at;
    return at;
  }
}
