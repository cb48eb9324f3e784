#pragma once

// A block of 4 x 4 texels, and lines through its colours. Compiled for WASM by ../../../build.mjs, without a
// standard library.

typedef unsigned char u8;
typedef unsigned int u32;
typedef unsigned long long u64;
/** Four texels of a row, or four numbers. */
typedef float f4 __attribute__((vector_size(16)));
typedef int i4 __attribute__((vector_size(16)));

/** Rows of red, green, blue, 0 to 255. */
typedef struct {
  f4 c[3][4];
} Block;
/** Two ends of a line of colours, whose fourth number is 0. */
typedef struct {
  f4 ends[2];
} Line;

#define EACH(i, n) for (int i = 0; i < (n); ++i)

static inline float sum4(f4 v) { return (v[0] + v[1]) + (v[2] + v[3]); }
static inline f4 f4_of(float v) { return f4{v, v, v, v}; }
static inline f4 min4(f4 a, f4 b) { return a < b ? a : b; }
static inline f4 max4(f4 a, f4 b) { return a > b ? a : b; }
static inline f4 in_range(f4 v) { return min4(max4(v, f4_of(0)), f4_of(255)); }
/** Rounded, 0 to `most`; `whole` as an integer. Adding 2^23 leaves no fraction: conversions of four numbers
 * are slow in WASM. */
static inline f4 steps4(f4 v, f4 most, i4* whole) {
  const f4 moved = min4(max4(v, f4_of(0)), most) + 8388608.0f;
  *whole = (i4)moved - 0x4b000000;
  return moved - 8388608.0f;
}
static inline u32 sum4(i4 v) { return (u32)((v[0] + v[1]) + (v[2] + v[3])); }
static inline float lesser(float a, float b) { return a < b ? a : b; }
static inline float greater(float a, float b) { return a > b ? a : b; }
static inline float least(f4 v) { return lesser(lesser(v[0], v[1]), lesser(v[2], v[3])); }
static inline float most(f4 v) { return greater(greater(v[0], v[1]), greater(v[2], v[3])); }
/** The least and the greatest of 16 values. */
static inline void range_of(const f4 v[4], float* low, float* high) {
  *low = least(min4(min4(v[0], v[1]), min4(v[2], v[3])));
  *high = most(max4(max4(v[0], v[1]), max4(v[2], v[3])));
}

// Of all channels, or of green alone: BC3 takes half the time then.
/** The line along which the colours differ most; both ends the same where they do not differ. */
template <int kFrom = 0, int kTo = 3>
Line main_line(const Block* block);
/** The line whose steps, `at` of `last`, come closest to the colours; 0 where the steps do not say. */
template <int kFrom = 0, int kTo = 3>
int fitted_line(const Block* block, const i4 at[4], float last, Line* line);
/** Where the texels lie between two colours, in steps 0 to `last`. Gives the squared error. */
template <int kFrom = 0, int kTo = 3>
float place(const Block* block, const f4 ends[2], float last, i4 at[4]);

/** What writes bits from the lowest on. */
typedef struct {
  u64 words[2];
  int at;
} Bits;
static inline void put(Bits* b, u64 value, int count) {
  const int word = b->at >> 6, shift = b->at & 63;
  b->words[word] |= value << shift;
  if (shift + count > 64) b->words[1] |= value >> (64 - shift);
  b->at += count;
}
static inline void store(u8* out, u64 word) { *(u64*)out = word; }
static inline void store_big(u8* out, u64 word) { store(out, __builtin_bswap64(word)); }

/** Each writes a block of 8 or 16 bytes. Two-channel blocks hold red and green, of normals of length 1. */
void encode_bc1(const Block* block, u8* out);
void encode_bc3_normal(const Block* block, u8* out);  // red as alpha, green as green
void encode_bc5(const Block* block, u8* out);
void encode_bc7(const Block* block, u8* out);
void encode_etc2(const Block* block, u8* out);
void encode_astc(const Block* block, u8* out);
void encode_astc_normal(const Block* block, u8* out);  // red as luminance, green as alpha
void prepare_bc1(void);
void prepare_astc(void);
