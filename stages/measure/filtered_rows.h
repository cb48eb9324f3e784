#pragma once
// Inside the room only: filters of a picture's rows, as many at a time as one filter sees.
#include <cstddef>
#include <vector>

#include "stages/measure/pixel_spans.h"

namespace texmesh::measure {

/// Floats that a loop takes at once: rows are read and written by whole blocks.
inline constexpr std::size_t kFilterBlock = 16;
constexpr std::size_t whole_blocks(std::size_t n) {
  return (n + kFilterBlock - 1) / kFilterBlock * kFilterBlock;
}

/// out[i] = sum over k of kernel[k] * lines[k][i], i < whole_blocks(count). Sums run by rising k: the same
/// bits with AVX2 and without.
void add_lines(const Kernel& kernel, const float* const* lines, std::size_t count, float* out);
/// add_lines() by one way; `avx2` where the processor has it.
void add_lines_by(bool avx2, const Kernel& kernel, const float* const* lines, std::size_t count, float* out);
bool has_avx2();

/// What a filter makes of a plain picture.
float filtered_plain(float plain, const Kernel& kernel);

/// The last rows of a picture, filtered along x. All have the picture's whole width, with plain values beside
/// the spans.
class FilteredRows {
 public:
  FilteredRows(const PixelSpans& spans, float plain, const Kernel& kernel);
  /// Of the whole picture.
  float plain() const { return filtered_plain_; }
  /// Row y from `values` of its span. Rows are made in rising order; the last 2 kFilterReach + 1 stay.
  void make(std::size_t y, const float* values);
  /// Writes row y's span, filtered along y. The rows within the kernel's reach must be made; borders are
  /// replicated. `out` has room for whole_blocks(count).
  void read(std::size_t y, const Kernel& along_y, float* out) const;

 private:
  static constexpr std::size_t kKept = 2 * kFilterReach + 1;
  const float* line(std::size_t y) const { return lines_.data() + y % kKept * width_; }
  const PixelSpans& spans_;
  const Kernel& kernel_;
  float plain_, filtered_plain_;
  std::size_t width_ = 0;
  std::vector<float> padded_, lines_;
  std::vector<PixelSpans::Row> written_;
};

}  // namespace texmesh::measure
