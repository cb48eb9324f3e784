#pragma once
// What of a picture filters have to look at: they cost by what it shows, not by its size (filtered_rows.h).
#include <cstddef>
#include <cstdint>
#include <vector>

#include "stages/measure/picture.h"

namespace texmesh::measure {

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
/// Per row what holds both.
PixelSpans union_of(const PixelSpans& a, const PixelSpans& b);

/// One row of a separable filter, at most 2 kFilterReach + 1 values, an odd number.
using Kernel = std::vector<float>;

/// Values of the spans' pixels; all others have the plain value.
struct SpanImage {
  std::vector<float> values;
  float plain = 0;
  float at(const PixelSpans& spans, std::uint32_t x, std::uint32_t y) const {
    const PixelSpans::Row& row = spans.rows[y];
    return x >= row.first && x < row.last ? values[row.offset + (x - row.first)] : plain;
  }
};

}  // namespace texmesh::measure
