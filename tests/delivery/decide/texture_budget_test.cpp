#include "delivery/cpp/decide/texture_budget.h"

#include <gtest/gtest.h>

#include "format/container/layout.h"
#include "tests/support/packages.h"

namespace texmesh::texture_budget_test {

PictureLosses losses(std::vector<float> flip) { return {flip, flip, flip}; }

/// Colours and normals of equal texels and bytes. Normals show `normal_part` as much as colours do.
PackageReader open_pair(float normal_part, float exponent = 1) {
  testing::PackageParts parts = testing::make_package_parts();
  PlaneTables& t = parts.tables.planes[0];
  t.skip_dssim = {0.5f, 0.5f, 0.5f, 0};
  const std::size_t fragments = t.fragment_count();
  for (std::size_t f = 0; f < fragments; ++f) t.dssim[fragments + f] /= 4;  // the upper rung shows more
  parts.tables.planes.push_back(t);
  parts.textures.push_back(parts.textures[0]);
  parts.textures[1].image = parts.textures[1].base = 1;
  parts.textures[1].role = "normal";
  parts.textures[1].colour_space = "linear";
  for (const auto& [from, to] :
       {std::pair{preview_path(0), preview_path(1)}, std::pair{table_streams_path(0), table_streams_path(1)},
        std::pair{rung_path(0, 0), rung_path(1, 0)}, std::pair{rung_path(0, 1), rung_path(1, 1)}})
    parts.streams[to] = parts.streams[from];
  parts.manifest.plane_count = 2;
  parts.quality.exponent = exponent;
  parts.quality.sizes_px = {1000};
  const TextureLosses colour{{0.0625f, 0.5f}, losses({0.05f, 0.4f}), losses({0.4f}), losses({0}), {}};
  const TextureLosses normal{{0.0625f, 0.5f},
                             losses({0.05f * normal_part, 0.4f * normal_part}),
                             losses({0.4f * normal_part}),
                             losses({0}),
                             {}};
  parts.quality.groups = {{PlaneGroup::kColour, {colour}}, {PlaneGroup::kNormal, {normal}}};
  return PackageReader(open_container(memory_source(parts.build())));
}

/// Bytes that each group gets of a budget.
PerGroup bytes_by_group(const TextureBudget& budget) {
  PerGroup bytes{};
  for (std::size_t i = 0; i < budget.rungs.size(); ++i)
    if (budget.rungs[i] >= 0)
      bytes[static_cast<std::size_t>(budget.list.groups[i])] +=
          budget.list.offers[i].bytes[static_cast<std::size_t>(budget.rungs[i])];
  return bytes;
}

TextureBudget budget_of(PackageReader& package, const ListOptions& options, std::uint64_t bytes) {
  TextureLoss loss(package, options.displayed_px);
  return texture_for_budget(loss, options, bytes);
}

std::uint64_t half_of_all(PackageReader& package) { return budget_of(package, {}, 1 << 20).bytes / 2; }

TEST(TextureBudget, BytesGoToWhatShows) {
  for (const float exponent : {1.0f, 2.0f}) {
    PackageReader unseen = open_pair(0.05f, exponent);
    const PerGroup colours = bytes_by_group(budget_of(unseen, {}, half_of_all(unseen)));
    EXPECT_GT(colours[0], 2 * colours[1]) << exponent;
    PackageReader loud = open_pair(2, exponent);
    const PerGroup normals = bytes_by_group(budget_of(loud, {}, half_of_all(loud) / 2));
    EXPECT_GT(normals[1], normals[0]) << exponent;
  }
}

TEST(TextureBudget, MoreBytesNeverLookWorse) {
  for (const float exponent : {1.0f, 2.0f}) {
    PackageReader package = open_pair(0.5f, exponent);
    double before = 1;
    for (const std::uint64_t bytes : {0u, 200u, 500u, 1000u, 2000u, 4000u, 1u << 20}) {
      const TextureBudget budget = budget_of(package, {}, bytes);
      EXPECT_LE(budget.bytes, bytes);
      EXPECT_LE(budget.flip, before + 1e-12) << bytes;
      before = budget.flip;
    }
    EXPECT_GT(before, 0) << "the best rung loses something";
  }
}

TEST(TextureBudget, AnExponentWeighsGroupsByTheirSlopes) {
  PackageReader package = open_pair(0.25f, 2);
  const TextureBudget budget = budget_of(package, {}, half_of_all(package));
  const PerGroup& w = budget.list.group_weights;
  EXPECT_LE(w[1], w[0]) << "a small part adds little to a sum of squares";
  ListOptions alike;
  const TextureBudget sum = [&] {
    PackageReader linear = open_pair(0.25f, 1);
    return budget_of(linear, alike, half_of_all(linear));
  }();
  EXPECT_EQ(sum.list.group_weights, (PerGroup{1, 1, 1}));
  EXPECT_LE(budget.flip, picture_flip(package.quality(), alike.displayed_px, 0, sum.losses) + 1e-12)
      << "never worse than bytes spent by the plain sum";
}

TEST(TextureBudget, PictureAddsTheScale) {
  PackageReader package = open_pair(0.5f, 2);
  ListOptions coarse;
  coarse.scale = 5;
  const TextureBudget budget = budget_of(package, coarse, 1 << 20);
  const QualityTable& table = package.quality();
  const double texture = texture_flip(table, budget.losses), scale = geometry_flip(table, 1000, 5);
  EXPECT_NEAR(budget.flip * budget.flip, texture * texture + scale * scale, 1e-12);
}

}  // namespace texmesh::texture_budget_test
