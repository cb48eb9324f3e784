#include "format/documents/tables.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "tests/format/documents/tables_fixture.h"

namespace texmesh::tables_test {

using testing::make_tables;
PackageTables small() { return {{make_tables(3, 2, 2, 2), make_tables(1, 1, 1, 1)}}; }

Bytes flat(const PackageTables& t) { return write_tables(t); }

TEST(Tables, RoundTrip) {
  const Bytes bytes = write_tables(small());
  const PackageTables back = read_tables(bytes);
  EXPECT_EQ(write_tables(back), bytes);
  ASSERT_EQ(back.planes.size(), 2u);
  const PlaneTables a = small().planes[0];
  const PlaneTables& b = back.planes[0];
  EXPECT_EQ(a.features, b.features);
  EXPECT_EQ(a.size_bytes, b.size_bytes);
  EXPECT_EQ(a.digest, b.digest);
  EXPECT_EQ(a.order, b.order);
  EXPECT_EQ(a.table_bytes, b.table_bytes);
  EXPECT_EQ(a.rung_quality, b.rung_quality);
  EXPECT_EQ(a.covered_texels, b.covered_texels);
  EXPECT_EQ(a.surface_fraction, b.surface_fraction);
  EXPECT_EQ(a.quality, b.quality);
  EXPECT_EQ(b.allocation, 1);
  ASSERT_EQ(b.skip_dssim.size(), 6u);
  for (std::size_t f = 0; f < 6; ++f) EXPECT_NEAR(b.skip_dssim[f], a.skip_dssim[f], a.skip_dssim[f] / 2048);
  EXPECT_EQ(b.knot_quality, (std::vector<std::uint8_t>{6, 7}));
  ASSERT_EQ(b.knot_position.size(), 2u);
  for (std::size_t k = 0; k < 2; ++k) EXPECT_NEAR(b.knot_position[k], a.knot_position[k], 0.5001 / 65535);
  EXPECT_TRUE(back.planes[1].knot_quality.empty());
  for (std::size_t i = 0; i < a.mse.size(); ++i) {
    EXPECT_NEAR(b.mse[i], a.mse[i], a.mse[i] / 2048);
    EXPECT_NEAR(b.dssim[i], a.dssim[i], std::max(a.dssim[i] / 2048, 0x1p-25f));
  }
  EXPECT_TRUE(read_tables(write_tables({})).planes.empty());
}

TEST(Tables, FullPlaneStaysUnder48KB) {
  PlaneTables t = make_tables(16, 16, 10, 5);
  t.size_bytes[0] = 1u << 16;  // u24 sizes and features
  t.features[0] = (1u << 24) - 1;
  t.rung_quality = {5, 8, 11, 18, 30, 53, 75, 86, 93, 97};
  t.knot_quality.clear(), t.knot_position.clear();
  for (std::uint8_t q = 6; q < 97; ++q) {
    if (std::find(t.rung_quality.begin(), t.rung_quality.end(), q) != t.rung_quality.end()) continue;
    t.knot_quality.push_back(q);
    t.knot_position.push_back(0.5f);
  }
  const Bytes bytes = write_tables({{t}});
  EXPECT_EQ(bytes.size(), 45542u);
  EXPECT_EQ(read_tables(bytes).planes[0].features, t.features);
  RecordProperty("bytes", static_cast<int>(bytes.size()));
}

/// What the file says of a fragment that is not stored is nothing, whatever was measured of it.
TEST(Tables, OnlyStoredFragmentsComeBack) {
  PlaneTables t = make_tables(3, 2, 2, 2);  // fragment 5 is not stored
  t.mse[5] = t.dssim[11] = t.skip_dssim[5] = 1;
  t.surface_fraction[5] = 0.5f;
  t.features[5] = 1u << 20;
  const Bytes bytes = write_tables({{t}});
  EXPECT_EQ(bytes, write_tables({{make_tables(3, 2, 2, 2)}}));
  const PlaneTables back = read_tables(bytes).planes[0];
  EXPECT_EQ(back.fragment_count(), 6u);
  EXPECT_EQ(back.mse[5] + back.dssim[11] + back.skip_dssim[5] + back.surface_fraction[5], 0);
  EXPECT_EQ(back.features[5], 0u);
}

TEST(Tables, PlanesWithoutAnyStoredFragmentAreRead) {
  PlaneTables t = make_tables(2, 1, 2, 3);
  t.order.clear();
  for (auto* v : {&t.size_bytes, &t.covered_texels}) std::fill(v->begin(), v->end(), 0u);
  const PlaneTables back = read_tables(write_tables({{t}})).planes[0];
  EXPECT_TRUE(back.order.empty());
  EXPECT_EQ(back.mse.size(), 4u);
  EXPECT_EQ(back.scale_count(), 3u);
}

TEST(Tables, ScalesAreSelectedByRow) {
  const PlaneTables all = make_tables(3, 2, 2, 4);
  const PlaneTables some = select_scales({{all}}, {0, 3}).planes[0];
  EXPECT_EQ(some.quality, (std::vector<float>{all.quality[0], all.quality[3]}));
  ASSERT_EQ(some.features.size(), 12u);
  EXPECT_TRUE(std::equal(some.features.begin() + 6, some.features.end(), all.features.begin() + 18));
  EXPECT_EQ(some.size_bytes, all.size_bytes);
  EXPECT_THROW(select_scales({{all}}, {4}), std::out_of_range);
}

TEST(Tables, SectionsCanBeReadOneByOne) {
  const Bytes bytes = write_tables(small());
  const TablesHead whole = read_tables_head(bytes);
  const TablesHead head = read_tables_head(std::span(bytes).first(whole.bytes));
  ASSERT_EQ(head.planes.size(), 2u);
  const auto section = std::span(bytes).subspan(head.planes[1].offset, head.planes[1].bytes);
  EXPECT_EQ(read_tables_section(head, 1, section).columns, 1u);
  EXPECT_THROW(read_tables_section(head, 0, section), FormatError);
}

TEST(Tables, EveryTruncationIsRefused) {
  const Bytes bytes = write_tables(small());
  for (std::size_t n = 0; n < bytes.size(); ++n)
    EXPECT_THROW(read_tables(std::span(bytes).first(n)), FormatError) << n;
  Bytes longer = bytes;
  longer.push_back(0);
  EXPECT_THROW(read_tables(longer), FormatError);
}

TEST(Tables, EveryFlippedBitIsRefusedOrIsTheMinorVersion) {
  const Bytes bytes = write_tables(small());
  for (std::size_t i = 0; i < bytes.size(); ++i)
    for (int bit = 0; bit < 8; ++bit) {
      Bytes damaged = bytes;
      damaged[i] = static_cast<std::uint8_t>(damaged[i] ^ (1 << bit));
      if ((i == 6 && damaged[i] > bytes[i]) || i == 7) {  // a later minor version
        EXPECT_NO_THROW(read_tables(damaged));
      } else {
        EXPECT_THROW(read_tables(damaged), FormatError) << i << " " << bit;
      }
    }
}

/// The digest catches accidents; whoever makes a package on purpose writes a fitting digest. So flips are
/// tried behind it.
TEST(Tables, FlipsWithACorrectedDigestAreRefusedOrInRange) {
  const Bytes bytes = write_tables({{make_tables(3, 2, 2, 2)}});
  const TablesHead head = read_tables_head(bytes);
  std::size_t accepted = 0;
  for (std::size_t i = head.bytes; i < bytes.size(); ++i)
    for (int bit = 0; bit < 8; ++bit) {
      Bytes damaged = bytes;
      damaged[i] = static_cast<std::uint8_t>(damaged[i] ^ (1 << bit));
      const Sha256 digest = sha256(std::span(damaged).subspan(head.bytes));
      std::copy(digest.begin(), digest.end(), damaged.begin() + 16 + 4);
      try {
        const PackageTables t = read_tables(damaged);
        EXPECT_EQ(flat(t), damaged);  // only the canonical form is read
        ++accepted;
      } catch (const FormatError&) {
      }
    }
  EXPECT_GT(accepted, 100u);  // sizes and digests are free
}

TEST(Tables, VersionsAreChecked) {
  Bytes bytes = write_tables(small());
  bytes[4] = 3;
  EXPECT_THROW(read_tables(bytes), FormatError);
  bytes[4] = 1;
  try {
    read_tables(bytes);
    FAIL();
  } catch (const FormatError& e) {
    EXPECT_NE(e.found().find("compile the model again"), std::string::npos) << e.what();
  }
}

TEST(Tables, CountsAreCheckedBeforeAnythingIsAllocated) {
  // 65535 stored fragments, 30 rungs and 100 scales promised by a section of 36 bytes.
  Bytes section(36, 0);
  section[0] = section[1] = 0xff;
  section[4] = 1;
  section[8] = 100, section[9] = 30;
  section[10] = section[11] = 1;
  section[32] = section[33] = 0xff;
  Bytes bytes{'T', 'X', 'M', 'T', 2, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 36, 0, 0, 0};
  const Sha256 digest = sha256(section);
  bytes.insert(bytes.end(), digest.begin(), digest.end());
  bytes.insert(bytes.end(), section.begin(), section.end());
  EXPECT_THROW(read_tables(bytes), FormatError);
  bytes[8] = bytes[9] = bytes[10] = bytes[11] = 0xff;  // 2^32 - 1 planes
  EXPECT_THROW(read_tables(bytes), FormatError);
}

/// A section without a stored fragment takes 140 bytes, whatever its grid: what is made of it is bounded.
TEST(Tables, GridsAreBoundedByTheMemoryTheyTake) {
  const auto empty = [](std::uint32_t columns, std::uint32_t rungs) {
    PlaneTables t = make_tables(1, 1, rungs, 1);
    const std::size_t f = columns, r = rungs;
    t.columns = columns;
    t.order.clear();
    for (auto* v : {&t.size_bytes, &t.covered_texels, &t.features}) v->assign(f, 0);
    t.size_bytes.assign(r * f, 0), t.digest.assign(r * f, 0);
    t.mse.assign(r * f, 0), t.dssim.assign(r * f, 0);
    t.skip_dssim.assign(f, 0), t.surface_fraction.assign(f, 0);
    return t;
  };
  EXPECT_NO_THROW(read_tables(write_tables({{empty(65535, 10)}})));
  EXPECT_THROW(write_tables({{empty(65535, 60)}}), FormatError);
  Bytes bytes = write_tables({{empty(10, 60)}});
  bytes[52] = 0xff, bytes[53] = 0xff;  // columns
  const Sha256 digest = sha256(std::span(bytes).subspan(52));
  std::copy(digest.begin(), digest.end(), bytes.begin() + 20);
  EXPECT_THROW(read_tables(bytes), FormatError);
  EXPECT_THROW(write_tables({std::vector<PlaneTables>(11, empty(65000, 38))}), FormatError);
}

TEST(Tables, WriterRefusesBadTables) {
  const auto refused = [](auto change) {
    PlaneTables t = make_tables(3, 2, 2, 2);
    change(t);
    EXPECT_THROW(write_tables({{t}}), FormatError);
  };
  refused([](PlaneTables& t) { t.columns = 0; });
  refused([](PlaneTables& t) { t.rung_quality = {30, 30}; });
  refused([](PlaneTables& t) { t.rung_quality = {30, 101}; });
  refused([](PlaneTables& t) { t.mse.pop_back(); });
  refused([](PlaneTables& t) { t.mse[0] = std::numeric_limits<float>::quiet_NaN(); });
  refused([](PlaneTables& t) { t.mse[0] = -1; });
  refused([](PlaneTables& t) { t.dssim[0] = 3; });
  refused([](PlaneTables& t) { t.size_bytes[0] = 0; });
  refused([](PlaneTables& t) { t.size_bytes[5] = 7; });
  refused([](PlaneTables& t) { t.covered_texels[5] = 7; });
  refused([](PlaneTables& t) { t.quality.clear(), t.features.clear(); });
  refused([](PlaneTables& t) { t.quality[1] = 101; });
  refused([](PlaneTables& t) { t.features[0] = 1u << 24; });
  refused([](PlaneTables& t) { t.order.push_back(t.order[0]); });
  refused([](PlaneTables& t) { t.order.pop_back(); });
  refused([](PlaneTables& t) { t.order[0] = 6; });
  refused([](PlaneTables& t) { t.quality_min = 98; });
  refused([](PlaneTables& t) { t.allocation = 3; });
  refused([](PlaneTables& t) { t.skip_dssim.pop_back(); });
  refused([](PlaneTables& t) { t.skip_dssim[0] = 2.5f; });
  refused([](PlaneTables& t) { t.knot_position.pop_back(); });
  refused([](PlaneTables& t) { t.knot_position[1] = 1.1f; });
  refused([](PlaneTables& t) { t.knot_position[1] = 0.2f; });
  refused([](PlaneTables& t) { t.knot_quality[1] = t.knot_quality[0]; });
  refused([](PlaneTables& t) { t.knot_quality[0] = t.rung_quality[0]; });
  refused([](PlaneTables& t) { t.knot_quality[1] = t.rung_quality[1]; });
  refused([](PlaneTables& t) { t.knot_quality[1] = static_cast<std::uint8_t>(t.rung_quality[1] + 1); });
}

TEST(Tables, KnotsMayFallFromRungToRung) {
  PlaneTables t = make_tables(1, 1, 3, 1);
  t.knot_quality = {6, 7, static_cast<std::uint8_t>(t.rung_quality[1] + 1)};
  t.knot_position = {0.5f, 1, 0};
  const PlaneTables back = read_tables(write_tables({{t}})).planes[0];
  EXPECT_EQ(back.knot_quality, t.knot_quality);
  EXPECT_EQ(back.knot_position[1], 1);
  EXPECT_EQ(back.knot_position[2], 0);
}

TEST(Tables, FractionsMayLeaveTheirRangeByRoundingOnly) {
  PlaneTables t = make_tables(1, 1, 1, 1);
  t.surface_fraction[0] = 1.0000001f;
  t.dssim[0] = -1e-7f;
  const PlaneTables back = read_tables(write_tables({{t}})).planes[0];
  EXPECT_EQ(back.surface_fraction[0], 1.0f);
  EXPECT_EQ(back.dssim[0], 0.0f);
}

TEST(Tables, ReaderTakesNoFractionAboveOne) {
  PlaneTables t = make_tables(1, 1, 1, 1);
  t.surface_fraction[0] = 1;
  Bytes bytes = write_tables({{t}});
  const Bytes one{0, 0, 0x80, 0x3f};
  const auto at = std::search(bytes.begin() + 52 + 56, bytes.end(), one.begin(), one.end());
  ASSERT_NE(at, bytes.end());
  *at = 1;  // the next float
  const Sha256 digest = sha256(std::span(bytes).subspan(52));
  std::copy(digest.begin(), digest.end(), bytes.begin() + 20);
  EXPECT_THROW(read_tables(bytes), FormatError);
  *at = 0;
  const Sha256 right = sha256(std::span(bytes).subspan(52));
  std::copy(right.begin(), right.end(), bytes.begin() + 20);
  EXPECT_NO_THROW(read_tables(bytes));
}

TEST(Tables, PredictorsStandBehindTheRestWhereQualityGoesByThem) {
  PlaneTables t = make_tables(3, 2, 2, 2);
  const std::size_t without = write_tables({{t}}).size();
  t.allocation = kByVqp;
  EXPECT_THROW(write_tables({{t}}), FormatError) << "none";
  t.vqp = {0, 1, 0.25f, 0.5f, 0.75f, 0};
  const Bytes bytes = write_tables({{t}});
  EXPECT_EQ(bytes.size(), without + 2 * t.order.size());
  const PlaneTables back = read_tables(bytes).planes[0];
  for (std::size_t f = 0; f < 6; ++f) EXPECT_NEAR(back.vqp[f], t.vqp[f], 1e-5) << f;
  EXPECT_EQ(write_tables({{back}}), bytes);
  t.vqp[2] = 1.5f;
  EXPECT_THROW(write_tables({{t}}), FormatError);
  t.vqp[2] = 0.5f;
  t.allocation = 0;
  EXPECT_THROW(write_tables({{t}}), FormatError) << "nobody reads them";
}

TEST(Tables, TheWeightOfDensityNeedsVersion21) {
  PlaneTables t = make_tables(3, 2, 2, 2);
  t.allocation = kByVqp;
  t.vqp = {0, 1, 0.25f, 0.5f, 0.75f, 0};
  EXPECT_EQ(needed_minor({{t}}), 0);
  const std::size_t without = write_tables({{t}}).size();
  t.density_weight = 0.25f;
  EXPECT_EQ(needed_minor({{t}}), 1);
  EXPECT_THROW(write_tables({{t}}), FormatError) << "2.0 does not know it";
  const Bytes bytes = write_tables({{t}}, 1);
  EXPECT_EQ(bytes.size(), without + 4);
  EXPECT_EQ(read_tables_head(bytes).minor, 1);
  EXPECT_EQ(read_tables(bytes).planes[0].density_weight, 0.25f);
  EXPECT_EQ(write_tables(read_tables(bytes), 1), bytes);
  t.density_weight = 1.5f;
  EXPECT_THROW(write_tables({{t}}, 1), FormatError);
  t.density_weight = 0.25f;
  t.allocation = 0;
  t.vqp.clear();
  EXPECT_THROW(write_tables({{t}}, 1), FormatError) << "nobody reads it";
}

}  // namespace texmesh::tables_test
