#include "stages/measure/picture.h"

#include <gtest/gtest.h>

#include "tests/stages/measure/grainy_picture.h"

namespace texmesh::pixel_spans_test {

using testing::object_in;

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

}  // namespace texmesh::pixel_spans_test
