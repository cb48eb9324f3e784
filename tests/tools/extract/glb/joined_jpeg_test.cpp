// Fragments of a plane put together to one JPEG without coding anew.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "format/base/errors.h"
#include "stages/data/fragments.h"
#include "stages/image/decode_image.h"
#include "stages/image/decode_jpeg.h"
#include "stages/jpeg/jpeg_coder.h"
#include "tests/support/packages.h"
#include "tools/extract/glb/texture_source.h"

namespace texmesh::joined_jpeg_test {

constexpr std::uint32_t kWidth = 64, kHeight = 48, kFragment = 32;  // of the package made by code

PackageReader package_of(const testing::PackageParts& parts) {
  return PackageReader(open_container(memory_source(parts.build())));
}
Pixels decoded(const Bytes& file) { return decode_image(probe_image("x", file, {})); }

/// Every coefficient of a file.
std::vector<std::int16_t> coefficients_of(const Bytes& file) {
  const JpegCoefficients from("x", file);
  std::vector<std::int16_t> out;
  for (std::size_t c = 0; c < from.components().size(); ++c)
    for (std::uint32_t y = 0; y < from.components()[c].blocks_down; ++y)
      for (std::uint32_t x = 0; x < from.components()[c].blocks_across; ++x)
        out.insert(out.end(), from.block(c, y, x), from.block(c, y, x) + 64);
  return out;
}

TEST(JoinedJpeg, HasTheCoefficientsOfEveryFragment) {
  PackageReader package = package_of(testing::make_package_parts());
  for (const std::uint32_t rung : {0u, 1u}) {
    const JoinedJpeg joined = joined_plane(package, 0, rung, {});
    EXPECT_EQ(joined.width_px(), kWidth);
    EXPECT_EQ(joined.height_px(), kHeight);
    EXPECT_EQ(joined.channels(), 3u);
    const Bytes file = joined.file();
    const JpegCoefficients whole("x", file);
    for (const std::uint32_t f : {0u, 1u, 2u}) {
      const JpegCoefficients part("f", package.complete_fragment(0, rung, f));
      for (std::size_t c = 0; c < 3; ++c) {
        const JpegCoefficients::Component &a = part.components()[c], &b = whole.components()[c];
        EXPECT_EQ(a.across, b.across);
        EXPECT_EQ(a.quantisers, b.quantisers);
        const std::uint32_t row = f / 2 * a.blocks_down, column = f % 2 * a.blocks_across;
        for (std::uint32_t y = 0; y < a.blocks_down && row + y < b.blocks_down; ++y)
          for (std::uint32_t x = 0; x < a.blocks_across; ++x)
            ASSERT_TRUE(std::equal(part.block(c, y, x), part.block(c, y, x) + 64,
                                   whole.block(c, row + y, column + x)))
                << f << " " << c << " " << x << " " << y;
      }
    }
  }
}

TEST(JoinedJpeg, DecodesToTheFragmentsTexels) {
  PackageReader package = package_of(testing::make_package_parts());
  const Pixels whole = decoded(joined_plane(package, 0, 1, {}).file());
  for (const std::uint32_t f : {0u, 1u, 2u}) {
    const Pixels part = decoded(package.complete_fragment(0, 1, f));
    // Where a fragment ends, chroma of 4:2:0 is interpolated otherwise.
    for (std::uint32_t y = 1; y + 1 < kFragment; ++y)
      for (std::uint32_t x = 1; x + 1 < kFragment; ++x) {
        const std::uint32_t px = f % 2 * kFragment + x, py = f / 2 * kFragment + y;
        if (py < kHeight) ASSERT_TRUE(std::equal(part.at(x, y), part.at(x, y) + 3, whole.at(px, py)));
      }
  }
}

TEST(JoinedJpeg, FragmentsThatAreNotStoredTakeTheMeanBesideThem) {
  PackageReader package = package_of(testing::make_package_parts());
  const Bytes file = joined_plane(package, 0, 1, {}).file();
  const JpegCoefficients whole("x", file);
  for (std::uint32_t y = 4; y < 6; ++y)
    for (std::uint32_t x = 4; x < 8; ++x) {
      const std::int16_t* block = whole.block(0, y, x);
      EXPECT_EQ(block[0], whole.block(0, y, 3)[0]);
      for (std::size_t k = 1; k < 64; ++k) EXPECT_EQ(block[k], 0);
    }
}

TEST(JoinedJpeg, LessQualityRoundsToCoarserSteps) {
  PackageReader package = package_of(testing::make_package_parts());
  const JoinedJpeg joined = joined_plane(package, 0, 1, {});
  const Bytes all = joined.file(), less = joined.file(60), least = joined.file(5);
  EXPECT_LT(less.size(), all.size());
  EXPECT_LT(least.size(), less.size());
  const JpegCoefficients a("a", all), b("b", less);
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t k = 0; k < 64; ++k) {
      const int from = a.components()[c].quantisers[k], to = b.components()[c].quantisers[k];
      EXPECT_EQ(to, std::max<int>(from, texture_step(k, 60)));
      EXPECT_LE(2 * std::abs(a.block(c, 0, 0)[k] * from - b.block(c, 0, 0)[k] * to), to);
    }
}

bool is_flat(const std::int16_t* block) {
  return std::all_of(block + 1, block + 64, [](std::int16_t v) { return v == 0; });
}

TEST(JoinedJpeg, WhatNobodySeesContinuesWhatIsSeen) {
  PackageReader package = package_of(testing::make_package_parts());
  const JoinedJpeg whole = joined_plane(package, 0, 1, {});
  JoinedJpeg filled = whole;
  filled.fill_unseen(std::vector<std::uint8_t>(coverage_size_bytes(kWidth, kHeight), 0));
  const Bytes before = whole.file(), after = filled.file();
  const JpegCoefficients a("a", before), b("b", after);
  const auto known = [&](std::uint32_t y, std::uint32_t x) { return !is_flat(a.block(0, y, x)); };
  int continued = 0;
  for (std::uint32_t y = 0; y < a.components()[0].blocks_down; ++y)
    for (std::uint32_t x = 0; x < a.components()[0].blocks_across; ++x) {
      int sum = 0, count = 0;
      for (std::uint32_t v = y - std::min(y, 1u); v < std::min(y + 2, a.components()[0].blocks_down); ++v)
        for (std::uint32_t u = x - std::min(x, 1u); u < std::min(x + 2, a.components()[0].blocks_across); ++u)
          if (known(v, u)) sum += a.block(0, v, u)[0], ++count;
      if (known(y, x)) EXPECT_EQ(b.block(0, y, x)[0], a.block(0, y, x)[0]);
      if (known(y, x) || count == 0) continue;
      EXPECT_EQ(b.block(0, y, x)[0], sum / count) << x << " " << y;
      ++continued;
    }
  EXPECT_GT(continued, 4);  // of the fragment that is not stored
  std::vector<std::uint8_t> seen(coverage_size_bytes(kWidth, kHeight), 0xff);
  JoinedJpeg same = whole;
  same.fill_unseen(seen);
  EXPECT_EQ(same.file(), before);
}

TEST(JoinedJpeg, FlattensWhatNobodySees) {
  PackageReader package = package_of(testing::make_package_parts());
  const JoinedJpeg whole = joined_plane(package, 0, 1, {});
  JoinedJpeg none = whole, all = whole, corner = whole;
  const std::vector<std::uint8_t> nothing(coverage_size_bytes(kWidth, kHeight), 0),
      everything(coverage_size_bytes(kWidth, kHeight), 0xff);
  std::vector<std::uint8_t> first = nothing;
  first[0] = 0x80;  // the texel of the upper left corner
  none.fill_unseen(nothing);
  all.fill_unseen(everything);
  corner.fill_unseen(first);
  EXPECT_EQ(all.file(), whole.file());
  EXPECT_LT(none.file().size(), corner.file().size());
  const Bytes whole_file = whole.file(), corner_file = corner.file();
  const JpegCoefficients a("a", whole_file), b("b", corner_file);
  for (std::uint32_t y = 0; y < a.components()[0].blocks_down; ++y)
    for (std::uint32_t x = 0; x < a.components()[0].blocks_across; ++x) {
      if (!is_flat(a.block(0, y, x))) EXPECT_EQ(a.block(0, y, x)[0], b.block(0, y, x)[0]);
      // The MCU of the texel and those around it: four blocks each way.
      if (x < 4 && y < 4 && !is_flat(a.block(0, y, x)))
        EXPECT_TRUE(std::equal(a.block(0, y, x), a.block(0, y, x) + 64, b.block(0, y, x)));
      else
        for (std::size_t k = 1; k < 64; ++k) ASSERT_EQ(b.block(0, y, x)[k], 0);
    }
}

TEST(JoinedJpeg, SameBytesForAnyNumberOfThreads) {
  PackageReader package = package_of(testing::make_package_parts());
  EXPECT_EQ(joined_plane(package, 0, 1, {}).file(), joined_plane(package, 0, 1, {8, {}, nullptr}).file());
  EXPECT_EQ(coefficients_of(joined_plane(package, 0, 1, {}).file()),
            coefficients_of(joined_plane(package, 0, 1, {}).file(100)));
}

TEST(JoinedJpeg, PartsOfOtherImagesAreRefused) {
  testing::PackageParts parts = testing::make_package_parts();
  parts.textures[0].channels = 1;
  PackageReader package = package_of(parts);
  EXPECT_THROW(joined_plane(package, 0, 1, {}), FormatError);
}

}  // namespace texmesh::joined_jpeg_test
