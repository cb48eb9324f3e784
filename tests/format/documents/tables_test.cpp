#include "format/documents/tables.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "tests/format/documents/tables_fixture.h"

namespace texmesh {
namespace {

using testing::make_tables;
PackageTables small() { return {{make_tables(3, 2, 2, 1), make_tables(1, 1, 1, 0)}}; }

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
  EXPECT_EQ(a.total_bytes, b.total_bytes);
  EXPECT_EQ(a.model_r, b.model_r);
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
  for (std::size_t f = 0; f < a.z.size(); ++f) EXPECT_NEAR(b.vqp[f], a.vqp[f], 0.5001 / 65535);
  EXPECT_TRUE(read_tables(write_tables({})).planes.empty());
}

TEST(Tables, FullPlaneStaysUnder64KB) {
  PlaneTables t = make_tables(16, 16, 10, 20);
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
  EXPECT_EQ(bytes.size(), 64182u);  // 62.7 KiB
  EXPECT_EQ(read_tables(bytes).planes[0].features, t.features);
  RecordProperty("bytes", static_cast<int>(bytes.size()));
}

/// As format 1.0 wrote it: without what 1.1 put at the end.
Bytes as_first_minor(const Bytes& bytes, std::size_t extension) {
  Bytes old(bytes.begin(), bytes.end() - static_cast<std::ptrdiff_t>(extension));
  old[6] = 0;
  const TablesHead head = read_tables_head(bytes);
  const std::size_t section = head.planes[0].bytes - extension;
  for (std::size_t k = 0; k < 4; ++k) old[16 + k] = static_cast<std::uint8_t>(section >> (8 * k));
  const Sha256 digest = sha256(std::span(old).subspan(head.bytes));
  std::copy(digest.begin(), digest.end(), old.begin() + 20);
  return old;
}

TEST(Tables, SectionsOfTheFirstMinorVersionAreRead) {
  PlaneTables t = make_tables(3, 2, 2, 1);
  for (const std::uint8_t allocation : {0, 1, 2}) {
    t.allocation = allocation;
    const Bytes old = as_first_minor(write_tables({{t}}), 4 + 6 * 2 + 1 + 2 * 3);
    const PlaneTables back = read_tables(old).planes[0];
    EXPECT_EQ(back.allocation, std::min<int>(allocation, 1));  // what a reader of 1.0 takes rd for
    EXPECT_TRUE(back.skip_dssim.empty());
    EXPECT_TRUE(back.knot_quality.empty());
    EXPECT_EQ(back.total_bytes, t.total_bytes);
    EXPECT_EQ(read_tables(write_tables({{t}})).planes[0].allocation, allocation);
    // Written again it is of this version and says that it does not know.
    EXPECT_TRUE(read_tables(write_tables({{back}})).planes[0].skip_dssim.empty());
    // Neither form passes for the other.
    EXPECT_THROW(read_tables(as_first_minor(write_tables({{t}}), 3 + 6 * 2 + 1 + 2 * 3)), FormatError);
    Bytes newer = old;
    newer[6] = 1;
    EXPECT_THROW(read_tables(newer), FormatError);
  }
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
  const Bytes bytes = write_tables({{make_tables(3, 2, 2, 1)}});
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
  bytes[4] = 2;
  EXPECT_THROW(read_tables(bytes), FormatError);
  bytes[4] = 0;
  EXPECT_THROW(read_tables(bytes), FormatError);
}

TEST(Tables, CountsAreCheckedBeforeAnythingIsAllocated) {
  // 65535 fragments, 100 rungs and 100 scales promised by a section of 56 bytes.
  Bytes section(56, 0);
  section[0] = section[1] = 0xff;
  section[4] = 1;
  section[8] = 99;
  section[9] = 100;
  section[10] = section[11] = 1;
  Bytes bytes{'T', 'X', 'M', 'T', 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 56, 0, 0, 0};
  const Sha256 digest = sha256(section);
  bytes.insert(bytes.end(), digest.begin(), digest.end());
  bytes.insert(bytes.end(), section.begin(), section.end());
  EXPECT_THROW(read_tables(bytes), FormatError);
  bytes[8] = bytes[9] = bytes[10] = bytes[11] = 0xff;  // 2^32 - 1 planes
  EXPECT_THROW(read_tables(bytes), FormatError);
}

TEST(Tables, WriterRefusesBadTables) {
  const auto refused = [](auto change) {
    PlaneTables t = make_tables(3, 2, 2, 1);
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
  refused([](PlaneTables& t) { t.z[0] = 1.5f; });
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
  refused([](PlaneTables& t) { t.model_r = std::numeric_limits<float>::infinity(); });
}

TEST(Tables, KnotsMayFallFromRungToRung) {
  PlaneTables t = make_tables(1, 1, 3, 0);
  t.knot_quality = {6, 7, static_cast<std::uint8_t>(t.rung_quality[1] + 1)};
  t.knot_position = {0.5f, 1, 0};
  const PlaneTables back = read_tables(write_tables({{t}})).planes[0];
  EXPECT_EQ(back.knot_quality, t.knot_quality);
  EXPECT_EQ(back.knot_position[1], 1);
  EXPECT_EQ(back.knot_position[2], 0);
  // Flag bit 2 promises at least one.
  t.knot_quality.clear(), t.knot_position.clear();
  Bytes bytes = write_tables({{t}});
  const TablesHead head = read_tables_head(bytes);
  bytes[bytes.size() - 5] = 5;  // flags, 2 bytes 0, one half
  bytes.push_back(0);
  ++bytes[16];
  const Sha256 digest = sha256(std::span(bytes).subspan(head.bytes));
  std::copy(digest.begin(), digest.end(), bytes.begin() + 20);
  EXPECT_THROW(read_tables(bytes), FormatError);
}

TEST(Tables, FractionsMayLeaveTheirRangeByRoundingOnly) {
  PlaneTables t = make_tables(1, 1, 1, 0);
  t.surface_fraction[0] = 1.0000001f;
  t.z[0] = -1e-7f;
  t.dssim[0] = -1e-7f;
  const PlaneTables back = read_tables(write_tables({{t}})).planes[0];
  EXPECT_EQ(back.surface_fraction[0], 1.0f);
  EXPECT_EQ(back.z[0], 0.0f);
  EXPECT_EQ(back.dssim[0], 0.0f);
}

TEST(Tables, ReaderTakesNoFractionAboveOne) {
  PlaneTables t = make_tables(1, 1, 1, 0);
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

}  // namespace
}  // namespace texmesh
