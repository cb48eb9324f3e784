#include "stages/perceptual_values/perceptual_values.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "format/base/archive.h"
#include "stages/base/run_context.h"
#include "stages/condition/condition.h"
#include "stages/geometry/distance.h"
#include "stages/simplification/simplification.h"
#include "tests/support/meshes.h"

namespace texmesh::perceptual_values_test {

const RunContext kOneThread{};

NestedScales make_scales(const Mesh& mesh, int count = 10, double max_error = 0.05) {
  const ConditionedMesh conditioned = condition_mesh(mesh, false, {}, kOneThread);
  ScaleMap map;
  map.scales = count;
  testing::Random random{5};
  for (std::size_t p = 0; p < conditioned.mesh.positions.size(); ++p) {
    int i = 0;
    while (i < count && random.uniform() < 0.7) ++i;
    map.persistence.push_back(static_cast<std::uint8_t>(i));
  }
  return simplify(conditioned, map, {.max_error = max_error, .min_triangles = 20}, kOneThread);
}

/// Skeleton of a ball: its centre.
Skeleton centre_skeleton(const Mesh& mesh) {
  Skeleton s;
  for (Vec3f p : mesh.positions) {
    s.distance.push_back(length(p));
    s.radius.push_back(std::max(length(p), 0.25f));
  }
  return s;
}

TEST(PerceptualValues, TableHoldsDistancesOverTheRadius) {
  const NestedScales scales = make_scales(testing::bumpy_sphere(32, 48));
  const Skeleton skeleton = centre_skeleton(scales.mesh);
  const PerceptualValues values = measure_perceptual_values(scales, skeleton, {}, kOneThread);
  const std::size_t n = scales.scales.size();
  ASSERT_GE(n, 6u);
  ASSERT_EQ(values.p95.size(), n * n);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) {
      const float a = values.p95[i * n + j], b = values.p99[i * n + j];
      if (j <= i) {
        EXPECT_EQ(a, 0);
        EXPECT_EQ(b, 0);
        continue;
      }
      EXPECT_GT(a, 0);
      EXPECT_GE(b, a);
      // The radius is 1 within a tenth, so the relative distance is about the distance.
      EXPECT_LE(a, scales.scales[j].error_max * 1.2f + scales.scales[i].error_max * 1.2f);
    }
  for (std::size_t j = 2; j < n; ++j) EXPECT_GT(values.p95[j], 0.8f * values.p95[j - 1]);
  EXPECT_GT(values.p95[n - 1], 0.25f * scales.scales[n - 1].error_rms);
}

TEST(PerceptualValues, StatisticsFollowChainsToTheSurvivor) {
  NestedScales scales = make_scales(testing::sheet(3));
  scales.collapses = {{1, 2, 0}, {2, 3, 0}, {5, 6, 0}};  // 1 -> 2 -> 3 in one step, 5 -> 6 in the next
  scales.scales.resize(1);
  scales.scales.push_back(scales.scales[0]);
  scales.scales.push_back(scales.scales[0]);
  scales.scales[1].scale = 1, scales.scales[1].collapse_count = 2;
  scales.scales[2].scale = 2, scales.scales[2].collapse_count = 3;
  Skeleton skeleton;
  skeleton.distance.assign(16, 1), skeleton.radius.assign(16, 1);
  skeleton.distance[1] = 0.5f, skeleton.distance[2] = 1.5f, skeleton.distance[3] = 2, skeleton.radius[3] = 2;
  skeleton.distance[5] = 0.01f, skeleton.distance[6] = 0.02f, skeleton.radius[6] = 0.5f;  // floored
  const PerceptualValues values = measure_perceptual_values(scales, skeleton, {}, kOneThread);
  EXPECT_EQ(values.step[0].collapses, 0u);
  EXPECT_EQ(values.step[1].collapses, 2u);
  EXPECT_FLOAT_EQ(values.step[1].max, 0.75f);  // vertex 1 against 3, not against 2
  EXPECT_FLOAT_EQ(values.step[1].min, 0.25f);
  EXPECT_FLOAT_EQ(values.step[1].mean, 0.5f);
  EXPECT_FLOAT_EQ(values.step[1].sum, 1.0f);
  EXPECT_FLOAT_EQ(values.step[1].deviation, 0.25f);
  EXPECT_FLOAT_EQ(values.step[1].rss, std::sqrt(0.625f));
  EXPECT_FLOAT_EQ(values.step[2].mean, 0.02f);
}

TEST(PerceptualValues, MajorsAreTheLastOfTheirTier) {
  const NestedScales scales = make_scales(testing::bumpy_sphere(32, 48, 0.15f), 12);
  const Skeleton skeleton = centre_skeleton(scales.mesh);
  const std::size_t n = scales.scales.size();
  for (double jnd : {0.005, 0.02, 0.1, 1.0}) {
    const PerceptualValues values = measure_perceptual_values(scales, skeleton, {.jnd = jnd}, kOneThread);
    const std::vector<float>& table = values.p95;
    EXPECT_EQ(values.major[0], 0);
    EXPECT_EQ(values.major[n - 1], 1);
    std::size_t from = 0;
    for (std::size_t k = 1; k < n; ++k) {
      if (k > from + 1 || values.major[k] == 0) {
        EXPECT_LT(table[from * n + k], jnd) << k;  // only the first after a major may reach the JND
      }
      if (!values.major[k]) continue;
      if (k + 1 < n && table[from * n + k] < jnd) {
        EXPECT_GE(table[from * n + k + 1], jnd) << k;
      }
      from = k;
    }
  }
  // Everything is under a JND of 1: one tier. Almost nothing is under one of 0.5 %: several.
  auto majors = [&](double jnd) {
    const PerceptualValues v = measure_perceptual_values(scales, skeleton, {.jnd = jnd}, kOneThread);
    return std::count(v.major.begin(), v.major.end(), 1);
  };
  EXPECT_EQ(majors(1.0), 1);
  EXPECT_GE(majors(0.005), 3);
}

TEST(PerceptualValues, TableOfTheNutcrackerMakesS4Major) {
  // Table 7.1: averages of two collapses each, one a half over the average and one a half under it.
  const float average[]{0.0410f, 0.0412f, 0.0478f, 0.0468f, 0.0678f};
  NestedScales scales;
  scales.mesh = testing::sphere(8, 12);
  Skeleton skeleton = centre_skeleton(scales.mesh);
  skeleton.distance.assign(scales.mesh.positions.size(), 1);
  skeleton.radius = skeleton.distance;
  NestedScale scale;
  scale.triangles = scales.mesh.triangles;
  scale.triangle_source.resize(scale.triangles.size());
  std::iota(scale.triangle_source.begin(), scale.triangle_source.end(), 0u);
  scale.position_count = static_cast<std::uint32_t>(scales.mesh.positions.size());
  scales.scales.push_back(scale);
  for (std::uint32_t k = 0; k < 5; ++k) {
    for (const float part : {0.5f, 1.5f}) {
      const auto from = static_cast<std::uint32_t>(scales.collapses.size());
      scales.collapses.push_back({from, 40, 0});
      skeleton.distance[from] = 1 + part * average[k];
    }
    scale.scale = static_cast<int>(k) + 1;
    scale.collapse_count = static_cast<std::uint32_t>(scales.collapses.size());
    scales.scales.push_back(scale);
  }
  const auto majors = [&](PerceptualStatistic statistic) {
    return measure_perceptual_values(scales, skeleton, {.jnd = 0.10, .statistic = statistic}, kOneThread)
        .major;
  };
  // Table 7.2: the change from S_0 to S_4 is below 0.10, that to S_5 is not. The thesis names S_4
  // (Fig. 7.13).
  EXPECT_EQ(majors(PerceptualStatistic::kAverage), (std::vector<std::uint8_t>{0, 0, 0, 0, 1, 1}));
  // By the largest changes S_3 is too far from S_0, by the least ones nothing is.
  EXPECT_EQ(majors(PerceptualStatistic::kConservative), (std::vector<std::uint8_t>{0, 0, 1, 1, 1, 1}));
  EXPECT_EQ(majors(PerceptualStatistic::kAggressive), (std::vector<std::uint8_t>{0, 0, 0, 0, 0, 1}));
}

TEST(PerceptualValues, KeepsAboutAsManyScalesAsAsked) {
  const NestedScales scales = make_scales(testing::bumpy_sphere(48, 64), 20);
  const Skeleton skeleton = centre_skeleton(scales.mesh);
  for (int asked : {1, 4, 8}) {
    const PerceptualValues values =
        measure_perceptual_values(scales, skeleton, {.jnd = 1, .kept_scales = asked}, kOneThread);
    EXPECT_EQ(values.kept.front(), 1);
    EXPECT_EQ(values.kept.back(), 1);
    const auto count = std::count(values.kept.begin(), values.kept.end(), 1);
    EXPECT_LE(count, asked + 2);
    EXPECT_GE(count, std::min(asked, 5));
    if (asked < 8) continue;
    std::size_t last = 0;
    for (std::size_t k = 1; k < values.kept.size(); ++k) {
      if (!values.kept[k]) continue;
      EXPECT_LT(static_cast<double>(scales.scales[last].triangles.size()) /
                    static_cast<double>(scales.scales[k].triangles.size()),
                3.2);
      last = k;
    }
  }
}

TEST(PerceptualValues, DisplayedHeights) {
  const NestedScales scales = make_scales(testing::bumpy_sphere(32, 48));
  const PerceptualValues values =
      measure_perceptual_values(scales, centre_skeleton(scales.mesh), {.jnd = 0.08}, kOneThread);
  const std::size_t n = scales.scales.size();
  EXPECT_NEAR(values.object_height, 2.1, 0.15);
  EXPECT_EQ(values.display_px_error[0], kAnyHeightPx);
  EXPECT_EQ(values.display_px_jnd[0], kAnyHeightPx);
  for (std::size_t k = 1; k < n; ++k) {
    EXPECT_LE(values.display_px_error[k], values.display_px_error[k - 1]);
    EXPECT_LE(values.display_px_jnd[k], values.display_px_jnd[k - 1]);
    EXPECT_LE(values.display_px_edge[k], values.display_px_edge[k - 1]);
    EXPECT_LE(values.display_px_jnd[k], 512 * 0.08f / values.p95[k] * 1.001f);
    // One pixel is object_height / px; the p95 error lies between a third of the rms and the largest error.
    const float pixel = values.object_height / values.display_px_error[k];
    EXPECT_LE(pixel, scales.scales[k].error_max * 1.1f);
    EXPECT_GE(pixel, scales.scales[k].error_rms * 0.3f);
  }
  const PerceptualValues shortest =
      measure_perceptual_values(scales, centre_skeleton(scales.mesh), {.edge_percentile = 0}, kOneThread);
  EXPECT_GE(shortest.display_px_edge[0], values.display_px_edge[0]);
}

TEST(PerceptualValues, OneScaleOnly) {
  const NestedScales scales = make_scales(testing::cube());
  ASSERT_EQ(scales.scales.size(), 1u);
  const PerceptualValues values =
      measure_perceptual_values(scales, centre_skeleton(scales.mesh), {}, kOneThread);
  EXPECT_EQ(values.kept, std::vector<std::uint8_t>{1});
  EXPECT_EQ(values.major, std::vector<std::uint8_t>{0});
  EXPECT_EQ(values.display_px_error, std::vector<float>{kAnyHeightPx});
  EXPECT_FLOAT_EQ(values.display_px_edge[0], 1);  // height 2, edges 2 and longer
}

TEST(PerceptualValues, SameBytesForAnyNumberOfThreads) {
  const NestedScales scales = make_scales(testing::bumpy_sphere(24, 36));
  const Skeleton skeleton = centre_skeleton(scales.mesh);
  RunContext eight;
  eight.threads = 8;
  EXPECT_EQ(encode_artefact(measure_perceptual_values(scales, skeleton, {}, kOneThread)),
            encode_artefact(measure_perceptual_values(scales, skeleton, {}, eight)));
}

TEST(PerceptualValues, RefusesASkeletonOfAnotherMesh) {
  const NestedScales scales = make_scales(testing::cube());
  EXPECT_THROW(measure_perceptual_values(scales, Skeleton{}, {}, kOneThread), StageError);
}

TEST(PerceptualValues, CumulativeTableIsTheRootOfTheSumOfSquares) {
  // The thesis's Table 7.1 (averages) and 7.2: 0.0410 0.0616 0.0677 0.0759 0.1080.
  std::vector<CollapseStatistics> step(6);
  const float average[6]{0, 0.0410f, 0.0412f, 0.0478f, 0.0468f, 0.0678f};
  for (std::size_t k = 1; k < 6; ++k)
    step[k].mean = average[k], step[k].max = 2 * average[k], step[k].min = average[k] / 2;
  const std::vector<float> table = cumulative_table(step, PerceptualStatistic::kAverage);
  const float printed[6]{0, 0.0410f, 0.0616f, 0.0677f, 0.0759f, 0.1080f};
  for (std::size_t j = 1; j < 6; ++j) EXPECT_NEAR(table[j] / printed[j], 1, 0.18) << j;
  EXPECT_FLOAT_EQ(table[2 * 6 + 3], 0.0478f);
  EXPECT_EQ(table[3 * 6 + 2], 0);
  const std::vector<float> most = cumulative_table(step, PerceptualStatistic::kConservative),
                           least = cumulative_table(step, PerceptualStatistic::kAggressive);
  for (std::size_t k = 0; k < 36; ++k) {
    EXPECT_FLOAT_EQ(most[k], 2 * table[k]);
    EXPECT_FLOAT_EQ(least[k], table[k] / 2);
  }
  EXPECT_THROW(cumulative_table(step, PerceptualStatistic::kP95), StageError);
}

TEST(PerceptualValues, TheExponentSaysHowTheJndFollowsTheDistance) {
  const NestedScales scales = make_scales(testing::bumpy_sphere(32, 48, 0.15f), 12);
  const Skeleton skeleton = centre_skeleton(scales.mesh);
  const auto measure = [&](double exponent) {
    return measure_perceptual_values(scales, skeleton, {.jnd = 0.05, .jnd_distance_exponent = exponent},
                                     kOneThread);
  };
  const PerceptualValues printed = measure(0), guess = measure(1), root = measure(0.5), tiny = measure(1e-9);
  EXPECT_EQ(printed.major, guess.major);
  std::size_t enough = 0;
  for (std::size_t k = 1; k < scales.scales.size(); ++k) {
    const double value = static_cast<double>(guess.p95[k]);
    if (!(value > 0)) continue;
    EXPECT_EQ(printed.display_px_jnd[k], value < 0.05 ? kAnyHeightPx : 0) << k;
    EXPECT_NEAR(root.display_px_jnd[k] / (512 * (0.05 / value) * (0.05 / value)), 1, 1e-5) << k;
    EXPECT_EQ(tiny.display_px_jnd[k], printed.display_px_jnd[k]) << k;
    enough += value < 0.05;
  }
  EXPECT_GT(enough, 0u);
  EXPECT_LT(enough + 1, scales.scales.size());
}

TEST(PerceptualValues, ChainsCountEveryVertexAgainstTheOneThatIsLeft) {
  const NestedScales scales = make_scales(testing::bumpy_sphere(24, 36, 0.15f), 6);
  const Skeleton skeleton = centre_skeleton(scales.mesh);
  const PerceptualValues values = measure_perceptual_values(scales, skeleton, {}, kOneThread);
  const std::size_t n = scales.scales.size();
  ASSERT_GE(n, 4u);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = i + 1; j < n; ++j) {
      double sum = 0, most = 0, count = 0;
      for (std::size_t c = scales.scales[i].collapse_count; c < scales.scales[j].collapse_count; ++c) {
        std::uint32_t left = scales.collapses[c].to;  // follows the chain link by link
        for (std::size_t d = c + 1; d < scales.scales[j].collapse_count; ++d)
          if (scales.collapses[d].from == left) left = scales.collapses[d].to;
        const double rho = std::fabs(static_cast<double>(skeleton.distance[scales.collapses[c].from]) -
                                     skeleton.distance[left]) /
                           skeleton.radius[left];
        sum += rho, most = std::max(most, rho), ++count;
      }
      EXPECT_NEAR(values.chain_average[i * n + j], sum / count, 1e-6) << i << " " << j;
      EXPECT_FLOAT_EQ(values.chain_largest[i * n + j], static_cast<float>(most));
      EXPECT_LE(values.chain_least[i * n + j], values.chain_average[i * n + j]);
      EXPECT_EQ(values.chain_average[j * n + i], 0);
    }
  for (std::size_t k = 1; k < n; ++k) EXPECT_EQ(values.chain_average[(k - 1) * n + k], values.step[k].mean);
}

TEST(PerceptualValues, StrategiesDecideMajorsAndHeights) {
  const NestedScales scales = make_scales(testing::bumpy_sphere(32, 48, 0.15f), 12);
  const Skeleton skeleton = centre_skeleton(scales.mesh);
  const auto measure = [&](PerceptualStatistic statistic, double reference = kJndReferencePx) {
    return measure_perceptual_values(
        scales, skeleton, {.jnd = 0.05, .jnd_reference_px = reference, .statistic = statistic}, kOneThread);
  };
  const auto majors = [](const PerceptualValues& v) { return std::count(v.major.begin(), v.major.end(), 1); };
  const PerceptualValues careful = measure(PerceptualStatistic::kConservative),
                         average = measure(PerceptualStatistic::kAverage),
                         bold = measure(PerceptualStatistic::kAggressive);
  EXPECT_GE(majors(careful), majors(average));
  EXPECT_GE(majors(average), majors(bold));
  EXPECT_GT(majors(careful), majors(bold));
  const std::vector<float> value = value_table(average, PerceptualStatistic::kAverage);
  for (std::size_t k = 1; k < scales.scales.size(); ++k) {
    EXPECT_LE(careful.display_px_jnd[k], average.display_px_jnd[k]);
    EXPECT_LE(average.display_px_jnd[k], bold.display_px_jnd[k]);
    EXPECT_FLOAT_EQ(average.display_px_jnd[k], std::min<float>(kAnyHeightPx, 512 * 0.05f / value[k]));
    EXPECT_EQ(average.p95[k], bold.p95[k]);  // the table of distances stands beside every strategy
  }
  // Twice the reference height: the same change is just noticeable at twice the displayed height.
  const PerceptualValues larger = measure(PerceptualStatistic::kP95, 1024),
                         usual = measure(PerceptualStatistic::kP95);
  EXPECT_FLOAT_EQ(larger.display_px_jnd.back(), 2 * usual.display_px_jnd.back());
  EXPECT_EQ(larger.major, usual.major);
}

TEST(PerceptualValues, DistancesAgreeWithPlainSearches) {
  const NestedScales scales = make_scales(testing::bumpy_sphere(32, 48, 0.15f), 6);
  Skeleton skeleton = centre_skeleton(scales.mesh);
  skeleton.radius.assign(skeleton.radius.size(), 1.0f);
  const PerceptualValues values = measure_perceptual_values(scales, skeleton, {.samples = 2000}, kOneThread);
  const std::size_t n = scales.scales.size(), samples = scales.scales[0].triangles.size() / 4;
  ASSERT_GT(samples, 250u);
  for (std::size_t j = 1; j < n; ++j) {
    const SurfaceDistance surface(scales.mesh.positions, scales.mesh.wedge_position,
                                  scales.scales[j].triangles);
    std::vector<double> distance;
    for (const SurfaceSample& s : sample_surface(scales.mesh.positions, scales.mesh.wedge_position,
                                                 scales.scales[0].triangles, samples)) {
      Vec3d p;
      for (std::size_t k = 0; k < 3; ++k)
        p = p +
            to_double(scales.mesh
                          .positions[scales.mesh.wedge_position[scales.scales[0].triangles[s.triangle][k]]]) *
                static_cast<double>(s.weight[k]);
      distance.push_back(surface(p));
    }
    std::sort(distance.begin(), distance.end());
    const auto rank = static_cast<std::size_t>(0.95 * static_cast<double>(samples - 1) + 0.5);
    EXPECT_NEAR(values.p95[j], distance[rank], 1e-7) << j;
  }
}

/// 7.2: each removed vertex against the one that is left, where the values of the changes only add up.
TEST(PerceptualValues, TheChainRuleDecidesAboutMajorScales) {
  const NestedScales scales = make_scales(testing::bumpy_sphere(32, 48, 0.15f), 12);
  const Skeleton skeleton = centre_skeleton(scales.mesh);
  PerceptualValuesOptions options{.jnd = 0.05, .statistic = PerceptualStatistic::kAverage};
  options.kept_scales = 0;
  const PerceptualValues root = measure_perceptual_values(scales, skeleton, options, kOneThread);
  options.chain = ChainRule::kSurvivor;
  const PerceptualValues chain = measure_perceptual_values(scales, skeleton, options, kOneThread);
  EXPECT_EQ(value_table(chain, PerceptualStatistic::kAverage, ChainRule::kSurvivor), chain.chain_average);
  EXPECT_EQ(chain.major, major_rows(chain.chain_average, chain.major.size(), options.jnd));
  EXPECT_NE(chain.major, root.major);
  EXPECT_EQ(chain.chain_average, root.chain_average);
  options.statistic = PerceptualStatistic::kP95;
  const PerceptualValues p95 = measure_perceptual_values(scales, skeleton, options, kOneThread);
  EXPECT_EQ(p95.major, major_rows(p95.p95, p95.major.size(), options.jnd)) << "p95 knows no chain";
}

/// 7.6: every size shows a major scale, that of the tier of the scale that O_V / E_S asks for.
TEST(PerceptualValues, TiersMakeTheStepFunctionWhateverTheDistance) {
  const NestedScales scales = make_scales(testing::bumpy_sphere(32, 48, 0.15f), 12);
  const Skeleton skeleton = centre_skeleton(scales.mesh);
  PerceptualValuesOptions options{.jnd = 0.02, .statistic = PerceptualStatistic::kConservative};
  options.steps = StepsBy::kTiers;
  options.kept_scales = 0;
  const PerceptualValues v = measure_perceptual_values(scales, skeleton, options, kOneThread);
  const std::size_t n = v.major.size();
  std::size_t begin = 0, tiers = 0;
  for (std::size_t k = 1; k < n; ++k) {
    EXPECT_EQ(v.kept[k], v.major[k] || k == n - 1) << "minor scales are not stored";
    if (!v.major[k]) continue;
    ++tiers;
    const double edges = std::sqrt(double{v.display_px_edge[begin]} * v.display_px_edge[begin + 1]);
    if (begin > 0) EXPECT_NEAR(v.display_px_jnd[k] / edges, 1, 1e-5) << k;
    for (std::size_t i = begin + 1; i < k; ++i) EXPECT_EQ(v.display_px_jnd[i], v.display_px_jnd[k]) << i;
    EXPECT_LE(v.display_px_jnd[k], v.display_px_jnd[k - 1]);
    begin = k;
  }
  ASSERT_GE(tiers, 2u);
  options.jnd_reference_px = 4096;
  const PerceptualValues far = measure_perceptual_values(scales, skeleton, options, kOneThread);
  EXPECT_EQ(far.display_px_jnd, v.display_px_jnd) << "independent of the distance";
  options.jnd = 1;  // nothing is noticeable: the coarsest scale at any size
  const PerceptualValues blind = measure_perceptual_values(scales, skeleton, options, kOneThread);
  EXPECT_EQ(blind.display_px_jnd.back(), kAnyHeightPx);
}

}  // namespace texmesh::perceptual_values_test
