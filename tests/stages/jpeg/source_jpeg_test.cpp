#include "stages/jpeg/source_jpeg.h"

#include <gtest/gtest.h>

#include "stages/jpeg/jpeg_coder.h"

namespace texmesh::source_jpeg_test {

TEST(SourceJpeg, IjgTablesHaveTheirOwnQuality) {
  for (int quality = 1; quality <= 100; ++quality) {
    JpegKind kind;
    kind.quality = quality;
    EXPECT_EQ(quality_of(JpegCoder(kind).quantisers()[0]), quality);
  }
}

TEST(SourceJpeg, OtherTablesHaveTheNearestQuality) {
  JpegKind kind;
  kind.quality = 80;
  SourceLayout::Quantisers q = JpegCoder(kind).quantisers()[0];
  ++q[63];
  EXPECT_EQ(quality_of(q), 80);
  for (auto& step : q) step = static_cast<std::uint16_t>(2 * step);
  EXPECT_NEAR(quality_of(q), 60, 3);  // twice the quantisers of 80 are about those of 60
  SourceLayout::Quantisers flat;
  flat.fill(1);
  EXPECT_EQ(quality_of(flat), 100);
  flat.fill(255);
  EXPECT_EQ(quality_of(flat), 1);
}

TEST(SourceJpeg, HeadsAreWhole) {
  SourceLayout layout;
  layout.components = {{2, 1, 8, 8}, {1, 1, 4, 8}, {1, 1, 4, 8}};
  layout.mcu_width_px = 16;
  layout.pairs = {0, 1, 1};
  JpegKind kind;
  const JpegCoder coder(kind);
  const Bytes head = source_head(layout, coder.quantisers(), coder.tables(), 64, 32);
  ASSERT_GT(head.size(), 100u);
  EXPECT_EQ(head[0], 0xff);
  EXPECT_EQ(head[1], 0xd8);
  EXPECT_EQ(head[head.size() - 2], 0xff);
  EXPECT_EQ(head.back(), 0xd9);
  std::size_t tables = 0;
  for (std::size_t at = 2; at + 4 < head.size(); at += 2 + (std::size_t{head[at + 2]} << 8 | head[at + 3])) {
    ASSERT_EQ(head[at], 0xff);
    tables += head[at + 1] == 0xdb;
  }
  EXPECT_EQ(tables, 2u);  // the chroma's stands once
}

}  // namespace texmesh::source_jpeg_test
