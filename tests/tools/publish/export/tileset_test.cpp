#include "tools/publish/export/export.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace texmesh::tileset_test {

using Json = nlohmann::json;

Manifest manifest_of_three() {
  Manifest m;
  m.object_height = 2;
  m.scales.resize(3);
  const double errors[] = {0, 0.01, 0.1};
  const int numbers[] = {0, 7, 12};
  for (std::size_t k = 0; k < 3; ++k) m.scales[k].scale = numbers[k], m.scales[k].error_max = errors[k];
  m.steps = {{150, 12}, {600, 7}, {kAnyDisplayPx, 0}};
  return m;
}

/// Textures of 1024 px: from that height on there is nothing finer.
std::vector<std::uint32_t> mips(double px) {
  if (px <= 0 || px > 512) return {0};
  return {px > 256 ? 1u : 2u};
}

TEST(TileLevels, AreWhatADisplayNeedsWhereItIsSomethingElse) {
  const auto levels = tile_levels(manifest_of_three(), 0, mips);
  ASSERT_EQ(levels.size(), 4u);
  EXPECT_EQ(levels[0], (TileLevel{0, kAnyDisplayPx, 0, 0, ""}));
  EXPECT_EQ(levels[1], (TileLevel{7, 512, 512, 0.01, ""}));  // 4096 to 1024 are the finest's
  EXPECT_EQ(levels[2], (TileLevel{7, 256, 256, 0.01, ""}));  // smaller textures
  EXPECT_EQ(levels[3], (TileLevel{12, 128, 128, 0.1, ""}));
}

TEST(TileLevels, EndWithTheCoarsestScaleAlsoWhereNoDisplayWantsIt) {
  Manifest m = manifest_of_three();
  m.steps = {{kAnyDisplayPx, 0}};
  const auto levels = tile_levels(m, 0, [](double) { return std::vector<std::uint32_t>{}; });
  ASSERT_EQ(levels.size(), 2u);
  EXPECT_EQ(levels[0].scale, 0);
  EXPECT_EQ(levels[1].scale, 12);
  EXPECT_LT(levels[1].displayed_px, 2);
}

TEST(TileLevels, NothingIsFinerThanADisplayNeeds) {
  const auto levels = tile_levels(manifest_of_three(), 512, mips);
  ASSERT_EQ(levels.size(), 3u);
  EXPECT_EQ(levels[0], (TileLevel{7, kAnyDisplayPx, 512, 0.01, ""}));
  EXPECT_EQ(levels[1].displayed_px, 256);
  EXPECT_EQ(levels[2].scale, 12);
}

TEST(TileLevels, OneScaleWithoutTexturesIsOneTile) {
  Manifest m = manifest_of_three();
  m.scales.resize(1);
  m.steps = {{kAnyDisplayPx, 0}};
  EXPECT_EQ(tile_levels(m, 0, [](double) { return std::vector<std::uint32_t>{}; }).size(), 1u);
}

Tileset small_tileset() {
  Tileset t;
  t.levels = {{0, kAnyDisplayPx, 0, 0, "level-0.glb"}, {12, 160, 160, 0.05, "level-1.glb"}};
  t.bounds = Box3d{{-1, 0, -3}, {3, 8, 1}};
  t.origin = {10, 20, 30};
  t.object_height = 8;
  t.version = "0123";
  t.about.title = "</script>\"";
  return t;
}

TEST(TilesetJson, IsAChainOfTilesThatReplaceEachOther) {
  const Json j = Json::parse(tileset_text(small_tileset()));
  EXPECT_EQ(j["asset"]["version"], "1.1");
  EXPECT_EQ(j["asset"]["tilesetVersion"], "0123");
  EXPECT_EQ(j["asset"]["extras"]["title"], "</script>\"");
  const Json& root = j["root"];
  EXPECT_EQ(root["content"]["uri"], "level-1.glb");
  EXPECT_EQ(root["refine"], "REPLACE");
  EXPECT_DOUBLE_EQ(root["geometricError"], 16.0 / 160 * 8);  // 16 px where the object is 160 px high
  EXPECT_GE(j["geometricError"], root["geometricError"]);
  ASSERT_EQ(root["children"].size(), 1u);
  const Json& leaf = root["children"][0];
  EXPECT_EQ(leaf["content"]["uri"], "level-0.glb");
  EXPECT_EQ(leaf["geometricError"], 0);
  EXPECT_FALSE(leaf.contains("children"));
  EXPECT_FALSE(leaf.contains("transform"));  // the root's moves it already
}

TEST(TilesetJson, HasZUpWhereGltfHasYUp) {
  const Json root = Json::parse(tileset_text(small_tileset()))["root"];
  // Centre (1, 4, -1), half sides (2, 4, 2), y up.
  EXPECT_EQ(root["boundingVolume"]["box"],
            (Json{1.0, 1.0, 4.0, 2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 4.0}));
  EXPECT_EQ(root["transform"], (Json{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 10.0, -30.0, 20.0, 1}));
}

TEST(TilesetJson, MeasuredErrorsAreNeverMadeSmaller) {
  Tileset t = small_tileset();
  t.levels[1].error_max = 5;
  EXPECT_DOUBLE_EQ(Json::parse(tileset_text(t))["root"]["geometricError"], 5);
}

TEST(TilesetJson, ErrorsAreInTheContentsUnit) {
  Tileset t = small_tileset();
  t.metres = 0.001;
  const Json j = Json::parse(tileset_text(t));
  EXPECT_DOUBLE_EQ(j["root"]["geometricError"], 0.0008);
  EXPECT_EQ(j["root"]["extras"]["errorMax"], 0.05);  // as measured
}

TEST(TilesetJson, AFlatObjectHasABoxWithAnInside) {
  Tileset t = small_tileset();
  t.origin = {};
  t.bounds = Box3d{{0, 0, 0}, {2, 0, 2}};
  const Json root = Json::parse(tileset_text(t))["root"];
  EXPECT_GT(root["boundingVolume"]["box"][11], 0);
  EXPECT_FALSE(root.contains("transform"));
}

}  // namespace texmesh::tileset_test
