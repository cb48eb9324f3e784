#include "stages/measure/picture.h"

#include <array>

#if defined(__x86_64__) && defined(__GNUC__)
#include <immintrin.h>
#define TEXMESH_HAS_AVX2_TWIN 1
#endif

namespace texmesh {
namespace {

/// The columns that are not plain, without what lies around them.
PixelSpans::Row shown_columns(const Picture& picture, std::size_t y) {
  const std::size_t side = picture.side_px;
  const Vec3f* linear = picture.linear.data() + y * side;
  const std::uint8_t* covered = picture.covered.data() + y * side;
  const Vec3f plain = picture.linear[0];
  const auto shows = [&](std::size_t x) { return covered[x] || !(linear[x] == plain); };
  std::size_t first = 0, last = side;
  while (first < side && !shows(first)) ++first;
  if (first == side) return {};
  while (!shows(last - 1)) --last;
  return {static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(last), 0};
}

void number_pixels(PixelSpans& spans) {
  for (PixelSpans::Row& row : spans.rows) {
    row.offset = spans.count;
    spans.count += row.last - row.first;
  }
}

void extend(PixelSpans::Row& row, const PixelSpans::Row& by) {
  if (by.first == by.last) return;
  row.first = row.first == row.last ? by.first : std::min(row.first, by.first);
  row.last = std::max(row.last, by.last);
}

// Products are rounded before they are added (-ffp-contract=off), so that vectors change no bit. By hand: of
// loops over the numbers of a block g++ makes one number at a time at -O3.
#ifdef TEXMESH_HAS_AVX2_TWIN
void add_blocks_plain(const FilterKernel& kernel, const float* const* lines, std::size_t count, float* out) {
  const std::size_t taps = kernel.size();
  const float* weights = kernel.data();
  for (std::size_t i = 0; i < whole_blocks(count); i += 8) {
    __m128 left = _mm_setzero_ps(), right = left;
    for (std::size_t k = 0; k < taps; ++k) {
      const __m128 weight = _mm_set1_ps(weights[k]);
      left = _mm_add_ps(left, _mm_mul_ps(_mm_loadu_ps(lines[k] + i), weight));
      right = _mm_add_ps(right, _mm_mul_ps(_mm_loadu_ps(lines[k] + i + 4), weight));
    }
    _mm_storeu_ps(out + i, left);
    _mm_storeu_ps(out + i + 4, right);
  }
}

[[gnu::target("avx2")]] void add_blocks_avx2(const FilterKernel& kernel, const float* const* lines,
                                             std::size_t count, float* out) {
  const std::size_t taps = kernel.size();
  const float* weights = kernel.data();
  for (std::size_t i = 0; i < whole_blocks(count); i += 16) {
    __m256 left = _mm256_setzero_ps(), right = left;
    for (std::size_t k = 0; k < taps; ++k) {
      const __m256 weight = _mm256_set1_ps(weights[k]);
      left = _mm256_add_ps(left, _mm256_mul_ps(_mm256_loadu_ps(lines[k] + i), weight));
      right = _mm256_add_ps(right, _mm256_mul_ps(_mm256_loadu_ps(lines[k] + i + 8), weight));
    }
    _mm256_storeu_ps(out + i, left);
    _mm256_storeu_ps(out + i + 8, right);
  }
}
#else
void add_blocks_plain(const FilterKernel& kernel, const float* const* lines, std::size_t count, float* out) {
  for (std::size_t i = 0; i < whole_blocks(count); ++i) {
    float sum = 0;
    for (std::size_t k = 0; k < kernel.size(); ++k) sum += lines[k][i] * kernel[k];
    out[i] = sum;
  }
}
#endif

using Lines = std::array<const float*, 2 * kFilterReach + 1>;

}  // namespace

PixelSpans shown_spans(const Picture& picture) {
  std::vector<PixelSpans::Row> shown(picture.side_px);
  for (std::size_t y = 0; y < shown.size(); ++y) shown[y] = shown_columns(picture, y);
  return spans_around(shown);
}

PixelSpans spans_around(const std::vector<PixelSpans::Row>& columns) {
  constexpr std::uint32_t kReach = kFilterReach;
  PixelSpans spans;
  spans.side_px = static_cast<std::uint32_t>(columns.size());
  std::vector<PixelSpans::Row> shown = columns;
  for (PixelSpans::Row& row : shown) {
    if (row.first == row.last) continue;
    row.first = std::max(row.first, kReach) - kReach;
    row.last = std::min(row.last + kReach, spans.side_px);
  }
  spans.rows.resize(shown.size());
  for (std::size_t y = 0; y < shown.size(); ++y)
    for (std::size_t k = std::max<std::size_t>(y, kReach) - kReach;
         k < std::min<std::size_t>(y + kReach + 1, shown.size()); ++k)
      extend(spans.rows[y], shown[k]);
  number_pixels(spans);
  return spans;
}

PixelSpans union_of(const PixelSpans& a, const PixelSpans& b) {
  PixelSpans out;
  out.side_px = a.side_px;
  out.rows.resize(a.rows.size());
  for (std::size_t y = 0; y < out.rows.size(); ++y) {
    extend(out.rows[y], a.rows[y]);
    extend(out.rows[y], b.rows[y]);
  }
  number_pixels(out);
  return out;
}

bool has_avx2() {
#ifdef TEXMESH_HAS_AVX2_TWIN
  static const bool has = __builtin_cpu_supports("avx2");
  return has;
#else
  return false;
#endif
}

void add_lines_by(bool avx2, const FilterKernel& kernel, const float* const* lines, std::size_t count,
                  float* out) {
#ifdef TEXMESH_HAS_AVX2_TWIN
  if (avx2) return add_blocks_avx2(kernel, lines, count, out);
#endif
  add_blocks_plain(kernel, lines, count, out);
}

void add_lines(const FilterKernel& kernel, const float* const* lines, std::size_t count, float* out) {
  add_lines_by(has_avx2(), kernel, lines, count, out);
}

float filtered_plain(float plain, const FilterKernel& kernel) {
  float sum = 0;
  for (const float weight : kernel) sum += plain * weight;
  return sum;
}

FilteredRows::FilteredRows(const PixelSpans& spans, float plain, const FilterKernel& kernel)
    : spans_(spans),
      kernel_(kernel),
      plain_(plain),
      filtered_plain_(filtered_plain(plain, kernel)),
      width_(whole_blocks(spans.side_px) + kFilterBlock),
      padded_(width_ + 2 * kFilterReach + kFilterBlock),
      lines_(kKept * width_, filtered_plain_),
      written_(kKept) {}

void FilteredRows::make(std::size_t y, const float* values) {
  float* out = lines_.data() + y % kKept * width_;
  PixelSpans::Row& old = written_[y % kKept];
  std::fill(out + old.first, out + old.last, filtered_plain_);
  const PixelSpans::Row& row = spans_.rows[y];
  old = row;
  if (row.first == row.last) return;
  const std::size_t count = row.last - row.first, radius = kernel_.size() / 2;
  const float before = row.first == 0 ? values[0] : plain_,
              behind = row.last == spans_.side_px ? values[count - 1] : plain_;
  std::fill_n(padded_.begin(), radius, before);
  std::copy_n(values, count, padded_.begin() + static_cast<std::ptrdiff_t>(radius));
  std::fill_n(padded_.begin() + static_cast<std::ptrdiff_t>(radius + count), radius + kFilterBlock, behind);
  Lines taps{};
  for (std::size_t k = 0; k < kernel_.size(); ++k) taps[k] = padded_.data() + k;
  add_lines(kernel_, taps.data(), count, out + row.first);
  // Of what the last block wrote behind the span, only that on the picture is read: as plain.
  std::fill(out + row.last, out + row.first + whole_blocks(count), filtered_plain_);
}

void FilteredRows::read(std::size_t y, std::uint32_t first, std::uint32_t last, const FilterKernel& along_y,
                        float* out) const {
  const std::size_t rows = spans_.rows.size(), radius = along_y.size() / 2;
  Lines taps{};
  for (std::size_t k = 0; k < along_y.size(); ++k) {
    const std::size_t at = std::min(std::max(y + k, radius) - radius, rows - 1);
    taps[k] = line(at) + first;
  }
  add_lines(along_y, taps.data(), last - first, out);
}

}  // namespace texmesh
