// Sizes that the texture part promises, as ratios on one made atlas: they are the same on every machine, so a
// bound stands a little above what is measured, and what makes packages larger does not pass unseen.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "lab/study/fragment_study.h"
#include "stages/fill/fill.h"
#include "stages/image/decode_image.h"
#include "stages/image/png_writer.h"
#include "stages/ladder/ladder.h"
#include "stages/lut/lut.h"
#include "stages/previews/previews.h"
#include "stages/zim/zim.h"
#include "tests/support/all_rungs.h"
#include "tests/support/allocation_curves.h"
#include "tests/support/fill_curves.h"
#include "tests/support/made_texture.h"
#include "tests/support/meshes.h"

namespace texmesh::fragment_codec_figures_test {

using testing::made_texture, testing::make_scene, testing::Scene, testing::texture_hash, testing::threads;

constexpr std::uint32_t kSidePx = 1024, kFragmentPx = 128;
constexpr int kBackground = 80;

/// Ovals in a lattice: a little more than half of the atlas.
bool in_chart(std::uint32_t x, std::uint32_t y) {
  constexpr int kCell = 120;
  const int column = static_cast<int>(x) / kCell, row = static_cast<int>(y) / kCell;
  const int u = static_cast<int>(x) % kCell - kCell / 2, v = static_cast<int>(y) % kCell - kCell / 2;
  const int wide = 46 + (column * 7 + row * 3) % 11, high = 46 + (column * 5 + row * 8) % 11;
  return u * u * high * high + v * v * wide * wide < wide * wide * high * high;
}

/// Half of the atlas is charts, the rest one grey. Fragments differ: grain falls from the left to the right,
/// surface and features at random.
Scene half_covered_atlas() {
  Scene scene = make_scene(made_texture(kSidePx), kFragmentPx);
  TexturePlane& plane = scene.fragments.planes[0];
  plane.coverage.assign(plane.coverage.size(), 0);
  plane.covered_texels.assign(plane.fragment_count(), 0);
  std::uint8_t* texel = scene.pixels[0].data.data();
  for (std::uint32_t y = 0; y < kSidePx; ++y)
    for (std::uint32_t x = 0; x < kSidePx; ++x, texel += 3) {
      const int grain = static_cast<int>(texture_hash(x, y, 500) % 25) - 12;
      const int most = 8 - static_cast<int>(x / kFragmentPx);
      for (int c = 0; c < 3; ++c)
        texel[c] = static_cast<std::uint8_t>(
            in_chart(x, y) ? std::clamp(2 * texel[c] - 110 + grain * most / 8, 0, 255) : kBackground);
      if (!in_chart(x, y)) continue;
      plane.coverage[kSidePx / 8 * y + x / 8] |= static_cast<std::uint8_t>(0x80 >> x % 8);
      ++plane.covered_texels[y / kFragmentPx * plane.columns + x / kFragmentPx];
    }
  testing::Random random{17};
  std::uint32_t most = 0;
  for (std::size_t f = 0; f < plane.fragment_count(); ++f) {
    const std::uint32_t density = 1 + random.next() % 4;
    plane.surface_fraction[f] = static_cast<float>(plane.covered_texels[f] * density) / (1 << 21);
    plane.features[f] = 10 + random.next() % 90;
    most = std::max(most, plane.features[f]);
  }
  for (std::size_t f = 0; f < plane.fragment_count(); ++f)
    plane.eta[f] = static_cast<float>(plane.features[f] - 10) / static_cast<float>(most - 10);
  return scene;
}

/// The pixels that the ladder is given for it.
std::vector<Pixels> filled(const Scene& scene, const RunContext& context) {
  const std::vector<Image> image{probe_image("atlas.png", write_png(scene.pixels[0]), {})};
  return fill_planes(scene.fragments, image, Fill::kPushPull, context, PartBlocks::kSmooth);
}

TEST(TextureFigures, SharedTablesAgainstOneFile) {
  // Of 256 px and 128 px; the image has every row's first DC step, which costs most where blocks are cheap.
  constexpr double kOfOptimised[] = {1.042, 1.028, 1.012, 1.087, 1.051, 1.019};
  constexpr double kOfStandard[] = {0.467, 0.726, 0.941, 0.487, 0.742, 0.947};
  FragmentStudyOptions options;
  options.grids = {4, 8};
  options.qualities = {10, 50, 90};
  const auto rows = study_fragments(made_texture(kSidePx), options, threads(2));
  ASSERT_EQ(rows.size(), 6u);
  for (std::size_t k = 0; k < 6; ++k) {
    const auto shared = static_cast<double>(rows[k].sum_shared);
    EXPECT_LT(shared / static_cast<double>(rows[k].file_optimised), kOfOptimised[k]) << k;
    EXPECT_LT(shared / static_cast<double>(rows[k].file_standard), kOfStandard[k]) << k;
  }
}

TEST(TextureFigures, FreeTexelsAgainstTheBackgroundAtEqualErrorOfWhatIsCovered) {
  const Scene scene = half_covered_atlas();
  const RunContext context = threads(2);
  const auto curve = [&](const std::vector<Pixels>& pixels, Uncovered uncovered) {
    LadderOptions options = testing::all_rungs();
    options.uncovered = uncovered;
    const PackageTables tables =
        build_tables(scene.fragments, pixels, predict_quality(scene.fragments, pixels, {}, context),
                     encode_ladder(scene.fragments, pixels, {}, {}, options, context),
                     make_previews(scene.fragments, pixels, {}, context), {}, context)
            .tables;
    return testing::fill_curve(tables, {0});
  };
  const auto background = curve(scene.pixels, Uncovered::kKept);
  const auto free = curve(filled(scene, context), Uncovered::kFree);
  double product = 1;
  for (std::size_t r = 3; r < 8; ++r) {  // quality 18 to 86
    const double ratio = testing::bytes_at(free, background[r].psnr) / background[r].bytes;
    EXPECT_GT(ratio, 0) << r;
    EXPECT_LT(ratio, 0.61) << r;
    product *= ratio;
  }
  EXPECT_LT(std::pow(product, 0.2), 0.445);
}

TEST(TextureFigures, AllocationsAgainstOneQualityEverywhereAtEqualLossOfTheSurface) {
  const Scene scene = half_covered_atlas();
  const RunContext context = threads(2);
  const auto pixels = filled(scene, context);
  const testing::Planes planes{
      build_tables(scene.fragments, pixels, predict_quality(scene.fragments, pixels, {}, context),
                   encode_ladder(scene.fragments, pixels, {}, {}, testing::all_rungs(), context),
                   make_previews(scene.fragments, pixels, {}, context), {}, context)
          .tables.planes};
  testing::Curve all;
  for (std::size_t r = 0; r < planes.tables[0].rung_count(); ++r) all.push_back(testing::uniform(planes, r));
  const testing::Curve inner(all.begin() + 1, all.end() - 1);
  ASSERT_EQ(planes.tables[0].allocation, static_cast<int>(Allocation::kLog));
  EXPECT_LT(testing::over_uniform(testing::swept(planes, 1, 0, -1), inner).worst, 1.006) << "the default";
  const testing::Ratios rd = testing::over_uniform(
      testing::rate_distortion(planes, all.front().bytes * 0.5, all.back().bytes), inner);
  EXPECT_GT(rd.mean, 0);
  EXPECT_LT(rd.mean, 0.70);
  EXPECT_LT(rd.worst, 0.90);

  PlaneTables chosen = planes.tables[0];
  for (const double gamma : {0.2, 0.5, 0.8}) {
    const auto by_log = rungs_of(planes.tables[0], 0, gamma);
    chosen.allocation = static_cast<std::uint8_t>(Allocation::kRd);
    const auto by_rd = rungs_of(chosen, 0, gamma);
    EXPECT_LE(sum_of(bytes_of(chosen, by_rd)), sum_of(bytes_of(chosen, by_log)));
    EXPECT_LT(surface_dssim(chosen, by_rd), 0.90 * surface_dssim(chosen, by_log)) << gamma;
  }
}

}  // namespace texmesh::fragment_codec_figures_test
