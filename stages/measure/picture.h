#pragma once
// Pictures, and what of them filters have to look at: filters cost by what a picture shows, not by its size.
#include <vector>

#include "format/base/vec.h"

namespace texmesh {

/// A picture in linear light, square, row-major, with the pixels that show the object.
struct Picture {
  std::uint32_t side_px = 0;
  std::vector<Vec3f> linear;          // RGB of BT.709 primaries, 0..1 (brighter is cut off)
  std::vector<std::uint8_t> covered;  // 0 or 1
};

/// How far from what is shown a filter may still see it, px; no filter reaches farther.
inline constexpr int kFilterReach = 10;

/// One range of pixels in each row. What lies outside of it is plain background, and so is all within
/// kFilterReach of that.
struct PixelSpans {
  struct Row {
    std::uint32_t first = 0, last = 0;  // columns first to last - 1
    std::size_t offset = 0;             // of `first` among all rows' pixels
  };
  std::uint32_t side_px = 0;
  std::vector<Row> rows;
  std::size_t count = 0;
};
/// Plain background is what the corner's colour shows and is not covered.
PixelSpans shown_spans(const Picture& picture);
/// Around what rows show: of each the columns that are not plain, or none.
PixelSpans spans_around(const std::vector<PixelSpans::Row>& shown);
/// Per row what holds both.
PixelSpans union_of(const PixelSpans& a, const PixelSpans& b);

/// One row of a separable filter, at most 2 kFilterReach + 1 values, an odd number.
using FilterKernel = std::vector<float>;

/// Values of the spans' pixels; all others have the plain value.
struct SpanImage {
  std::vector<float> values;
  float plain = 0;
  float at(const PixelSpans& spans, std::uint32_t x, std::uint32_t y) const {
    const PixelSpans::Row& row = spans.rows[y];
    return x >= row.first && x < row.last ? values[row.offset + (x - row.first)] : plain;
  }
};

/// Floats that a loop takes at once: rows are read and written by whole blocks.
inline constexpr std::size_t kFilterBlock = 16;
constexpr std::size_t whole_blocks(std::size_t n) {
  return (n + kFilterBlock - 1) / kFilterBlock * kFilterBlock;
}

/// out[i] = sum over k of kernel[k] * lines[k][i], i < whole_blocks(count). Sums run by rising k: the same
/// bits with AVX2 and without.
void add_lines(const FilterKernel& kernel, const float* const* lines, std::size_t count, float* out);
/// add_lines() by one way; `avx2` where the processor has it.
void add_lines_by(bool avx2, const FilterKernel& kernel, const float* const* lines, std::size_t count,
                  float* out);
bool has_avx2();

/// What a filter makes of a plain picture.
float filtered_plain(float plain, const FilterKernel& kernel);

/// The last rows of a picture, filtered along x. All have the picture's whole width, with plain values beside
/// the spans.
class FilteredRows {
 public:
  FilteredRows(const PixelSpans& spans, float plain, const FilterKernel& kernel);
  /// Of the whole picture.
  float plain() const { return filtered_plain_; }
  /// Row y from `values` of its span. Rows are made in rising order; the last 2 kFilterReach + 1 stay.
  void make(std::size_t y, const float* values);
  /// Writes columns first to last - 1 of row y, filtered along y. The rows within the kernel's reach must be
  /// made; borders are replicated. `out` has room for whole_blocks(last - first).
  void read(std::size_t y, std::uint32_t first, std::uint32_t last, const FilterKernel& along_y,
            float* out) const;

 private:
  static constexpr std::size_t kKept = 2 * kFilterReach + 1;
  const float* line(std::size_t y) const { return lines_.data() + y % kKept * width_; }
  const PixelSpans& spans_;
  const FilterKernel& kernel_;
  float plain_, filtered_plain_;
  std::size_t width_ = 0;
  std::vector<float> padded_, lines_;
  std::vector<PixelSpans::Row> written_;
};

}  // namespace texmesh
