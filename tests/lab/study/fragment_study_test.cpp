#include "lab/study/fragment_study.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <tuple>

#include "stages/jpeg/jpeg_coder.h"
#include "tests/support/meshes.h"

namespace texmesh::fragment_study_test {

Pixels picture(std::uint32_t width, std::uint32_t height, std::uint32_t channels) {
  testing::Random random{77};
  Pixels p{width, height, channels, {}};
  for (std::uint32_t y = 0; y < height; ++y)
    for (std::uint32_t x = 0; x < width; ++x)
      for (std::uint32_t c = 0; c < channels; ++c)
        p.data.push_back(static_cast<std::uint8_t>(60 + (x * 5 + y * 3 + c * 20) % 120 + random.next() % 20));
  return p;
}

std::vector<FragmentStudyRow> study(const Pixels& pixels, const FragmentStudyOptions& options,
                                    int threads = 1) {
  RunContext context;
  context.threads = threads;
  return study_fragments(pixels, options, context);
}

TEST(FragmentStudy, RowsAndTheWholeImageAsOneFragment) {
  FragmentStudyOptions options;
  options.grids = {1, 2, 4};
  options.qualities = {20, 60, 95};
  const auto rows = study(picture(128, 96, 3), options);
  ASSERT_EQ(rows.size(), 9u);
  for (std::size_t k = 0; k < 9; ++k) {
    EXPECT_EQ(rows[k].grid, options.grids[k / 3]);
    EXPECT_EQ(rows[k].quality, options.qualities[k % 3]);
    EXPECT_EQ(rows[k].file_standard, rows[k % 3].file_standard);
  }
  for (std::size_t q = 0; q < 3; ++q) {
    // One fragment is the file.
    EXPECT_EQ(rows[q].sum_standard, rows[q].file_standard);
    EXPECT_EQ(rows[q].sum_optimised, rows[q].file_optimised);
    // Each further fragment brings a header and tables of its own, unless these are shared.
    EXPECT_GT(rows[3 + q].sum_standard, rows[q].sum_standard + 3 * 500);
    EXPECT_GT(rows[6 + q].sum_optimised, rows[3 + q].sum_optimised);
    EXPECT_LT(rows[6 + q].sum_shared, rows[6 + q].sum_optimised);
  }
  EXPECT_EQ(std::tuple(rows[8].fragment_width_px, rows[8].fragment_height_px), std::tuple(32u, 32u));
}

TEST(FragmentStudy, StandardFilesAreWhatAnyProgramWrites) {
  // 2 + 18 + 2 * 69 (quantisers) + 19 (frame) + 432 (Huffman tables, 4 segments) + 14 (scan) + 2 around the
  // data.
  const Pixels p = picture(64, 64, 3);
  FragmentStudyOptions options;
  options.grids = {1};
  options.qualities = {50};
  JpegCoder coder({3, 50, Subsampling::k420});
  std::vector<std::uint8_t> body;  // SOI data EOI
  coder.append_body({p.data.data(), 64 * 3, 64, 64}, body);
  EXPECT_EQ(study(p, options)[0].file_standard, 2 + 18 + 2 * 69 + 19 + 432 + 14 + body.size() - 2);
}

TEST(FragmentStudy, WithoutOptimisedFilesTheOtherSizesAreTheSame) {
  FragmentStudyOptions options;
  options.grids = {2};
  options.qualities = {20, 90};
  const Pixels p = picture(64, 96, 3);
  const auto all = study(p, options);
  options.optimised = false;
  const auto fewer = study(p, options);
  ASSERT_EQ(fewer.size(), all.size());
  for (std::size_t k = 0; k < all.size(); ++k) {
    EXPECT_EQ(fewer[k].sum_optimised + fewer[k].file_optimised, 0u);
    EXPECT_EQ(fewer[k].file_standard, all[k].file_standard);
    EXPECT_EQ(fewer[k].sum_standard, all[k].sum_standard);
    EXPECT_EQ(fewer[k].sum_shared, all[k].sum_shared);
  }
}

TEST(FragmentStudy, AFileIsOfTheKindOfItsFragmentsAtEveryQuality) {
  FragmentStudyOptions options;
  options.grids = {1};
  options.qualities = {90, 99, 100};
  for (const FragmentStudyRow& row : study(picture(256, 256, 3), options))
    EXPECT_NEAR(static_cast<double>(row.sum_shared) / static_cast<double>(row.file_optimised), 1, 0.05)
        << row.quality;
}

TEST(FragmentStudy, OddSizesGreyAndTinyImages) {
  FragmentStudyOptions options;
  options.grids = {2, 16};
  options.qualities = {60};
  const auto odd = study(picture(101, 57, 1), options);
  ASSERT_EQ(odd.size(), 2u);
  EXPECT_EQ(odd[0].fragment_width_px, 64u);
  EXPECT_EQ(odd[0].fragment_height_px, 32u);
  // 16 x 16 of at least 16 px do not fit: 7 x 4 do.
  EXPECT_EQ(std::tuple(odd[1].columns, odd[1].rows), std::tuple(7u, 4u));
  const auto tiny = study(picture(1, 1, 3), options);
  ASSERT_EQ(tiny.size(), 2u);
  EXPECT_EQ(tiny[1].columns * tiny[1].rows, 1u);
}

TEST(FragmentStudy, OnlyFragmentsThatHoldSomeOfTheImageCount) {
  FragmentStudyOptions options;
  options.grids = {64, 8, 64};
  options.qualities = {50};
  const auto rows = study(picture(128, 128, 3), options);
  ASSERT_EQ(rows.size(), 2u) << "a grid that is listed twice counts once";
  EXPECT_EQ(std::tuple(rows[0].columns, rows[0].rows), std::tuple(8u, 8u));
  EXPECT_EQ(rows[0].sum_standard, rows[1].sum_standard);
  EXPECT_EQ(rows[0].sum_shared, rows[1].sum_shared);
  options.grids = {2};
  const auto thin = study(picture(15, 700, 1), options);
  EXPECT_EQ(std::tuple(thin[0].columns, thin[0].rows), std::tuple(1u, 2u));
}

TEST(FragmentStudy, SameRowsForAnyNumberOfThreads) {
  FragmentStudyOptions options;
  options.grids = {2, 4};
  options.qualities = {10, 90};
  const auto one = study(picture(128, 128, 3), options, 1), eight = study(picture(128, 128, 3), options, 8);
  ASSERT_EQ(one.size(), eight.size());
  for (std::size_t k = 0; k < one.size(); ++k) {
    EXPECT_EQ(one[k].sum_standard, eight[k].sum_standard);
    EXPECT_EQ(one[k].sum_optimised, eight[k].sum_optimised);
    EXPECT_EQ(one[k].sum_shared, eight[k].sum_shared);
  }
}

TEST(FragmentStudy, BadOptionsAreRefused) {
  const auto refused = [](auto change) {
    FragmentStudyOptions options;
    change(options);
    EXPECT_THROW(study(picture(32, 32, 3), options), StageError);
  };
  refused([](FragmentStudyOptions& o) { o.grids = {}; });
  refused([](FragmentStudyOptions& o) { o.grids = {0}; });
  refused([](FragmentStudyOptions& o) { o.grids = {65}; });
  refused([](FragmentStudyOptions& o) { o.qualities = {}; });
  refused([](FragmentStudyOptions& o) { o.qualities = {50, 50}; });
  refused([](FragmentStudyOptions& o) { o.qualities = {0}; });
  refused([](FragmentStudyOptions& o) { o.qualities = {101}; });
  EXPECT_THROW(study(picture(32, 32, 2), {}), StageError);
  EXPECT_THROW(study({}, {}), StageError);
}

TEST(FragmentStudy, ADecodeIsTimedByTheClockThatIsGiven) {
  Pixels image{64, 48, 3, {}};
  for (std::size_t k = 0; k < image.width_px * image.height_px * 3u; ++k)
    image.data.push_back(static_cast<std::uint8_t>(k * 7 % 251));
  FragmentStudyOptions options{{2}, {30, 80}};
  EXPECT_EQ(study_fragments(image, options, {})[0].file_decode_s, 0) << "no clock";
  double now = 0;
  options.clock_s = [&] { return now += 1; };
  for (const FragmentStudyRow& row : study_fragments(image, options, {})) {
    EXPECT_EQ(row.file_decode_s, 1);
    EXPECT_EQ(row.fragments_decode_s, 1);
  }
  EXPECT_EQ(now, 24) << "two looks at the clock, three times each, of two ways and two rows";
}

}  // namespace texmesh::fragment_study_test
