#include "stages/quality/quality.h"

#include <gtest/gtest.h>

#include "tests/stages/quality/quality_samples.h"

namespace texmesh::quality_test {

using namespace testing;  // NOLINT: fixtures

TEST(Quality, TableHasKeptScalesSizesAndGroups) {
  const QualityTable t = measure(sample_sheet(true));
  EXPECT_EQ(t.scales, (std::vector<int>{0, 3, 9}));
  EXPECT_EQ(t.sizes_px, (std::vector<std::uint32_t>{64, 128, 256}));
  EXPECT_EQ(t.views, 3u);
  ASSERT_EQ(t.geometry.size(), 3u);
  for (const PictureLosses& g : t.geometry) EXPECT_EQ(g.size(), 3u);
  ASSERT_EQ(t.groups.size(), 1u);
  EXPECT_EQ(t.groups[0].group, PlaneGroup::kColour);
  ASSERT_EQ(t.groups[0].sizes.size(), 3u);
  for (const TextureLosses& losses : t.groups[0].sizes) {
    EXPECT_GE(losses.texel_dssim.size(), 2u);
    EXPECT_EQ(losses.preview.size(), 1u);
    EXPECT_EQ(losses.coarser.size(), 2u);
    EXPECT_EQ(losses.finer.size(), 5u);
    EXPECT_TRUE(std::ranges::is_sorted(losses.finer.flip, std::greater<>()));
  }
  EXPECT_EQ(read_quality(std::vector<std::uint8_t>([&] {
              const std::string json = write_quality(t);
              return std::vector<std::uint8_t>(json.begin(), json.end());
            }())),
            t);
}

TEST(Quality, LossesGrowWithScaleAndWithWorseTexels) {
  const QualityTable t = measure(sample_sheet(true));
  for (const PictureLosses& g : t.geometry) {
    EXPECT_EQ(g.flip[0], 0);
    EXPECT_EQ(g.flip_p95[0], 0);
    EXPECT_EQ(g.dssim[0], 0);
    EXPECT_GT(g.flip[1], 0);
    EXPECT_GT(g.flip[2], g.flip[1]);
    EXPECT_GT(g.flip_p95[2], g.flip[2]);
    EXPECT_GT(g.dssim[2], g.dssim[1]);
  }
  for (const TextureLosses& losses : t.groups[0].sizes) {
    EXPECT_TRUE(std::ranges::is_sorted(losses.texel_dssim));
    EXPECT_TRUE(std::ranges::is_sorted(losses.coded.flip));
    EXPECT_GT(losses.coded.flip.back(), 1.5f * losses.coded.flip.front());
    EXPECT_TRUE(std::ranges::is_sorted(losses.coarser.flip));
    EXPECT_GT(losses.coarser.flip.back(), 0);
  }
}

TEST(Quality, KnotsGiveWhatWasMeasuredWhenFragmentsAreRead) {
  // Fragments of one rung differ; the mean of what the curve says of each is what the picture shows.
  const Sample s = sample_sheet(true);
  const QualityTable t = measure(s);
  const PlaneTables& plane = s.tables.planes[0];
  const GroupCurve curve(t, PlaneGroup::kColour, 64);
  const TextureLosses& losses = t.groups[0].sizes[0];
  double sum = 0;
  for (std::size_t f = 0; f < 4; ++f) sum += curve.coded(static_cast<double>(plane.dssim[f])) / 4;
  const double lowest = static_cast<double>(losses.coded.flip.back());
  EXPECT_NEAR(sum, lowest, 0.1 * lowest);
}

TEST(Quality, SamplesOfEverythingTogetherArePredicted) {
  const QualityTable t = measure(sample_sheet(true));
  EXPECT_GE(t.exponent, 1);
  EXPECT_LE(t.exponent, 4);
  EXPECT_GT(t.error, 0);
  EXPECT_LT(t.error, 0.2);
}

TEST(Quality, EqualScalesPassEverywhereAndLoseNothing) {
  Sample s = sample_sheet(false);
  for (NestedScale& scale : s.scales.scales) {
    const int number = scale.scale;
    scale = s.scales.scales[0];
    scale.scale = number;
  }
  const MeasuredQuality m = measure_all(s, small_options());
  EXPECT_EQ(m.display_px_flip, (std::vector<float>{static_cast<float>(kAnyDisplayPx), 256, 256}));
  for (const PictureLosses& g : m.table.geometry)
    for (const auto* list : {&g.flip, &g.flip_p95, &g.dssim})
      for (const float x : *list) EXPECT_NEAR(x, 0, 1e-6);
  EXPECT_TRUE(m.table.groups.empty());
  EXPECT_EQ(m.table.exponent, 1);
  EXPECT_EQ(m.table.error, 0);
}

TEST(Quality, SwitchSizesAreHeightsOfTheGridAndFollowTheThresholds) {
  const Sample s = sample_sheet(true);
  QualityOptions options = small_options();
  const std::vector<float> usual = measure_all(s, options).display_px_flip;
  ASSERT_EQ(usual.size(), 3u);
  EXPECT_GE(usual[1], usual[2]) << "the finer scale serves longer";
  for (const float px : usual) {
    if (px == 0 || px == static_cast<float>(kAnyDisplayPx)) continue;
    const double halves = 2 * std::log2(256 / static_cast<double>(px));
    EXPECT_NEAR(halves, std::round(halves), 1e-5) << px;
  }
  options.flip_mean = options.flip_p95 = 1;
  EXPECT_EQ(measure_all(s, options).display_px_flip[2], 256) << "anything passes";
  options.flip_mean = 0;
  EXPECT_EQ(measure_all(s, options).display_px_flip[1], 0) << "nothing passes";
  options = small_options();
  options.flip_p95 = 0;
  EXPECT_EQ(measure_all(s, options).display_px_flip[1], 0);
}

TEST(Quality, AScaleThatIsVisiblyDifferentPassesNowhere) {
  Sample s = sample_sheet(false);
  NestedScale& coarsest = s.scales.scales.back();
  coarsest.triangles.resize(coarsest.triangles.size() / 2);
  coarsest.triangle_source.resize(coarsest.triangles.size());
  EXPECT_EQ(measure_all(s, small_options()).display_px_flip.back(), 0);
}

TEST(Quality, FragmentsThatNoRungStoresStayAsTheSource) {
  Sample s = sample_sheet(true);
  for (LadderRung& rung : s.ladder.planes[0].rungs) {
    rung.data.clear();
    rung.offset.assign(5, 0);
  }
  const QualityTable t = measure(s);
  const PictureLosses& coded = t.groups[0].sizes[0].coded;
  EXPECT_EQ(coded.flip.front(), 0);
  EXPECT_EQ(coded.dssim.front(), 0);
}

TEST(Quality, TheReferenceIsTheSourcesImage) {
  Sample s = sample_sheet(true);
  Pixels bright = s.pixels[0];
  for (std::uint8_t& x : bright.data) x = static_cast<std::uint8_t>(std::min(255, x + 40));
  s.images[0] = image_of(s.fragments.planes[0], bright);
  const TextureLosses filled = measure(s).groups[0].sizes[0];
  EXPECT_GT(filled.finer.flip.front(), 0.02f) << "what is filled otherwise shows";
  EXPECT_EQ(filled.finer.flip.back(), filled.finer.flip.front()) << "in all mips";
}

TEST(Quality, FullSizeIsTheRungOfTheSourcesTexels) {
  Sample s = sample_sheet(true);
  const TextureLosses filled = measure(s).groups[0].sizes[0];
  EXPECT_EQ(filled.finer.flip.back(), 0) << "pixels are the image's";
  s.ladder.planes[0].source_rung = true;
  const TextureLosses coded = measure(s).groups[0].sizes[0];
  EXPECT_GT(coded.finer.flip.back(), 0) << "what the last rung loses";
  EXPECT_LT(coded.finer.flip.back(), coded.coded.flip.back());
}

TEST(Quality, ImagesThatAreMissingOrBrokenAreErrors) {
  Sample s = sample_sheet(true);
  s.images[0].bytes.resize(s.images[0].bytes.size() / 2);
  EXPECT_THROW(measure(s), InputError);
  s.images.clear();
  EXPECT_THROW(measure(s), StageError);
}

TEST(Quality, VertexColoursShow) {
  Sample s = sample_sheet(false);
  const QualityTable plain = measure(s);
  testing::Random random{3};
  for (std::size_t w = 0; w < s.scales.mesh.wedge_count(); ++w)
    s.scales.mesh.colours.push_back({static_cast<float>(random.uniform()), 0.5f, 0.5f, 1});
  EXPECT_GT(measure(s).geometry[1].flip[2], plain.geometry[1].flip[2]);
}

TEST(Quality, GroupsAreMeasuredApart) {
  Sample s = sample_sheet(true);
  s.fragments.planes.push_back(s.fragments.planes[0]);
  s.fragments.planes[1].role = TextureRole::kNormal;
  s.fragments.planes[1].image = 1;
  Pixels flat = s.pixels[0];
  for (std::size_t i = 0; i < flat.data.size(); ++i) flat.data[i] = i % 3 == 2 ? 255 : 128;
  s.pixels.push_back(flat);
  encode(s);
  s.materials[0].normal_texture.image = 1;
  const QualityTable t = measure(s);
  ASSERT_EQ(t.groups.size(), 2u);
  EXPECT_EQ(t.groups[1].group, PlaneGroup::kNormal);
  const std::vector<float> alone = measure(sample_sheet(true)).groups[0].sizes[0].coded.flip;
  ASSERT_EQ(t.groups[0].sizes[0].coded.size(), alone.size());
  for (std::size_t k = 0; k < alone.size(); ++k)
    EXPECT_NEAR(t.groups[0].sizes[0].coded.flip[k], alone[k], 0.01f)
        << "a flat normal map changes no colours";
  EXPECT_LT(t.groups[1].sizes[0].coded.flip[0], 0.01f);
  EXPECT_LT(t.groups[1].sizes[0].coarser.flip.back(), 1e-4f) << "flat stays flat";
}

TEST(Quality, LargeSizesOfASmallModelFollowFromTheRenderedOnes) {
  const Sample s = sample_sheet(true);
  QualityOptions options = small_options();
  options.largest_px = 128;
  const QualityTable rendered = measure_all(s, options).table;
  EXPECT_EQ(rendered.sizes_px, (std::vector<std::uint32_t>{32, 64, 128})) << "halves of 64 px cost nothing";
  options.largest_px = 512;
  const QualityTable t = measure_all(s, options).table;
  ASSERT_EQ(t.sizes_px, (std::vector<std::uint32_t>{128, 256, 512}));
  const float whole = rendered.groups[0].sizes[2].preview.flip[0];
  EXPECT_NEAR(t.groups[0].sizes[0].preview.flip[0], whole, 0.1f * whole);
  for (std::size_t k = 1; k < t.scales.size(); ++k)
    EXPECT_NEAR(t.geometry[0].flip[k], rendered.geometry[2].flip[k], 0.2f * rendered.geometry[2].flip[k]);
  const float coarser = rendered.groups[0].sizes[2].coarser.flip[0];
  EXPECT_NEAR(t.groups[0].sizes[0].coarser.flip[0], coarser, 0.1f * coarser);
  EXPECT_GT(rendered.error, 0);
  EXPECT_NE(t.exponent, rendered.exponent) << "fitted over many models";
  for (std::size_t i = 1; i < 3; ++i) {
    const float before = t.geometry[i - 1].flip.back(), now = t.geometry[i].flip.back();
    EXPECT_GE(now, before);
    EXPECT_LE(now, 1.6f * before);
    EXPECT_GT(t.groups[0].sizes[i].coarser.flip[0], t.groups[0].sizes[i - 1].coarser.flip[0]);
  }
}

TEST(Quality, SameForAnyNumberOfThreads) {
  const Sample s = sample_sheet(true);
  const MeasuredQuality one = measure_all(s, small_options(), 1), four = measure_all(s, small_options(), 4);
  EXPECT_EQ(one.table, four.table);
  EXPECT_EQ(one.display_px_flip, four.display_px_flip);
}

TEST(Quality, OneRungOneViewAndTexturesOfOnePixelDo) {
  QualityOptions options = small_options();
  options.views = options.large_views = options.rung_samples = 1;
  EXPECT_EQ(measure_all(sample_sheet(true), options).table.views, 1u);
  Sample s = sample_sheet(true);
  TexturePlane& plane = s.fragments.planes[0];
  plane.width_px = plane.height_px = 1;
  plane.fragment_width_px = plane.fragment_height_px = 16;
  plane.columns = plane.rows = 1;
  plane.coverage.assign(1, 0xff);
  plane.covered_texels = {1};
  plane.surface_fraction = {1};
  plane.features = {1};
  plane.eta = {0};
  s.pixels[0] = {16, 16, 3, std::vector<std::uint8_t>(768, 99)};
  encode(s);
  const QualityTable t = measure(s);
  ASSERT_EQ(t.groups.size(), 1u);
  EXPECT_FALSE(write_quality(t).empty());
}

}  // namespace texmesh::quality_test
