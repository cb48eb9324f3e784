#include "stages/measure/pixel_spans.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/meshes.h"

namespace texmesh::measure {
namespace {

/// An object of grain in a box of a grey picture.
Picture object_in(std::uint32_t side, std::uint32_t x0, std::uint32_t x1, std::uint32_t y0,
                  std::uint32_t y1) {
  Picture p;
  p.side_px = side;
  testing::Random random{5};
  for (std::uint32_t y = 0; y < side; ++y)
    for (std::uint32_t x = 0; x < side; ++x) {
      const bool object = x >= x0 && x < x1 && y >= y0 && y < y1 && (x + y) % 7 != 0;
      const auto value = static_cast<float>(random.uniform());
      p.linear.push_back(object ? Vec3f{value, value, value} : Vec3f{0.2f, 0.2f, 0.2f});
      p.covered.push_back(object);
    }
  return p;
}

SpanImage grey_of(const Picture& picture, const PixelSpans& spans) {
  SpanImage out{{}, picture.linear[0].x};
  for (std::size_t y = 0; y < spans.rows.size(); ++y)
    for (std::size_t x = spans.rows[y].first; x < spans.rows[y].last; ++x)
      out.values.push_back(picture.linear[y * picture.side_px + x].x);
  return out;
}

float by_definition(const Picture& picture, int x, int y, const Kernel& along_x, const Kernel& along_y) {
  const int side = static_cast<int>(picture.side_px), rx = static_cast<int>(along_x.size() / 2),
            ry = static_cast<int>(along_y.size() / 2);
  float sum = 0;
  for (int j = -ry; j <= ry; ++j) {
    float line = 0;
    for (int i = -rx; i <= rx; ++i)
      line += picture
                  .linear[static_cast<std::size_t>(std::clamp(y + j, 0, side - 1)) * picture.side_px +
                          static_cast<std::size_t>(std::clamp(x + i, 0, side - 1))]
                  .x *
              along_x[static_cast<std::size_t>(i + rx)];
    sum += line * along_y[static_cast<std::size_t>(j + ry)];
  }
  return sum;
}

TEST(PixelSpans, FilterAsTheWholePictureToTheBit) {
  Kernel narrow{0.25f, 0.5f, 0.25f}, wide;
  for (int i = -kFilterReach; i <= kFilterReach; ++i) wide.push_back(0.01f * static_cast<float>(i + 14));
  const std::uint32_t boxes[4][4] = {{30, 41, 25, 60}, {0, 9, 0, 70}, {55, 70, 64, 70}, {0, 0, 0, 0}};
  for (const auto& b : boxes) {
    const Picture picture = object_in(70, b[0], b[1], b[2], b[3]);
    const PixelSpans spans = shown_spans(picture);
    for (const Kernel* x : {&narrow, &wide})
      for (const Kernel* y : {&narrow, &wide}) {
        const SpanImage got = filtered(grey_of(picture, spans), spans, *x, *y);
        for (std::uint32_t j = 0; j < 70; ++j)
          for (std::uint32_t i = 0; i < 70; ++i)
            ASSERT_EQ(got.at(spans, i, j),
                      by_definition(picture, static_cast<int>(i), static_cast<int>(j), *x, *y))
                << i << " " << j;
      }
  }
}

TEST(PixelSpans, CostByWhatIsShown) {
  EXPECT_EQ(shown_spans(object_in(70, 0, 0, 0, 0)).count, 0u);
  EXPECT_LT(shown_spans(object_in(300, 100, 110, 100, 110)).count, 40u * 40u);
  EXPECT_EQ(shown_spans(object_in(40, 0, 40, 0, 40)).count, 1600u);
}

TEST(PixelSpans, UnionHoldsBoth) {
  const PixelSpans a = shown_spans(object_in(90, 10, 20, 10, 20)),
                   b = shown_spans(object_in(90, 60, 70, 15, 50)), both = union_of(a, b);
  std::size_t count = 0;
  for (std::size_t y = 0; y < 90; ++y) {
    for (const PixelSpans::Row& row : {a.rows[y], b.rows[y]}) {
      if (row.first == row.last) continue;
      EXPECT_LE(both.rows[y].first, row.first);
      EXPECT_GE(both.rows[y].last, row.last);
    }
    EXPECT_EQ(both.rows[y].offset, count);
    count += both.rows[y].last - both.rows[y].first;
  }
  EXPECT_EQ(both.count, count);
}

}  // namespace
}  // namespace texmesh::measure
