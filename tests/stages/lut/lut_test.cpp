#include "stages/lut/lut.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "format/base/archive.h"
#include "format/base/sha256.h"
#include "format/rules/allocation.h"
#include "stages/fragment_codec/fragment_codec.h"
#include "stages/jpeg/jpeg.h"
#include "stages/measure/fragment_meter.h"
#include "tests/stages/lut/lut_scene.h"
#include "tests/support/all_rungs.h"

namespace texmesh::lut_test {

using namespace testing;  // NOLINT: fixtures

TEST(Lut, SizesAndDigestsAreThoseOfTheStreams) {
  const Scene s = make_scene();
  const PackageTables tables = build(s);
  ASSERT_EQ(tables.planes.size(), 2u);
  for (std::size_t p = 0; p < 2; ++p) {
    const PlaneTables& t = tables.planes[p];
    ASSERT_EQ(t.rung_count(), 10u);
    for (std::size_t r = 0; r < 10; ++r) {
      EXPECT_EQ(t.table_bytes[r], s.ladder.planes[p].rungs[r].table_stream.size());
      for (std::size_t f = 0; f < t.fragment_count(); ++f) {
        const auto stream = fragment_stream(s.ladder.planes[p].rungs[r], f);
        const std::size_t at = r * t.fragment_count() + f;
        EXPECT_EQ(t.size_bytes[at], stream.size());
        EXPECT_EQ(t.digest[at], stream.empty() ? 0 : truncated(sha256(stream)));
        EXPECT_EQ(stream.empty(), t.covered_texels[f] == 0);
      }
    }
  }
}

TEST(Lut, DistortionIsMeasuredAndFallsWithTheRung) {
  const Scene s = make_scene();
  const PlaneTables t = build(s).planes[1];
  const TexturePlane& plane = s.fragments.planes[1];
  for (std::size_t r = 0; r < t.rung_count(); ++r) {
    const Pixels decoded = decode_fragment(s.ladder.planes[1], r, 0, 1 << 20);
    double error = 0;
    int count = 0;
    for (std::uint32_t y = 0; y < plane.height_px; ++y)
      for (std::uint32_t x = 0; x < 32; ++x) {
        if (!(plane.coverage[(std::size_t{plane.width_px} + 7) / 8 * y + x / 8] >> (7 - x % 8) & 1)) continue;
        error += std::pow(s.pixels[1].at(x, y)[0] - decoded.at(x, y)[0], 2);
        ++count;
      }
    EXPECT_NEAR(t.mse[r * 2], error / count, 1e-3);
    EXPECT_EQ(t.mse[r * 2 + 1], 0);
    EXPECT_GT(t.dssim[r * 2], 0);
    EXPECT_LT(t.dssim[r * 2], 1);
    if (r == 0) continue;
    EXPECT_LT(t.mse[r * 2], t.mse[r * 2 - 2] * 1.02);
    EXPECT_LT(t.dssim[r * 2], t.dssim[r * 2 - 2] * 1.02);
  }
}

TEST(Lut, NoChannelOfDataStandsForAnother) {
  Scene s = make_scene();
  for (std::size_t k = 0; k < s.pixels[0].data.size(); k += 3)
    s.pixels[0].data[k] = s.pixels[0].data[k + 1] = 128;
  const auto measured = [&](TextureRole role) {  // only blue varies: luma has 1/77 of its square error
    s.fragments.planes[0].role = role;
    s.ladder = encode_ladder(s.fragments, s.pixels, {}, {}, testing::all_rungs(), {});
    s.previews = make_previews(s.fragments, s.pixels, {}, {});
    return build(s).planes[0];
  };
  const PlaneTables data = measured(TextureRole::kOcclusionRoughnessMetallic);
  const Pixels decoded = decode_fragment(s.ladder.planes[0], 0, 0, 1 << 20);
  const TexturePlane& plane = s.fragments.planes[0];
  double error = 0;
  for (std::uint32_t y = 0; y < 48; ++y)
    for (std::uint32_t x = 0; x < 32; ++x)
      if (plane.coverage[(std::size_t{plane.width_px} + 7) / 8 * y + x / 8] >> (7 - x % 8) & 1)
        for (std::size_t c = 0; c < 3; ++c)
          error += std::pow(s.pixels[0].at(x, y)[c] - decoded.at(x, y)[c], 2) / 3 / plane.covered_texels[0];
  EXPECT_NEAR(data.mse[0], error, error / 500);
  EXPECT_GT(data.mse[0], 10);
  const PlaneTables normal = measured(TextureRole::kNormal);
  EXPECT_GT(normal.dssim[0], 0.05) << "not a third of it: the constant channels say nothing";
}

TEST(Lut, OrderQualityAndTotals) {
  const Scene s = make_scene();
  for (const Allocation allocate :
       {Allocation::kLog, Allocation::kThesis, Allocation::kRd, Allocation::kVqp}) {
    LutOptions options;
    options.allocate = allocate;
    const PlaneTables t = build(s, options).planes[0];
    const TexturePlane& plane = s.fragments.planes[0];
    const std::vector<float>& importance = allocate == Allocation::kVqp ? t.vqp : plane.eta;
    EXPECT_EQ(t.order.size(), 9u);
    for (std::size_t k = 1; k < t.order.size(); ++k) {
      const auto key = [&](std::uint16_t f) {
        return std::tuple(-importance[f], -plane.surface_fraction[f], f);
      };
      EXPECT_LT(key(t.order[k - 1]), key(t.order[k]));
    }
    EXPECT_EQ(t.quality, (std::vector<float>{80, 60, 40}));
    EXPECT_EQ(t.allocation, static_cast<int>(allocate));
    const PlaneThesis thesis = thesis_of(s, options);
    EXPECT_EQ(thesis.quality, t.quality);
    EXPECT_EQ(thesis.vqp, s.predictors.planes[0].vqp);
    EXPECT_EQ(thesis.zeta, s.predictors.planes[0].zeta);
    ASSERT_EQ(thesis.total_bytes.size(), 3u * 21u);
    for (std::uint32_t scale = 0; scale < 3; ++scale)
      for (std::size_t g = 0; g < 21; ++g) {
        const auto quality = quality_of(t, scale, static_cast<double>(g) / 20);
        std::uint64_t sum = 0;
        for (std::size_t f = 0; f < t.fragment_count(); ++f)
          sum += t.size_bytes[nearest_rung(t, quality[f]) * t.fragment_count() + f];
        EXPECT_EQ(thesis.total_bytes[scale * 21 + g], sum);
        EXPECT_LE(thesis.total_bytes[scale * 21 + g], thesis.total_bytes[scale * 21 + (g == 0 ? 0 : g - 1)]);
      }
  }
}

TEST(Lut, SkippedFragmentsAreAsBadAsThePreview) {
  const Scene s = make_scene();
  for (std::size_t p = 0; p < 2; ++p) {
    const PlaneTables t = build(s).planes[p];
    for (std::size_t f = 0; f < t.fragment_count(); ++f) {
      if (t.covered_texels[f] == 0) {
        EXPECT_EQ(t.skip_dssim[f], 0);
        continue;
      }
      EXPECT_GT(t.skip_dssim[f], t.dssim[f]);  // noise: an eighth of the resolution shows nothing of it
      EXPECT_LT(t.skip_dssim[f], 1.5f);
    }
  }
  // A flat texture is as good in the preview.
  Scene flat = make_scene();
  for (Pixels& pixels : flat.pixels) std::fill(pixels.data.begin(), pixels.data.end(), std::uint8_t{97});
  flat.ladder = encode_ladder(flat.fragments, flat.pixels, {}, {}, testing::all_rungs(), {});
  flat.previews = make_previews(flat.fragments, flat.pixels, {}, {});
  const PlaneTables t = build(flat).planes[0];
  for (const float v : t.skip_dssim) EXPECT_NEAR(v, 0, 1e-3);
}

/// The texel between the four nearest centres of a picture that covers the same rectangle.
double bilinear(const Pixels& picture, std::uint32_t x, std::uint32_t y, std::uint32_t width,
                std::uint32_t height) {
  const auto at = [](std::uint32_t k, std::uint32_t size, std::uint32_t coarse) {
    return std::clamp((k + 0.5) * coarse / size - 0.5, 0.0, coarse - 1.0);
  };
  const double u = at(x, width, picture.width_px), v = at(y, height, picture.height_px);
  double sum = 0;
  for (std::uint32_t t = 0; t < picture.height_px; ++t)
    for (std::uint32_t s = 0; s < picture.width_px; ++s)
      sum += std::max(0.0, 1 - std::fabs(s - u)) * std::max(0.0, 1 - std::fabs(t - v)) * picture.at(s, t)[0];
  return sum;
}

TEST(Lut, SkippedFragmentsShowThePreviewOfTheirOwnImageBilinearly) {
  Scene s = make_scene();
  s.fragments.planes.push_back(plane_of(1, 1, 1));  // a mip of the second image, which has no preview
  s.fragments.planes[2].mip = 1;
  s.fragments.planes[2].base = 1;
  s.pixels.push_back({32, 48, 1, std::vector<std::uint8_t>(32 * 48)});
  for (std::size_t p = 0; p < 3; ++p)  // waves that an eighth still shows, of other lengths in each image
    for (std::size_t k = 0; k < s.pixels[p].data.size(); ++k) {
      const std::size_t texel = k / s.pixels[p].channels, x = texel % s.pixels[p].width_px,
                        y = texel / s.pixels[p].width_px;
      const double length = p == 0 ? 37 : p == 1 ? 29 : 14.5;
      s.pixels[p].data[k] = static_cast<std::uint8_t>(128 + 60 * std::sin((x + 2.0) / length * 6.28) +
                                                      50 * std::cos(y / length * 6.28));
    }
  LadderOptions ladder = testing::all_rungs();
  s.ladder = encode_ladder(s.fragments, s.pixels, {}, {}, ladder, {});
  s.previews = make_previews(s.fragments, s.pixels, {.quality = 95}, {});
  s.predictors = predict_quality(s.fragments, s.pixels, {}, {});
  const PackageTables tables = build(s);
  for (std::size_t p = 0; p < 3; ++p) {
    const TexturePlane& plane = s.fragments.planes[p];
    const Pixels preview = decode_jpeg_luma(s.previews.planes[p == 2 ? 1 : p].file, 1 << 20);
    for (const std::uint16_t f : tables.planes[p].order) {
      std::vector<std::uint8_t> source, shown, mask;
      for (std::uint32_t y = f / plane.columns * 48; y < (f / plane.columns + 1) * 48; ++y)
        for (std::uint32_t x = f % plane.columns * 32; x < (f % plane.columns + 1) * 32; ++x) {
          const bool covered = x < plane.width_px && y < plane.height_px &&
                               plane.coverage[(plane.width_px + 7) / 8 * y + x / 8] >> (7 - x % 8) & 1;
          mask.push_back(covered ? 255 : 0);
          source.push_back(measured_value(s.pixels[p].at(x, y), plane.channels, 1, 0));
          shown.push_back(
              static_cast<std::uint8_t>(bilinear(preview, x, y, plane.width_px, plane.height_px) + 0.5));
        }
      const double want = DistortionMeter(source, mask, 32, 48).against(shown).dssim;
      EXPECT_NEAR(tables.planes[p].skip_dssim[f], want, 1e-3) << p << ' ' << f;
    }
  }
}

TEST(Lut, RateDistortionSpendsNoMoreAndLosesLess) {
  const Scene s = make_scene();
  LutOptions options;
  const PlaneTables log = build(s, options).planes[0];
  options.allocate = Allocation::kRd;
  const PlaneTables rd = build(s, options).planes[0];
  const std::vector<std::uint64_t> total = thesis_of(s).total_bytes;
  EXPECT_EQ(thesis_of(s, options).total_bytes, total);
  EXPECT_EQ(rd.allocation, 2);
  for (std::uint32_t scale = 0; scale < 3; ++scale)
    for (std::size_t g = 0; g < 21; g += 4) {
      const auto a = rungs_of(log, scale, static_cast<double>(g) / 20),
                 b = rungs_of(rd, scale, static_cast<double>(g) / 20);
      EXPECT_EQ(sum_of(bytes_of(log, a)), total[scale * 21 + g]);
      EXPECT_LE(sum_of(bytes_of(rd, b)), total[scale * 21 + g]);
      // A step that does not fit ends its fragment's walk: with so few of them up to a step's bytes are left
      // over.
      EXPECT_LE(surface_dssim(rd, b), 1.01 * surface_dssim(log, a) + 1e-6);
    }
}

TEST(Lut, EveryRoleHasItsOwnLeastQuality) {
  Scene s = make_scene();
  const auto least = [&](TextureRole role, const LutOptions& options) {
    s.fragments.planes[1].role = role;
    return build(s, options).planes[1].quality_min;
  };
  LutOptions options;
  EXPECT_EQ(least(TextureRole::kAlpha, options), 18);
  options.normal_quality_min = 41, options.data_quality_min = 42, options.alpha_quality_min = 43;
  for (const TextureRole role : {TextureRole::kBaseColour, TextureRole::kEmissive, TextureRole::kColour})
    EXPECT_EQ(least(role, options), 5);
  EXPECT_EQ(least(TextureRole::kNormal, options), 41);
  EXPECT_EQ(least(TextureRole::kOcclusionRoughnessMetallic, options), 42);
  EXPECT_EQ(least(TextureRole::kData, options), 42);
  EXPECT_EQ(least(TextureRole::kAlpha, options), 43);
  options.quality_min = 60;
  EXPECT_EQ(least(TextureRole::kNormal, options), 60) << "the least of all holds for all";
  options.quality_min = 5, options.quality_max = 40;
  EXPECT_EQ(least(TextureRole::kNormal, options), 40) << "the highest goes before";

  // It is what the fragments are asked for, and what they cost.
  options = {.quality_fine = 20, .quality_coarse = 20};
  options.data_quality_min = 80;
  s.fragments.planes[1].role = TextureRole::kData;
  const PackageTables tables = build(s, options);
  for (const float q : quality_of(tables.planes[1], 0, 0.5)) EXPECT_EQ(q, 80);
  for (const float q : quality_of(tables.planes[0], 0, 0.5)) EXPECT_LT(q, 40);
  const std::uint64_t dear = thesis_of(s, options, 1).total_bytes[0];
  options.data_quality_min = 18;
  EXPECT_GT(dear, thesis_of(s, options, 1).total_bytes[0]);
}

TEST(Lut, TablesPassTheirCodec) {
  const LutTables made = build_all(make_scene());
  const auto bytes = write_tables(made.tables);
  EXPECT_EQ(write_tables(read_tables(bytes)), bytes);
  const auto thesis = write_thesis(made.thesis);
  EXPECT_EQ(write_thesis(read_thesis(thesis).tables), thesis);
}

TEST(Lut, SameTablesForAnyNumberOfThreads) {
  const Scene s = make_scene();
  const LutTables one = build_all(s, {}, 1), eight = build_all(s, {}, 8);
  EXPECT_EQ(encode_artefact(one.tables), encode_artefact(eight.tables));
  EXPECT_EQ(encode_artefact(one.thesis), encode_artefact(eight.thesis));
}

TEST(Lut, EmptyAndUnfitInput) {
  EXPECT_TRUE(build({}).planes.empty());
  Scene s = make_scene();
  s.ladder.planes[0].rungs[3].offset.pop_back();
  EXPECT_THROW(build(s), StageError);
  s = make_scene();
  s.predictors.planes.pop_back();
  EXPECT_THROW(build(s), StageError);
  s = make_scene();
  s.ladder.planes[0].rungs[0].data[s.ladder.planes[0].rungs[0].data.size() / 2] = 0xff;
  s.ladder.planes[0].rungs[0].data[s.ladder.planes[0].rungs[0].data.size() / 2 + 1] = 0xd9;
  EXPECT_THROW(build(s), FormatError);
  LutOptions options;
  options.quality_min = 90;
  options.quality_max = 50;
  EXPECT_THROW(build(make_scene(), options), StageError);

  s = make_scene();
  for (TexturePlane& p : s.fragments.planes) {
    std::fill(p.covered_texels.begin(), p.covered_texels.end(), 0u);
    std::fill(p.coverage.begin(), p.coverage.end(), std::uint8_t{0});
  }
  s.ladder = encode_ladder(s.fragments, s.pixels, {}, {}, testing::all_rungs(), {});
  s.previews = make_previews(s.fragments, s.pixels, {}, {});
  s.predictors = predict_quality(s.fragments, s.pixels, {}, {});
  const PackageTables none = build(s);
  EXPECT_TRUE(none.planes[0].order.empty());
  EXPECT_EQ(thesis_of(s).total_bytes[0], 0u);
  EXPECT_NO_THROW(write_tables(none));
}

TEST(Lut, DefaultQualityFollowsTheNumberOfFeaturePoints) {
  Scene s = make_scene();
  LutOptions options;
  options.default_quality = DefaultQuality::kFeatures;
  TexturePlane& plane = s.fragments.planes[0];
  const std::size_t n = plane.fragment_count();
  for (std::size_t k = 0; k < plane.features.size(); ++k)  // a quarter of S_0's, then none
    plane.features[k] = k < n ? 8 : k < 2 * n ? 2 : 0;
  const std::vector<float> quality = build(s, options).planes[0].quality;
  ASSERT_EQ(quality.size(), 3u);
  EXPECT_EQ(quality, (std::vector<float>{80, 50, 40}));
  std::ranges::fill(plane.features, 0);
  EXPECT_EQ(build(s, options).planes[0].quality, (std::vector<float>{80, 40, 40})) << "no feature points";
  EXPECT_EQ(build(s).planes[0].quality, (std::vector<float>{80, 60, 40})) << "by distance";
}

TEST(Lut, PredictorsAssignQualityAsTheFileStoresThem) {
  const Scene s = make_scene();
  LutOptions options;
  options.allocate = Allocation::kVqp;
  const PlaneTables t = build(s, options).planes[0];
  ASSERT_EQ(t.vqp.size(), t.fragment_count());
  for (std::size_t f = 0; f < t.fragment_count(); ++f)
    EXPECT_NEAR(t.vqp[f], s.predictors.planes[0].vqp[f], 1.0 / 65535);
  EXPECT_EQ(t.density_weight, 0.25f);
  const double gamma = mean_eta(t, 1);
  const std::vector<float> q = quality_of(t, 1, gamma), vqp = eta_of(t, 1);
  for (const std::uint16_t f : t.order)
    EXPECT_FLOAT_EQ(q[f], std::clamp(static_cast<float>(60 + (vqp[f] - gamma) * 60), 5.0f, 97.0f));
  EXPECT_NE(vqp, t.vqp) << "the density of the scale, not that of S_0";
  EXPECT_EQ(read_tables(write_tables({{t}}, 1)).planes[0].vqp, t.vqp);
  EXPECT_TRUE(build(s).planes[0].vqp.empty());
}

}  // namespace texmesh::lut_test
