#include "stages/lut/size_model.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/stages/lut/lut_scene.h"
#include "tests/support/all_rungs.h"

namespace texmesh {
namespace {

using namespace testing;  // NOLINT: fixtures

TEST(SizeModel, FitsAndIsAbsentForOneRung) {
  const PlaneTables t = build(make_scene()).planes[0];
  const PlaneThesis thesis = thesis_of(make_scene());
  const SizeModel& model = thesis.model;
  EXPECT_GT(model.correlation, 0.95f);
  EXPECT_LT(model.error, 0.2f);
  EXPECT_GT(model.r, 1.0f);
  double predictor = 0;
  for (std::uint16_t f : t.order) predictor += thesis.vqp[f] / static_cast<double>(t.order.size());
  EXPECT_NEAR(model.b, std::log(model.r) / std::log(100 * predictor), 1e-4);
  // Nine fragments of 32 x 48 texels in 4:2:0: 36 blocks of two bits each, SOI and EOI.
  const double constant = 9 * (4 + 36.0 / 4);
  double error = 0;
  for (std::size_t r = 2; r < 9; ++r) {  // of quality 10 to 95
    double size = 0;
    for (std::size_t f = 0; f < t.fragment_count(); ++f) size += t.size_bytes[r * t.fragment_count() + f];
    error += std::fabs(model.a * std::pow(model.r, t.rung_quality[r]) + constant - size) / size / 7;
  }
  EXPECT_NEAR(model.error, error, 1e-3);

  LadderOptions one = testing::all_rungs();
  one.rungs = {50};
  EXPECT_EQ(thesis_of(make_scene(one)).model, SizeModel{});
}

TEST(SizeModel, IsNotFittedOnTheSourcesCoefficients) {
  LadderOptions options = testing::all_rungs();
  options.rungs = {50, 60, 100};  // two within the model's range: all are taken that may be
  Scene s = make_scene(options);
  EXPECT_GT(thesis_of(s).model.error, 0.01f);
  s.ladder.planes[0].source_rung = true;
  const SizeModel model = thesis_of(s).model;
  EXPECT_NEAR(model.error, 0, 1e-5) << "two points have a curve through both";
  EXPECT_NEAR(model.correlation, 1, 1e-6);
}

TEST(SizeModel, ConstantBytesAreTheCodecs) {
  const Scene s = make_scene();
  EXPECT_EQ(constant_bytes(s.ladder.planes[0], 32, 48), 4 + 36 / 4.0);  // 4:2:0
  EXPECT_EQ(constant_bytes(s.ladder.planes[1], 32, 48), 4 + 24 / 4.0);  // grey
  LadderOptions options = testing::all_rungs();
  options.subsampling = Subsampling::k444;
  EXPECT_EQ(constant_bytes(make_scene(options).ladder.planes[0], 32, 48), 4 + 72 / 4.0);
  PlaneLadder other = s.ladder.planes[0];
  other.codec = Codec::kWebp;
  EXPECT_EQ(constant_bytes(other, 32, 48), 30);
  other.codec = Codec::kJpegProgressive;
  EXPECT_EQ(constant_bytes(other, 32, 48), 0);
  other = s.ladder.planes[0];
  std::vector<std::uint8_t>& tables = other.rungs[0].table_stream;
  while (!tables.empty()) {  // cut anywhere: some number of blocks, nothing read beyond the end
    tables.pop_back();
    EXPECT_GE(constant_bytes(other, 32, 48), 4);
  }
  EXPECT_EQ(constant_bytes(other, 32, 48), 4 + 24 / 4.0);
}

/// Of quality and ln(bytes - c), over the rungs that the model is fitted on.
double correlation_with(const PlaneTables& t, double constant) {
  double q = 0, s = 0, qq = 0, qs = 0, ss = 0;
  constexpr std::size_t kFirst = 2, kLast = 8;
  const double n = kLast - kFirst + 1;
  for (std::size_t r = kFirst; r <= kLast; ++r) {
    double size = -constant;
    for (std::size_t f = 0; f < t.fragment_count(); ++f) size += t.size_bytes[r * t.fragment_count() + f];
    const double x = t.rung_quality[r], y = std::log(size);
    q += x / n, s += y / n, qq += x * x / n, qs += x * y / n, ss += y * y / n;
  }
  return (qs - q * s) / std::sqrt((qq - q * q) * (ss - s * s));
}

TEST(SizeModel, HoldsForBlurredTextures) {  // whose blocks' shortest codes are most of the bytes
  Scene s = make_scene();
  Random random{5};
  for (Pixels& pixels : s.pixels)
    for (std::uint32_t y = 0; y < pixels.height_px; ++y)
      for (std::uint32_t x = 0; x < pixels.width_px; ++x)
        for (std::uint32_t c = 0; c < pixels.channels; ++c)
          pixels.data[(std::size_t{y} * pixels.width_px + x) * pixels.channels + c] =
              static_cast<std::uint8_t>(100 + (x + y) / 9 + (random.next() % 40 == 0 ? 3 : 0));
  s.ladder = encode_ladder(s.fragments, s.pixels, {}, {}, testing::all_rungs(), {});
  s.previews = make_previews(s.fragments, s.pixels, {}, {});
  const auto [tables, thesis] = build_all(s);
  for (std::size_t p = 0; p < tables.planes.size(); ++p) {
    const PlaneTables& t = tables.planes[p];
    const double constant = constant_bytes(s.ladder.planes[p], 32, 48), count = t.order.size();
    for (const std::uint16_t f : t.order) EXPECT_LT(t.size_bytes[f], 2 * constant) << "the case is this one";
    const float correlation = thesis.planes[p].model.correlation;
    EXPECT_NEAR(correlation, correlation_with(t, constant * count), 1e-5);
    EXPECT_GT(correlation, correlation_with(t, 4 * count) + 0.03) << "SOI and EOI alone";
  }
}

}  // namespace
}  // namespace texmesh
