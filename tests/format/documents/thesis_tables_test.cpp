#include "format/documents/thesis_tables.h"

#include <gtest/gtest.h>

#include <limits>

#include "format/base/bytes.h"
#include "format/base/errors.h"

namespace texmesh::thesis_tables_test {

/// Planes 0 and 2, of two fragments and three scales; nothing is said of plane 1.
ThesisTables small_thesis() {
  PlaneThesis t;
  t.z = {0.25f, 0.5f}, t.i = {0, 1}, t.zeta = {0.125f, 0}, t.m = {1, 0.75f}, t.vqp = {0.3f, 0.7f};
  t.models = {{300, 0.4f, 0.97f}, {}};
  t.quality = {80, 60, 40};
  for (std::uint64_t k = 0; k < 3 * kGammaSteps; ++k) t.total_bytes.push_back(70000 + 13 * k);
  return {{t, {}, t}, {}};
}

TEST(ThesisTables, RoundTrip) {
  const Bytes bytes = write_thesis(small_thesis());
  // Head, 6 sections, predictors, model, and sizes of 3 bytes.
  EXPECT_EQ(bytes.size(), 16u + 6 * 12 + 2 * ((4 + 20) + (4 + 24) + (4 + 12 + 3 * 63)));
  const ThesisFile back = read_thesis(bytes);
  EXPECT_EQ(back.minor, 0);
  EXPECT_EQ(write_thesis(back.tables), bytes);
  ASSERT_EQ(back.tables.planes.size(), 3u);
  EXPECT_TRUE(back.tables.planes[1].z.empty() && back.tables.planes[1].quality.empty());
  const PlaneThesis a = small_thesis().planes[2];
  const PlaneThesis& b = back.tables.planes[2];
  EXPECT_EQ(b.models, a.models);
  EXPECT_EQ(b.quality, a.quality);
  EXPECT_EQ(b.total_bytes, a.total_bytes);
  for (std::size_t f = 0; f < 2; ++f) {
    EXPECT_NEAR(b.vqp[f], a.vqp[f], 0.5001 / 65535);
    EXPECT_NEAR(b.zeta[f], a.zeta[f], 0.5001 / 65535);
  }
  EXPECT_TRUE(read_thesis(write_thesis({})).tables.planes.empty());
}

TEST(ThesisTables, EveryTruncationAndEveryLongerFileIsRefused) {
  const Bytes bytes = write_thesis(small_thesis());
  for (std::size_t n = 0; n < bytes.size(); ++n)
    EXPECT_THROW(read_thesis(std::span(bytes).first(n)), FormatError) << n;
  Bytes longer = bytes;
  longer.push_back(0);
  EXPECT_THROW(read_thesis(longer), FormatError);
}

/// The manifest's digest catches accidents. What is flipped on purpose is refused or is another canonical
/// file.
TEST(ThesisTables, FlippedBitsAreRefusedOrInRange) {
  const Bytes bytes = write_thesis(small_thesis());
  std::size_t accepted = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i)
    for (int bit = 0; bit < 8; ++bit) {
      Bytes damaged = bytes;
      damaged[i] = static_cast<std::uint8_t>(damaged[i] ^ (1 << bit));
      try {
        const ThesisFile file = read_thesis(damaged);
        // A later minor version, and sections of unknown ids or of other planes, are read, too.
        if (i >= 16 + 6 * 12) EXPECT_EQ(write_thesis(file.tables), damaged) << i << " " << bit;
        ++accepted;
      } catch (const FormatError&) {
      }
    }
  EXPECT_GT(accepted, 100u);
}

TEST(ThesisTables, SectionsOfUnknownIdsAreSkipped) {
  Bytes bytes = write_thesis({});
  bytes[8] = 1;  // one section: id 5, of no plane, 5 bytes
  for (const int b : {5, 0, 0, 0, 0xff, 0xff, 0xff, 0xff, 5, 0, 0, 0, 1, 2, 3, 4, 5})
    bytes.push_back(static_cast<std::uint8_t>(b));
  EXPECT_TRUE(read_thesis(bytes).tables.planes.empty());
  bytes[16] = 0xff;
  EXPECT_NO_THROW(read_thesis(bytes));
  bytes[16] = 0;  // no id
  EXPECT_THROW(read_thesis(bytes), FormatError);
  bytes[16] = 1;  // known: a plane without number
  EXPECT_THROW(read_thesis(bytes), FormatError);
}

TEST(ThesisTables, VersionsAreChecked) {
  Bytes bytes = write_thesis(small_thesis());
  bytes[6] = 7;
  EXPECT_EQ(read_thesis(bytes).minor, 7);
  bytes[12] = 1;  // reserved: what it means is a later version's
  EXPECT_NO_THROW(read_thesis(bytes));
  bytes[6] = 0;
  EXPECT_THROW(read_thesis(bytes), FormatError);
  bytes[12] = 0;
  for (const std::uint8_t major : {1, 3}) {
    bytes[4] = major;
    EXPECT_THROW(read_thesis(bytes), FormatError);
  }
}

TEST(ThesisTables, CountsAreCheckedBeforeAnythingIsAllocated) {
  Bytes bytes = write_thesis({});
  bytes[8] = bytes[9] = bytes[10] = bytes[11] = 0xff;  // sections
  EXPECT_THROW(read_thesis(bytes), FormatError);
  bytes = write_thesis(small_thesis());
  bytes[24] = bytes[25] = bytes[26] = bytes[27] = 0xff;  // bytes of the first section
  EXPECT_THROW(read_thesis(bytes), FormatError);
  bytes = write_thesis(small_thesis());
  const std::size_t predictors = 16 + 6 * 12;
  bytes[predictors] = 0xff, bytes[predictors + 1] = 0xff;  // fragments
  EXPECT_THROW(read_thesis(bytes), FormatError);
}

TEST(ThesisTables, SectionsStandByIdAndPlaneOnce) {
  const Bytes bytes = write_thesis(small_thesis());
  Bytes twice = bytes;
  twice[28 + 4] = 0;  // plane 2 becomes 0 again
  EXPECT_THROW(read_thesis(twice), FormatError);
  Bytes order = bytes;
  order[16 + 4] = 3;  // plane 3 before plane 2
  EXPECT_THROW(read_thesis(order), FormatError);
  Bytes far = bytes;
  far[16 + 60 + 4 + 1] = 0x27, far[16 + 60 + 4] = 0x10;  // plane 10,000 of the last section
  EXPECT_THROW(read_thesis(far), FormatError);
}

TEST(ThesisTables, WriterRefusesBadTables) {
  const auto refused = [](auto change) {
    ThesisTables t = small_thesis();
    change(t.planes[0]);
    EXPECT_THROW(write_thesis(t), FormatError);
  };
  refused([](PlaneThesis& t) { t.z[0] = 1.5f; });
  refused([](PlaneThesis& t) { t.vqp[0] = std::numeric_limits<float>::quiet_NaN(); });
  refused([](PlaneThesis& t) { t.m.pop_back(); });
  refused([](PlaneThesis& t) { t.models[1].b = std::numeric_limits<float>::infinity(); });
  refused([](PlaneThesis& t) { t.quality[0] = 101; });
  refused([](PlaneThesis& t) { t.quality.pop_back(); });
  refused([](PlaneThesis& t) { t.total_bytes.pop_back(); });
  refused([](PlaneThesis& t) { t.total_bytes[0] = (std::uint64_t{1} << 53) + 1; });
}

TEST(ThesisTables, WidthsHoldTheLargestSize) {
  ThesisTables t = small_thesis();
  std::size_t before = 0;
  for (const std::uint64_t most : {std::uint64_t{255}, std::uint64_t{256}, std::uint64_t{1} << 53}) {
    for (PlaneThesis& p : t.planes)
      for (std::uint64_t& v : p.total_bytes) v = most;
    const Bytes bytes = write_thesis(t);
    EXPECT_GT(bytes.size(), before);
    before = bytes.size();
    EXPECT_EQ(read_thesis(bytes).tables.planes[2].total_bytes, t.planes[2].total_bytes);
  }
}

}  // namespace texmesh::thesis_tables_test
