#include "delivery/web/src/blocks/encoder/block.h"

// BC1, BC3, BC5, BC7: Direct3D 11 functional specification, section 19.5; Khronos Data Format Specification,
// sections 18 to 20.

// ---- BC1

/** Ends of 5 and 6 bits whose mean, 2 of the first and 1 of the second, comes closest to a value. */
static u8 flat5[256][2], flat6[256][2];

static int whole(int v, int bits) { return bits == 5 ? v << 3 | v >> 2 : v << 2 | v >> 4; }

static void prepare_flat(u8 flat[256][2], int bits) {
  EACH(v, 256) {
    int best = 1 << 20;
    EACH(a, 1 << bits) EACH(b, 1 << bits) {
      const int off = 2 * whole(a, bits) + whole(b, bits) - 3 * v;
      // Of equals the ends that lie close: decoders may round as they like.
      const int error = off * off * 64 + (a > b ? a - b : b - a);
      if (error < best) best = error, flat[v][0] = (u8)a, flat[v][1] = (u8)b;
    }
  }
}
void prepare_bc1(void) {
  if (flat5[255][0]) return;
  prepare_flat(flat5, 5);
  prepare_flat(flat6, 6);
}

static u32 to_565(f4* c) {
  const f4 last = {31, 63, 31, 0};
  i4 q;
  steps4(*c * (last * (1.0f / 255)), last, &q);
  *c = __builtin_convertvector(q * i4{8, 4, 8, 0} + ((q * i4{16, 4, 16, 0}) >> 6), f4);
  return (u32)(q[0] << 11 | q[1] << 5 | q[2]);
}

/** Colours of one value each. */
[[gnu::noinline]] static u64 flat_bc1(const Block* b, int from, int to) {
  u32 word[2] = {0, 0};
  EACH(c, 3) EACH(e, 2) {
    const int v = c >= from && c < to ? (int)(b->c[c][0][0] + 0.5f) : 0;
    word[e] = word[e] << (c == 1 ? 6 : 5) | (c == 1 ? flat6 : flat5)[v][e];
  }
  u64 at = 0xaaaaaaaa;  // 2 of the first, 1 of the second
  if (word[0] < word[1]) {
    const u32 first = word[0];
    word[0] = word[1], word[1] = first, at = 0xffffffff;
  } else if (word[0] == word[1]) {
    at = 0;
  }
  return at << 32 | word[1] << 16 | word[0];
}

[[gnu::noinline]] static u64 write_bc1(u32 first, u32 second, const i4 at[4]) {
  // Steps from the first end on, as BC1 numbers them: 0, 2, 3, 1. The first end is the larger number: with 3
  // colours otherwise.
  if (first == second) return (u64)second << 16 | first;
  const int swapped = first < second;
  i4 codes = {};
  EACH(y, 4) {
    const i4 step = swapped ? 3 - at[y] : at[y], code = step == 0   ? step
                                                        : step == 3 ? i4{1, 1, 1, 1}
                                                                    : step + 1;
    codes |= (code * i4{1, 4, 16, 64}) << (8 * y);
  }
  return (u64)sum4(codes) << 32 | (swapped ? first << 16 | second : second << 16 | first);
}

/** One refinement gains 0.6 to 1.5 dB, a second one 0.05 to 0.25 for a sixth of the speed. */
constexpr int kRounds = 2;

template <int kFrom = 0, int kTo = 3>
static u64 colours_bc1(const Block* b) {
  Line line = main_line<kFrom, kTo>(b);
  const f4 d = line.ends[1] - line.ends[0];
  if (sum4(d * d) < 0.5f) return flat_bc1(b, kFrom, kTo);
  float best = 1e30f;
  u32 ends[2] = {};
  i4 at[2][4];
  int chosen = 0;
  EACH(round, kRounds) {
    const u32 first = to_565(&line.ends[0]), second = to_565(&line.ends[1]);
    i4* now = at[round & 1];
    const float error = place<kFrom, kTo>(b, line.ends, 3, now);
    if (error >= best) break;
    best = error, chosen = round & 1, ends[0] = first, ends[1] = second;
    if (round + 1 == kRounds || !fitted_line<kFrom, kTo>(b, now, 3, &line)) break;
  }
  return write_bc1(ends[0], ends[1], at[chosen]);
}
void encode_bc1(const Block* b, u8* out) { store(out, colours_bc1(b)); }

// ---- BC3, BC5

/** One channel in 8 steps. */
static u64 channel(const f4 v[4]) {
  float low, high;
  range_of(v, &low, &high);
  const u32 a = (u32)(high + 0.5f), z = (u32)(low + 0.5f);
  u64 codes = 0;
  if (a > z) EACH(y, 4) {
      // Steps from the larger value on, numbered 0, 2 .. 7, 1.
      i4 step;
      steps4((high - v[y]) * (7 / (high - low)), f4_of(7), &step);
      const i4 code = step == 0 ? step : step == 7 ? i4{1, 1, 1, 1} : step + 1;
      codes |= (u64)(u32)(code[0] | code[1] << 3 | code[2] << 6 | code[3] << 9) << (12 * y);
    }
  return codes << 16 | z << 8 | a;
}
void encode_bc5(const Block* b, u8* out) {
  store(out, channel(b->c[0]));
  store(out + 8, channel(b->c[1]));
}
void encode_bc3_normal(const Block* b, u8* out) {
  store(out, channel(b->c[0]));
  store(out + 8, colours_bc1<1, 2>(b));
}

// ---- BC7, mode 6: one line of 16 steps, ends of 7 bits and a last bit that the channels of an end share

/** Quantises an end; gives its last bit. */
static int to_7_bits(f4* c) {
  f4 of[2];
  float error[2];
  EACH(p, 2) {
    i4 q;
    of[p] =
        steps4((*c - (float)p) * 0.5f, f4{127, 127, 127, 0}, &q) * 2 + f4{(float)p, (float)p, (float)p, 0};
    error[p] = sum4((of[p] - *c) * (of[p] - *c));
  }
  const int bit = error[1] < error[0];
  *c = of[bit];
  return bit;
}

void encode_bc7(const Block* b, u8* out) {
  Line line = main_line(b);
  f4 ends[2];
  int bits[2] = {};
  i4 at[4];
  float best = 1e30f;
  EACH(round, 3) {
    i4 now[4];
    const int p[2] = {to_7_bits(&line.ends[0]), to_7_bits(&line.ends[1])};
    const float error = place(b, line.ends, 15, now);
    if (error >= best) break;
    best = error;
    EACH(e, 2) ends[e] = line.ends[e], bits[e] = p[e];
    EACH(y, 4) at[y] = now[y];
    if (error == 0 || !fitted_line(b, now, 15, &line)) break;
  }
  const int swapped = at[0][0] >= 8;  // the first texel has 3 bits
  Bits o = {};
  put(&o, 1 << 6, 7);
  EACH(c, 3) EACH(e, 2) put(&o, (u64)(int)ends[e ^ swapped][c] >> 1, 7);
  put(&o, 127 | 127 << 7, 14);  // alpha
  put(&o, (u64)bits[swapped], 1);
  put(&o, (u64)bits[!swapped], 1);
  EACH(y, 4) {
    const i4 code = swapped ? 15 - at[y] : at[y];
    EACH(x, 4) put(&o, (u64)code[x], x + y ? 4 : 3);
  }
  store(out, o.words[0]);
  store(out + 8, o.words[1]);
}
