
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "format/base/errors.h"
#include "format/documents/thesis_tables.h"

namespace texmesh::perceptual_table_test {

/// Scales 0, 2 and 5: pairs (0, 2), (0, 5), (2, 5).
PerceptualTable three_scales() {
  PerceptualTable t;
  t.scale = {0, 2, 5}, t.triangles = {1260, 1162, 700}, t.collapses = {0, 49, 231};
  t.average = {0, 0.041f, 0.06f}, t.largest = {0, 0.2f, 0.3f}, t.least = {0, 0, 0.001f};
  t.deviation = {0, 0.03f, 0.05f};
  t.p95 = {0.05f, 0.11f, 0.09f}, t.chain_average = {0.041f, 0.07f, 0.06f};
  t.chain_largest = {0.2f, 0.4f, 0.3f}, t.chain_least = {0, 0, 0.001f};
  return t;
}

PerceptualTable read_back(const Bytes& section) {
  BytesIn in(section, "section");
  PerceptualTable t = read_perceptual_section(in, true);
  in.finish();
  return t;
}

TEST(PerceptualTable, PairsStandByTheFinerRow) {
  EXPECT_EQ(pair_count(0), 0u);
  EXPECT_EQ(pair_count(1), 0u);
  std::size_t at = 0;
  for (std::size_t i = 0; i < 7; ++i)
    for (std::size_t j = i + 1; j < 7; ++j) EXPECT_EQ(pair_index(7, i, j), at++);
  EXPECT_EQ(pair_count(7), at);
}

TEST(PerceptualTable, RoundTripAlsoAsASectionOfTheFile) {
  const Bytes section = write_perceptual_section(three_scales());
  EXPECT_EQ(section.size(), 4u + 3 * 25 + 3 * 16);
  EXPECT_EQ(read_back(section), three_scales());
  const Bytes file = write_thesis({{}, three_scales()});
  EXPECT_EQ(read_thesis(file).tables.perceptual, three_scales());
  PerceptualTable one;
  one.scale = {0}, one.triangles = {12}, one.collapses = {0};
  one.average = one.largest = one.least = one.deviation = {0};
  EXPECT_EQ(read_back(write_perceptual_section(one)), one);
}

TEST(PerceptualTable, EveryTruncationIsRefusedAndEveryFlipIsRefusedOrCanonical) {
  const Bytes section = write_perceptual_section(three_scales());
  for (std::size_t n = 0; n < section.size(); ++n)
    EXPECT_THROW(read_back({section.begin(), section.begin() + static_cast<std::ptrdiff_t>(n)}), FormatError);
  std::size_t accepted = 0;
  for (std::size_t i = 0; i < section.size(); ++i)
    for (int bit = 0; bit < 8; ++bit) {
      Bytes damaged = section;
      damaged[i] = static_cast<std::uint8_t>(damaged[i] ^ (1 << bit));
      try {
        EXPECT_EQ(write_perceptual_section(read_back(damaged)), damaged) << i << " " << bit;
        ++accepted;
      } catch (const FormatError&) {
      }
    }
  EXPECT_GT(accepted, 100u);
}

TEST(PerceptualTable, WriterRefusesBadTables) {
  const auto refused = [](const std::function<void(PerceptualTable&)>& change) {
    PerceptualTable t = three_scales();
    change(t);
    EXPECT_THROW(write_perceptual_section(t), FormatError);
  };
  refused([](PerceptualTable& t) { t = {}; });
  refused([](PerceptualTable& t) { t.scale[0] = 1; });
  refused([](PerceptualTable& t) { t.scale[2] = 2; });
  refused([](PerceptualTable& t) { t.scale[2] = 100; });
  refused([](PerceptualTable& t) { t.collapses[0] = 1; });
  refused([](PerceptualTable& t) { t.triangles.pop_back(); });
  refused([](PerceptualTable& t) { t.average[1] = -0.1f; });
  refused([](PerceptualTable& t) { t.p95[1] = std::numeric_limits<float>::quiet_NaN(); });
  refused([](PerceptualTable& t) { t.chain_largest.push_back(0); });
}

TEST(PerceptualTable, ATableOfAPlaneIsRefused) {
  Bytes file = write_thesis({{}, three_scales()});
  file[20] = file[21] = file[22] = file[23] = 0;  // plane 0
  EXPECT_THROW(read_thesis(file), FormatError);
}

}  // namespace texmesh::perceptual_table_test
