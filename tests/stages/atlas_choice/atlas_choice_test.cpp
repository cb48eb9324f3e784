#include "stages/atlas_choice/atlas_choice.h"

#include <gtest/gtest.h>

#include "stages/atlas/atlas.h"
#include "stages/base/run_context.h"
#include "stages/condition/condition.h"
#include "stages/simplification/simplification.h"
#include "tests/stages/atlas/atlas_fixtures.h"

namespace texmesh::atlas_choice_test {

using testing::data_material, testing::in_charts, testing::places;

NestedScales scales_of(const ConditionedMesh& mesh, CollapseOrder order) {
  ScaleMap map;
  map.scales = 12;
  testing::Random random{1};
  for (std::size_t p = 0; p < mesh.mesh.positions.size(); ++p)
    map.persistence.push_back(static_cast<std::uint8_t>(random.next() % 13));
  SimplificationOptions options;
  options.order = order;
  return simplify(mesh, map, options, RunContext{});
}

struct Samples {
  AtlasSample kept, rebuilt;
};
Samples samples_of(const Mesh& mesh, const std::vector<Material>& materials, const std::vector<Image>& images,
                   int threads = 1) {
  RunContext context;
  context.threads = threads;
  const ConditionedMesh source = condition_mesh(mesh, false, {}, context);
  const NestedScales own = scales_of(source, CollapseOrder::kTexmesh);
  Samples out;
  out.kept = sample_atlas(source, materials, images, own, materials, images, context);
  AtlasOptions options;
  options.mode = AtlasMode::kRebuild;
  const ChartedModel made = chart_model(source, materials, images, options, context);
  out.rebuilt = sample_atlas(source, materials, images, scales_of(made.mesh, CollapseOrder::kTouching),
                             made.materials, made.images, context);
  return out;
}

AtlasSample sample(std::vector<double> flip, std::uint64_t charts = 30) {
  std::vector<double> none(flip.size(), 1);
  return {"", charts, std::move(flip), std::move(none)};
}

TEST(AtlasChoice, TakesNewChartsWhereTheyLookBetter) {
  const AtlasSample kept = sample({0.08, 0.06, 0.04, 0.02}, 1000);
  EXPECT_TRUE(choose_atlas(kept, sample({0.07, 0.05, 0.03, 0.02})).rebuild);
  EXPECT_FALSE(choose_atlas(kept, sample({0.07, 0.05, 0.03, 0.02}, 1000)).rebuild) << "as many charts";
  EXPECT_FALSE(choose_atlas(kept, sample(kept.flip)).rebuild);
  EXPECT_FALSE(choose_atlas(kept, sample({0.079, 0.059, 0.04, 0.02})).rebuild) << "not worth the files";
  EXPECT_FALSE(choose_atlas(kept, sample({0.08, 0.06, 0.04, 0.04})).rebuild);
}

/// Proxies stand for both where they look better than either chain.
TEST(AtlasChoice, KeepsWhatProxiesShowAsWell) {
  const AtlasSample kept = sample({0.2, 0.15, 0.06, 0.02}, 1000), rebuilt = sample({0.1, 0.08, 0.06, 0.022});
  EXPECT_TRUE(choose_atlas(kept, rebuilt).rebuild);
  Proxies proxies;
  for (const auto& [bytes, flip] : {std::pair{36'000, 0.16}, {150'000, 0.09}, {250'000, 0.07}}) {
    Proxy& p = proxies.proxies.emplace_back();
    p.glb.resize(static_cast<std::size_t>(bytes));
    p.losses = {{512, flip, 0}};
  }
  const AtlasSample shown = with_proxies(kept, proxies);
  EXPECT_EQ(shown.proxy_flip, (std::vector<double>{0.09, 0.07, 0.07, 0.07}));
  EXPECT_FALSE(choose_atlas(shown, rebuilt).rebuild);
}

TEST(AtlasChoice, SaysWhy) {
  const AtlasSample kept = sample({0.08, 0.06, 0.04, 0.02}, 1000);
  const std::string why = choose_atlas(kept, sample({0.04, 0.03, 0.02, 0.01})).why;
  EXPECT_NE(why.find("30 charts for 1000"), std::string::npos) << why;
  EXPECT_NE(why.find(".50"), std::string::npos) << why;
}

TEST(AtlasChoice, FewChartsAndNoTexturesAreGoodWithoutPictures) {
  const Mesh mesh = testing::bumpy_sphere(20, 30);
  const Samples few = samples_of(mesh, {data_material(0)}, {places(64)});
  EXPECT_NE(few.kept.good.find("charts"), std::string::npos) << few.kept.good;
  EXPECT_TRUE(few.kept.flip.empty());
  EXPECT_FALSE(choose_atlas(few.kept, few.kept).rebuild);
  EXPECT_NE(samples_of(mesh, {Material{}}, {}).kept.good, "");
}

TEST(AtlasChoice, ManyChartsAreLookedAtAlikeWithAnyThreadCount) {
  const Mesh mesh = in_charts(testing::pole(), 600);
  const Samples one = samples_of(mesh, {data_material(0)}, {places(64)}),
                many = samples_of(mesh, {data_material(0)}, {places(64)}, 3);
  EXPECT_EQ(one.kept.flip, many.kept.flip);
  EXPECT_EQ(one.rebuilt.flip, many.rebuilt.flip);
  EXPECT_LT(one.rebuilt.charts, 50u);
  for (const AtlasSample& s : {one.kept, one.rebuilt}) {
    EXPECT_EQ(s.good, "");
    EXPECT_TRUE(std::ranges::is_sorted(s.flip, std::greater())) << "more bytes show no less";
    EXPECT_LT(s.flip.front(), 0.3);
    EXPECT_GT(s.flip.back(), 0);
  }
}

TEST(AtlasChoice, StrangeModelsAreChosenFor) {
  std::uint32_t side_px = 1;
  for (const Mesh& mesh : testing::strange_models()) {
    const Samples s = samples_of(mesh, {data_material(0)}, {places(side_px)});
    EXPECT_NO_THROW(choose_atlas(s.kept, s.rebuilt));
    side_px = side_px == 1 ? 33 : 1;
  }
}

}  // namespace texmesh::atlas_choice_test
