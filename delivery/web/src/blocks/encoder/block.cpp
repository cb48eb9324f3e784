#include "delivery/web/src/blocks/encoder/block.h"

template <int kFrom, int kTo>
Line main_line(const Block* b) {
  if constexpr (kTo - kFrom == 1) {
    Line line = {};
    float low, high;
    range_of(b->c[kFrom], &low, &high);
    line.ends[0][kFrom] = low, line.ends[1][kFrom] = high;
    return line;
  }
  float mean[3], cov[6] = {0, 0, 0, 0, 0, 0};
  f4 d[3][4];
  EACH(c, 3) {
    mean[c] = sum4((b->c[c][0] + b->c[c][1]) + (b->c[c][2] + b->c[c][3])) / 16;
    EACH(y, 4) d[c][y] = b->c[c][y] - mean[c];
  }
  for (int i = 0, n = 0; i < 3; ++i)
    for (int j = i; j < 3; ++j) {
      f4 s = f4_of(0);
      EACH(y, 4) s += d[i][y] * d[j][y];
      cov[n++] = sum4(s);
    }
  // Power iteration from the row of the largest variance; four rounds: eight gain less than 0.02 dB.
  const f4 rows[3] = {{cov[0], cov[1], cov[2], 0}, {cov[1], cov[3], cov[4], 0}, {cov[2], cov[4], cov[5], 0}};
  f4 v = rows[cov[0] >= cov[3] && cov[0] >= cov[5] ? 0 : cov[3] >= cov[5] ? 1 : 2];
  EACH(round, 4) v = rows[0] * v[0] + rows[1] * v[1] + rows[2] * v[2];
  const float longest = most(v < 0 ? -v : v);
  const f4 middle = {mean[0], mean[1], mean[2], 0};
  if (!(longest > 0)) return {{middle, middle}};
  v *= 1 / longest;
  f4 low = f4_of(1e9f), high = f4_of(-1e9f);
  EACH(y, 4) {
    const f4 t = d[0][y] * v[0] + d[1][y] * v[1] + d[2][y] * v[2];
    low = min4(low, t), high = max4(high, t);
  }
  const f4 step = v * (1 / sum4(v * v));
  return {{in_range(middle + step * least(low)), in_range(middle + step * most(high))}};
}

template <int kFrom, int kTo>
int fitted_line(const Block* b, const i4 at[4], float last, Line* line) {
  f4 s1 = f4_of(0), s2 = s1, w[4];
  EACH(y, 4) {
    w[y] = __builtin_convertvector(at[y], f4) * (1 / last);
    s1 += w[y], s2 += w[y] * w[y];
  }
  const float sum = sum4(s1), square = sum4(s2), aa = 16 - 2 * sum + square, ab = sum - square,
              det = aa * square - ab * ab;
  if (det < 0.05f) return 0;
  f4 first = {}, second = {};
  for (int c = kFrom; c < kTo; ++c) {
    f4 all = f4_of(0), weighed = all;
    EACH(y, 4) all += b->c[c][y], weighed += b->c[c][y] * w[y];
    second[c] = sum4(weighed), first[c] = sum4(all) - second[c];
  }
  line->ends[0] = in_range((first * square - second * ab) * (1 / det));
  line->ends[1] = in_range((second * aa - first * ab) * (1 / det));
  return 1;
}

template <int kFrom, int kTo>
float place(const Block* b, const f4 ends[2], float last, i4 at[4]) {
  const f4 d = ends[1] - ends[0];
  const float length = sum4(d * d);
  const float scale = length > 0 ? last / length : 0;
  f4 error = f4_of(0);
  EACH(y, 4) {
    f4 from[3], t = f4_of(0);
    for (int c = kFrom; c < kTo; ++c) from[c] = b->c[c][y] - ends[0][c], t += from[c] * d[c];
    t = steps4(t * scale, f4_of(last), &at[y]) * (1 / last);
    for (int c = kFrom; c < kTo; ++c) {
      const f4 off = from[c] - t * d[c];
      error += off * off;
    }
  }
  return sum4(error);
}

template Line main_line<0, 3>(const Block*);
template Line main_line<1, 2>(const Block*);
template int fitted_line<0, 3>(const Block*, const i4[4], float, Line*);
template int fitted_line<1, 2>(const Block*, const i4[4], float, Line*);
template float place<0, 3>(const Block*, const f4[2], float, i4[4]);
template float place<1, 2>(const Block*, const f4[2], float, i4[4]);
