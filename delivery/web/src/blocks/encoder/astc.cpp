#include "delivery/web/src/blocks/encoder/block.h"

// ASTC 4 x 4, LDR: Khronos Data Format Specification, section 23. A texel has a weight of its own in every
// block.

/** Ends of 192 steps: three times 6 bits. Value by code, and the code that comes closest to a value. */
static u8 value_of[192], code_of[256], trits_of[243];

static void prepare_trits(void) {
  EACH(t, 256) {
    int c, v[5];
    if ((t >> 2 & 7) == 7) {
      c = (t >> 5 & 7) << 2 | (t & 3), v[4] = v[3] = 2;
    } else {
      c = t & 31;
      if ((t >> 5 & 3) == 3)
        v[4] = 2, v[3] = t >> 7;
      else
        v[4] = t >> 7, v[3] = t >> 5 & 3;
    }
    if ((c & 3) == 3)
      v[2] = 2, v[1] = c >> 4 & 1, v[0] = (c >> 3 & 1) << 1 | ((c >> 2) & ~(c >> 3) & 1);
    else if ((c >> 2 & 3) == 3)
      v[2] = 2, v[1] = 2, v[0] = c & 3;
    else
      v[2] = c >> 4 & 1, v[1] = c >> 2 & 3, v[0] = (c >> 1 & 1) << 1 | (c & ~(c >> 1) & 1);
    const int number = v[0] + 3 * v[1] + 9 * v[2] + 27 * v[3] + 81 * v[4];
    // Several stand for the same: the one without high bits can be cut off.
    if (!trits_of[number]) trits_of[number] = (u8)t;
  }
}

void prepare_astc(void) {
  if (value_of[191]) return;
  EACH(code, 192) {
    const int bits = code & 63, trit = code >> 6;
    const int a = bits & 1 ? 0x1ff : 0, b = (bits >> 1) << 4 | bits >> 5;
    const int v = (trit * 5 + b) ^ a;
    value_of[code] = (u8)((a & 0x80) | v >> 2);
  }
  EACH(v, 256) {
    int best = 1 << 20;
    EACH(code, 192) {
      const int off = value_of[code] - v;
      if (off * off < best) best = off * off, code_of[v] = (u8)code;
    }
  }
  prepare_trits();
}

/** The 64 bits of 16 weights, from the top of the block downwards, and what stands below. */
static void write_weighed(Bits* o, const i4 at[4], int turned, int bits, int stride, int offset) {
  EACH(i, 16) {
    const u32 v = (u32)(turned ? (1 << bits) - 1 - at[i >> 2][i & 3] : at[i >> 2][i & 3]);
    EACH(k, bits) {
      const int from_top = bits * (stride * i + offset) + k, to = 127 - from_top;
      o->words[to >> 6] |= (u64)(v >> k & 1) << (to & 63);
    }
  }
}

/** A block of one colour. */
static void flat_astc(const Block* b, u8* out, int two) {
  u64 word = 0;
  EACH(c, 4) {
    const int from = two ? (c == 3 ? 1 : 0) : c;
    const u64 v = c == 3 && !two ? 255 : (u64)(b->c[from][0][0] + 0.5f);
    word |= (v << 8 | v) << (16 * c);
  }
  store(out, 0xfffffffffffffdfcull);
  store(out + 8, word);
}
static int is_flat(const Block* b, int channels) {
  EACH(c, channels) {
    const f4 first = f4_of(b->c[c][0][0]);
    EACH(y, 4) {
      const i4 same = b->c[c][y] == first;
      if (!(same[0] & same[1] & same[2] & same[3])) return 0;
    }
  }
  return 1;
}

void encode_astc(const Block* b, u8* out) {
  if (is_flat(b, 3)) return flat_astc(b, out, 0);
  Line line = main_line(b);
  int codes[2][3];
  i4 at[4];
  float best = 1e30f, sums[2] = {0, 0};
  EACH(round, 3) {
    i4 now[4];
    int code[2][3];
    float sum[2] = {0, 0};
    EACH(e, 2) EACH(c, 3) {
      code[e][c] = code_of[(int)(line.ends[e][c] + 0.5f)];
      line.ends[e][c] = value_of[code[e][c]];
      sum[e] += line.ends[e][c];
    }
    const float error = place(b, line.ends, 15, now);
    if (error >= best) break;
    best = error;
    EACH(e, 2) {
      sums[e] = sum[e];
      EACH(c, 3) codes[e][c] = code[e][c];
    }
    EACH(y, 4) at[y] = now[y];
    if (!fitted_line(b, now, 15, &line)) break;
  }
  const int turned = sums[0] > sums[1];  // the second end must be the brighter one
  Bits o = {};
  put(&o, 0x242, 11);  // 4 x 4 weights of 4 bits
  put(&o, 8 << 2, 6);  // one partition; ends are RGB
  int v[6], trits = 0;
  EACH(i, 6) v[i] = codes[(i & 1) ^ turned][i >> 1];
  for (int i = 4; i >= 0; --i) trits = 3 * trits + (v[i] >> 6);
  const u32 t = trits_of[trits];
  const int counts[5] = {2, 2, 1, 2, 1}, shifts[5] = {0, 2, 4, 5, 7};
  EACH(i, 5) {
    put(&o, (u64)(v[i] & 63), 6);
    put(&o, t >> shifts[i] & ((1u << counts[i]) - 1), counts[i]);
  }
  put(&o, (u64)(v[5] & 63), 6);
  put(&o, (u64)(v[5] >> 6), 2);
  write_weighed(&o, at, turned, 4, 1, 0);
  store(out, o.words[0]);
  store(out + 8, o.words[1]);
}

/** Steps of one channel from its least to its greatest value. Gives the squared error. */
static float place_channel(const f4 v[4], float last, int ends[2], i4 at[4]) {
  const float low = least(min4(min4(v[0], v[1]), min4(v[2], v[3]))),
              high = most(max4(max4(v[0], v[1]), max4(v[2], v[3])));
  ends[0] = (int)(low + 0.5f), ends[1] = (int)(high + 0.5f);
  const float scale = high > low ? last / (high - low) : 0;
  f4 error = f4_of(0);
  EACH(y, 4) {
    const f4 off = v[y] - low - steps4((v[y] - low) * scale, f4_of(last), &at[y]) * ((high - low) / last);
    error += off * off;
  }
  return sum4(error);
}

void encode_astc_normal(const Block* b, u8* out) {
  if (is_flat(b, 2)) return flat_astc(b, out, 1);
  // Both channels by weights of 2 bits each, or one line by weights of 4 bits: whichever is closer.
  int ends[2][2];
  i4 at[2][4];
  float apart = 0;
  EACH(c, 2) apart += place_channel(b->c[c], 3, ends[c], at[c]);
  Block both = *b;
  EACH(y, 4) both.c[2][y] = f4_of(0);
  Line line = main_line(&both);
  i4 whole[2];
  EACH(e, 2) line.ends[e] = steps4(line.ends[e], f4_of(255), &whole[e]);
  i4 along[4];
  const int together = place(&both, line.ends, 15, along) <= apart;
  Bits o = {};
  put(&o, together ? 0x242 : 0x442, 11);
  put(&o, 4 << 2, 6);  // one partition; ends are luminance and alpha
  EACH(c, 2) EACH(e, 2) put(&o, together ? (u64)whole[e][c] : (u64)ends[c][e], 8);
  if (together) {
    write_weighed(&o, along, 0, 4, 1, 0);
  } else {
    EACH(c, 2) write_weighed(&o, at[c], 0, 2, 2, c);
    o.words[0] |= 3ull << 62;  // the second weights are alpha's
  }
  store(out, o.words[0]);
  store(out + 8, o.words[1]);
}
