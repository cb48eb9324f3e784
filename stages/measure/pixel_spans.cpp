#include "stages/measure/pixel_spans.h"

#include <algorithm>

namespace texmesh::measure {
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

}  // namespace

PixelSpans shown_spans(const Picture& picture) {
  constexpr std::uint32_t kReach = kFilterReach;
  PixelSpans spans;
  spans.side_px = picture.side_px;
  std::vector<PixelSpans::Row> shown(picture.side_px);
  for (std::size_t y = 0; y < shown.size(); ++y) {
    PixelSpans::Row& row = shown[y] = shown_columns(picture, y);
    if (row.first == row.last) continue;
    row.first = std::max(row.first, kReach) - kReach;
    row.last = std::min(row.last + kReach, picture.side_px);
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

}  // namespace texmesh::measure
