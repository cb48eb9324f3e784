// The parts of the search behind extract --bytes: qualities for a number of bytes, codings of a mesh.
#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/about/gltf_about.h"
#include "stages/condition/condition.h"
#include "stages/geometry/scale_frames.h"
#include "stages/scales/scales.h"
#include "tests/support/meshes.h"
#include "tests/support/packages.h"
#include "tools/extract/budget/filling.h"
#include "tools/extract/glb/standalone_glb.h"

namespace texmesh::budget_search_test {

const std::string kGolden = std::string(TEXMESH_SOURCE_DIR) + "/tests/golden/v2.0-scan.texmesh";

TEST(QualityFor, ComesNearFromBelowInFewTries) {
  for (const double wanted : {900.0, 3000.0, 20000.0, 60000.0})
    for (const double start : {1.0, 50.0, 100.0}) {
      int tries = 0;
      const auto bytes = [&](double q) {
        ++tries;
        return static_cast<std::uint64_t>(500 * std::exp(q / 20) + 40 * q);
      };
      const double q = quality_for(wanted, start, 0.97, 12, bytes);
      EXPECT_LE(tries, 12);
      const auto found = static_cast<double>(bytes(q));
      EXPECT_LE(found, wanted);
      EXPECT_GE(found, 0.97 * wanted) << wanted << " from " << start;
    }
}

TEST(QualityFor, LearnsHowBytesGrowAndThatThereIsNoFileNearer) {
  const auto tries = [](double wanted, double start, bool learns, const auto& bytes) {
    int count = 0;
    const auto counted = [&](double q) { return ++count, static_cast<std::uint64_t>(bytes(q)); };
    const double q = quality_for(wanted, start, 0.99, 10, counted, learns);
    EXPECT_LE(bytes(q), wanted);
    EXPECT_GE(bytes(q), 0.98 * wanted);
    return count;
  };
  const auto steep = [](double q) { return 1000 * std::exp(q / 60); };
  EXPECT_LE(tries(4000, 20, true, steep), 3);
  EXPECT_GT(tries(4000, 20, false, steep), 3);
  const auto whole = [](double q) { return 1000 * std::exp(std::floor(q) / 36); };
  const double between = 1.015 * whole(50);
  EXPECT_EQ(tries(between, 47, true, whole), 3);
  EXPECT_GT(tries(between, 47, false, whole), 8);
}

TEST(QualityFor, EndsAtTheEndsOfTheScale) {
  EXPECT_EQ(quality_for(10, 50, 0.97, 12, [](double q) { return 1000 + static_cast<std::uint64_t>(q); }), 1);
  EXPECT_EQ(quality_for(1e9, 50, 0.97, 12, [](double q) { return 1000 + static_cast<std::uint64_t>(q); }),
            100);
  EXPECT_EQ(quality_for(-5, 50, 0.97, 12, [](double) { return std::uint64_t{0}; }), 1);
}

/// S_0 as compile writes it: Draco on a grid of 14 bits.
Bytes stored_scale() {
  NestedScales scales;
  scales.mesh = condition_mesh(testing::bumpy_sphere(24, 36), false, {}, {}).mesh;
  NestedScale& all = scales.scales.emplace_back();
  all.triangles = scales.mesh.triangles;
  for (std::uint32_t t = 0; t < all.triangles.size(); ++t) all.triangle_source.push_back(t);
  return write_scales(scales, {}, {Material{}}, {}, {}, {}, {.stream = false}, {}).files.at(0).glb;
}

Mesh recoded(const Bytes& glb, const DracoSteps& steps, const NormalSamples* lit_as, std::size_t& bytes) {
  StandaloneGlb file(glb, "s00.glb");
  file.set_draco_streams(DracoRecoder(file.draco_streams(), lit_as, "s00.glb").coded(steps, {}));
  bytes = file.finish().size();
  return read_model(file, "s00.glb", {}).mesh;
}

double farthest(const Mesh& mesh, const Mesh& from) {
  double out = 0;
  for (const Vec3f p : mesh.positions) {
    double nearest = 1e9;
    for (const Vec3f q : from.positions) nearest = std::min<double>(nearest, length(p - q));
    out = std::max(out, nearest);
  }
  return out;
}

TEST(Place, ANodeHoldsTheWholeSceneAtADouble) {
  const Bytes glb = stored_scale();
  const Mesh stored = read_model({glb, "s00.glb"}, "s00.glb", {}).mesh;
  const Vec3d to{4.5e6 + 1.0 / 3, -0.1, 16.9};
  StandaloneGlb file(glb, "s00.glb");
  file.place({to});
  const Mesh moved = read_model(file, "s00.glb", {}).mesh;
  ASSERT_EQ(moved.positions.size(), stored.positions.size());
  EXPECT_EQ(moved.part_names, stored.part_names);
  for (std::size_t i = 0; i < stored.positions.size(); ++i)
    EXPECT_LT(length(to_double(moved.positions[i]) + moved.origin - to_double(stored.positions[i]) - to),
              1e-6);
  StandaloneGlb unmoved(glb, "s00.glb");
  const Bytes before = unmoved.finish();
  unmoved.place({});
  EXPECT_EQ(unmoved.finish(), before);
}

TEST(Words, AllThatTheBytesHoldAreThereAndTheAnswerIsTrue) {
  About about;
  about.title = "Bust";
  about.creator = "A. Smith";
  about.description = std::string(90, 'd');
  about.source = R"({"asset":{"extras":{"credit":")" + std::string(300, 'c') + R"("}}})";
  StandaloneGlb without(stored_scale(), "s00.glb");
  without.set_about(about_within(about, 1));
  const Bytes least = without.finish();
  Bytes all = least;
  ASSERT_TRUE(add_words(all, about, least.size() + 100000));
  EXPECT_FALSE(add_words(all, about, least.size())) << "nothing is taken away";
  for (std::uint64_t bytes = least.size() - 9; bytes < all.size() + 9; bytes += 7) {
    Bytes file = least;
    const bool told = add_words(file, about, bytes);
    EXPECT_LE(file.size(), std::max<std::uint64_t>(bytes, least.size()));
    EXPECT_EQ(told, bytes >= all.size());
    EXPECT_EQ(told, file == all);
    const std::string text(file.begin(), file.end());
    EXPECT_NE(text.find("A. Smith"), std::string::npos);
    EXPECT_EQ(told, text.find("credit") != std::string::npos);
    Findings findings;
    check_glb(file, "file", findings, GlbRules::kStandalone);
    EXPECT_TRUE(findings.list().empty());
  }
}

TEST(Recode, LeanerStepsAreSmallerAndKeepTheirBound) {
  const Bytes glb = stored_scale();
  const Mesh stored = read_model({glb, "s00.glb"}, "s00.glb", {}).mesh;
  std::size_t before = glb.size();
  for (const int bits : {13, 12, 10, 8}) {
    const double step = 2.0 / (1 << bits);
    std::size_t bytes = 0;
    const Mesh mesh = recoded(glb, {step, 1.0 / (1 << bits), 8, 8}, nullptr, bytes);
    EXPECT_LT(bytes, before) << bits;
    EXPECT_EQ(mesh.triangles.size(), stored.triangles.size());
    EXPECT_LE(farthest(mesh, stored), 0.9 * step) << bits;  // half a cell's diagonal
    before = bytes;
  }
}

TEST(Recode, NormalsAreFittedToTheLightAskedFor) {
  const Bytes glb = stored_scale();
  const Mesh stored = read_model({glb, "s00.glb"}, "s00.glb", {}).mesh;
  NormalSamples up = normal_samples(stored);
  for (Vec3f& n : up.normals) n = normalized(n + Vec3f{0, 0.5f, 0});
  std::size_t bytes = 0;
  const Mesh same = recoded(glb, {2e-4, 2e-4, 10, 8}, nullptr, bytes),
             lit = recoded(glb, {2e-4, 2e-4, 10, 8}, &up, bytes);
  const auto height = [](const Mesh& m) {
    double sum = 0;
    for (const Vec3f n : m.normals) sum += n.y;
    return sum / static_cast<double>(m.normals.size());
  };
  EXPECT_GT(height(lit), height(same) + 0.2);
}

TEST(SideOf, LargeSidesCanBeHalvedSeveralTimes) {
  for (const std::uint32_t full : {100u, 678u, 2048u, 4096u})
    for (double share = 1; share > 0.001; share *= 0.97) {
      const std::uint32_t side = side_of(full, share);
      EXPECT_GE(side, 4u);
      EXPECT_LE(side, full);
      EXPECT_TRUE(side < 128 || side == full || side % 16 == 0) << full << " " << share << " " << side;
      EXPECT_NEAR(side, full * share, share * full >= 120 ? 8.5 : 4) << full << " " << share;
    }
  EXPECT_EQ(side_of(3, 0.5), 3u);
}

TEST(Candidates, ForgottenOnesAreMadeAgainAlike) {
  PackageReader package(open_store(kGolden));
  ExtractBudget wishes;
  wishes.display_px = 64;  // small pictures, quick tests
  TextureSource textures(package, 1e6, {});
  const Reference reference(package, wishes, {}, textures, {});
  Candidates candidates(reference, textures);
  const Filling filling(reference, candidates, 20000);
  const std::uint64_t bytes = filling.mesh_file(candidates.mesh({1, 1})).fixed_bytes;
  const double geometry = candidates.mesh({1, 1}).geometry;
  candidates.forget({1, 1});
  EXPECT_EQ(filling.mesh_file(candidates.mesh({1, 1})).fixed_bytes, bytes);
  EXPECT_EQ(candidates.mesh({1, 1}).geometry, geometry);
}

double lighting_error(const Mesh& coarse, const std::vector<Vec3f>& normals) {
  double sum = 0;
  for (const Triangle& t : coarse.triangles) {
    const auto p = [&](std::size_t k) { return to_double(coarse.positions[coarse.wedge_position[t[k]]]); };
    const Vec3d middle = normalized(p(0) + p(1) + p(2));
    const Vec3d n =
        normalized(to_double(normals[t[0]]) + to_double(normals[t[1]]) + to_double(normals[t[2]]));
    sum += length(n - middle);
  }
  return sum / static_cast<double>(coarse.triangles.size());
}

TEST(FitNormals, TakeTheLightOfTheFinerMeshInsteadOfThatOfTheirPoints) {
  Mesh fine = testing::bumpy_sphere(60, 90), coarse = testing::bumpy_sphere(10, 14);
  const auto round = [](Mesh& mesh) {
    for (Vec3f& p : mesh.positions) p = normalized(p);
    mesh.normals.clear();
    for (const std::uint32_t p : mesh.wedge_position) mesh.normals.push_back(mesh.positions[p]);
  };
  round(fine);
  round(coarse);
  const std::vector<Vec3f> exact = coarse.normals;
  // A surface with grain: every vertex that a coarse mesh keeps has a normal of its own.
  testing::Random random{5};
  for (Vec3f& n : coarse.normals) {
    const auto grain = [&] { return static_cast<float>(0.6 * (random.uniform() - 0.5)); };
    n = normalized(n + Vec3f{grain(), grain(), grain()});
  }
  std::vector<Vec3d> points;
  for (const std::uint32_t p : coarse.wedge_position) points.push_back(to_double(coarse.positions[p]));
  const NormalSamples samples = normal_samples(fine);
  RunContext one, eight;
  one.threads = 1;
  eight.threads = 8;
  const std::vector<Vec3f> fitted = fit_normals(points, coarse.triangles, coarse.normals, samples, one);
  EXPECT_EQ(fitted, fit_normals(points, coarse.triangles, coarse.normals, samples, eight));
  for (const Vec3f n : fitted) EXPECT_NEAR(length(n), 1, 1e-5);
  EXPECT_LT(lighting_error(coarse, fitted), 0.35 * lighting_error(coarse, coarse.normals));
  EXPECT_EQ(fit_normals(points, coarse.triangles, coarse.normals, {}, one), coarse.normals);
}

TEST(FitNormals, SamplesOfTheOtherSideDoNotCount) {
  const std::vector<Vec3d> points{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const std::vector<Triangle> triangles{{0, 1, 2}};
  const std::vector<Vec3f> up(3, {0, 0, 1});
  NormalSamples samples{{{0.2, 0.2, -0.01}}, {{0, 0, -1}}, {1}};
  EXPECT_EQ(fit_normals(points, triangles, up, samples, {}), up);
  samples.normals[0] = {0, 0.6f, 0.8f};
  EXPECT_GT(fit_normals(points, triangles, up, samples, {})[0].y, 0.3f);
}

}  // namespace texmesh::budget_search_test
