#include "stages/measure/picture.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/stages/measure/grainy_picture.h"

namespace texmesh::filtered_rows_test {

using testing::object_in;

/// Red of a row's span.
std::vector<float> values_of(const Picture& picture, const PixelSpans& spans, std::size_t y) {
  std::vector<float> out;
  for (std::size_t x = spans.rows[y].first; x < spans.rows[y].last; ++x)
    out.push_back(picture.linear[y * picture.side_px + x].x);
  return out;
}

float by_definition(const Picture& picture, int x, int y, const FilterKernel& along_x,
                    const FilterKernel& along_y) {
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

TEST(FilteredRows, AreThoseOfTheWholePictureToTheBit) {
  FilterKernel narrow{0.25f, 0.5f, 0.25f}, wide;
  for (int i = -kFilterReach; i <= kFilterReach; ++i) wide.push_back(0.01f * static_cast<float>(i + 14));
  const std::uint32_t boxes[4][4] = {{30, 41, 25, 60}, {0, 9, 0, 70}, {55, 70, 64, 70}, {0, 0, 0, 0}};
  for (const auto& b : boxes) {
    const Picture picture = object_in(70, b[0], b[1], b[2], b[3]);
    const PixelSpans spans = shown_spans(picture);
    for (const FilterKernel* x : {&narrow, &wide})
      for (const FilterKernel* y : {&narrow, &wide}) {
        FilteredRows rows(spans, picture.linear[0].x, *x);
        std::vector<float> got(whole_blocks(spans.side_px));
        std::size_t made = 0;
        for (std::uint32_t j = 0; j < 70; ++j) {
          for (; made < std::min<std::size_t>(70, j + kFilterReach + 1); ++made)
            rows.make(made, values_of(picture, spans, made).data());
          rows.read(j, spans.rows[j].first, spans.rows[j].last, *y, got.data());
          for (std::uint32_t i = spans.rows[j].first; i < spans.rows[j].last; ++i)
            ASSERT_EQ(got[i - spans.rows[j].first],
                      by_definition(picture, static_cast<int>(i), static_cast<int>(j), *x, *y))
                << i << " " << j;
          for (const std::uint32_t i : {0u, 35u, 69u}) {
            if (i >= spans.rows[j].first && i < spans.rows[j].last) continue;
            ASSERT_EQ(filtered_plain(rows.plain(), *y),
                      by_definition(picture, static_cast<int>(i), static_cast<int>(j), *x, *y));
          }
        }
      }
  }
}

TEST(FilteredRows, WiderVectorsChangeNoBit) {
  if (!has_avx2()) GTEST_SKIP() << "this processor has no AVX2";
  testing::Random random{7};
  std::vector<std::vector<float>> values(11, std::vector<float>(64));
  for (auto& row : values)
    for (float& v : row) v = static_cast<float>(random.uniform() * 300 - 100);
  FilterKernel kernel;
  std::vector<const float*> lines;
  for (const auto& row : values) {
    kernel.push_back(static_cast<float>(random.uniform() - 0.5));
    lines.push_back(row.data());
  }
  for (const std::size_t count : {1, 15, 16, 17, 63}) {
    std::vector<float> plain(64), wide(64);
    add_lines_by(false, kernel, lines.data(), count, plain.data());
    add_lines_by(true, kernel, lines.data(), count, wide.data());
    EXPECT_EQ(plain, wide) << count;
  }
}

}  // namespace texmesh::filtered_rows_test
