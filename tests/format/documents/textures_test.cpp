#include "format/documents/textures.h"

#include "format/documents/manifest.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "format/base/errors.h"
#include "format/container/container.h"
#include "tests/format/documents/manifest_fixture.h"

namespace texmesh::textures_test {

using testing::as_bytes;
using testing::make_manifest;
using Json = nlohmann::ordered_json;

TextureInfo texture(std::uint32_t plane, int rungs) {
  TextureInfo t;
  t.image = plane / 2;
  t.role = plane % 2 ? "alpha" : "base-colour";
  t.name = "wall \xc3\xa4.jpg";
  t.colour_space = plane % 2 ? "linear" : "srgb";
  t.channels = plane % 2 ? 1 : 3;
  t.width_px = 1000;
  t.height_px = 500;
  t.fragment_width_px = t.fragment_height_px = 256;
  t.columns = 4;
  t.rows = 2;
  t.grid_reason = "because";
  t.preview_width_px = 62;
  t.preview_height_px = 31;
  t.preview.path = preview_path(plane);
  t.tables.path = table_streams_path(plane);
  for (int r = 0; r < rungs; ++r) {
    t.rung_quality.push_back(5 + 10 * r);
    t.rungs.emplace_back().path = rung_path(plane, static_cast<std::uint32_t>(r));
  }
  return t;
}

TEST(Textures, RoundTripTruncationAndFlips) {
  const std::vector<TextureInfo> textures{texture(0, 3), texture(1, 10)};
  const std::string json = write_textures(textures);
  EXPECT_EQ(read_textures(as_bytes(json)), textures);
  EXPECT_EQ(read_textures(as_bytes(write_textures({}))), std::vector<TextureInfo>{});
  for (std::size_t n = 0; n < json.size(); ++n)
    EXPECT_THROW(read_textures(as_bytes(json).first(n)), FormatError) << n;
  for (std::size_t i = 0; i < json.size(); ++i)
    for (int bit = 0; bit < 8; ++bit) {
      std::string damaged = json;
      damaged[i] = static_cast<char>(damaged[i] ^ (1 << bit));
      try {
        write_textures(read_textures(as_bytes(damaged)));  // what was read can be written: it is in range
      } catch (const FormatError&) {
      }
    }
}

/// Two full-size planes and the mips of both.
std::vector<TextureInfo> with_mips() {
  std::vector<TextureInfo> textures{texture(0, 3), texture(1, 10)};
  for (const auto& [base, mip] : {std::pair{0u, 1u}, {0u, 3u}, {1u, 1u}}) {
    const auto plane = static_cast<std::uint32_t>(textures.size());
    TextureInfo t = texture(plane, 2);
    const TextureInfo& full = textures[base];
    t.image = full.image, t.role = full.role, t.channels = full.channels, t.colour_space = full.colour_space;
    t.mip = mip, t.base = base;
    t.width_px = mip == 1 ? 500 : 125;
    t.height_px = mip == 1 ? 250 : 63;
    t.columns = mip == 1 ? 2 : 1, t.rows = 1;
    t.preview.path = full.preview.path;
    textures.push_back(t);
  }
  return textures;
}

TEST(Textures, MipsRoundTripAndTheirRulesAreChecked) {
  const std::vector<TextureInfo> textures = with_mips();
  EXPECT_EQ(read_textures(as_bytes(write_textures(textures))), textures);
  EXPECT_EQ(full_size_planes(textures), 2u);
  const auto refused = [&](const char* place, auto change) {
    Json j = Json::parse(write_textures(textures));
    change(j["textures"]);
    try {
      read_textures(as_bytes(j.dump()));
      ADD_FAILURE() << place;
    } catch (const FormatError& e) {
      EXPECT_EQ(e.place(), std::string("/textures/") + place);
    }
  };
  refused("2/base", [](Json& j) { j[2].erase("base"); });
  refused("2/base", [](Json& j) { j[2]["base"] = 2; });
  refused("2/base", [](Json& j) { j[2]["base"] = -1; });
  refused("2/mip", [](Json& j) { j[2]["mip"] = 21; });
  refused("3", [](Json& j) { j[3].erase("mip"); });
  refused("3/mip", [](Json& j) { j[3]["mip"] = 1; });
  refused("3/widthPx", [](Json& j) { j[3]["mip"] = 2; });
  refused("4/mip", [](Json& j) { std::swap(j[3], j[4]); });
  refused("2", [](Json& j) { j[2]["image"] = 5; });
  refused("2", [](Json& j) { j[2]["channels"] = 1; });
  refused("4", [](Json& j) { j[4]["previewWidthPx"] = 7; });
}

TEST(Textures, TheSourceRungRoundTripsAndItsRulesAreChecked) {
  std::vector<TextureInfo> textures = with_mips();
  textures[0].source_rung = true;
  textures[1].source_extension = "exr";
  textures[1].source_colours = false;
  textures[1].source.path = "source/001.exr";
  EXPECT_EQ(read_textures(as_bytes(write_textures(textures))), textures);
  std::vector<TextureInfo> resolved = textures;
  EXPECT_THROW(resolve_textures(resolved, {}), FormatError);
  const auto refused = [&](const char* place, auto change) {
    Json j = Json::parse(write_textures(textures));
    change(j["textures"]);
    try {
      read_textures(as_bytes(j.dump()));
      ADD_FAILURE() << place;
    } catch (const FormatError& e) {
      EXPECT_EQ(e.place(), std::string("/textures/") + place);
    }
  };
  refused("0/sourceRung", [](Json& j) { j[0]["sourceRung"] = 1; });
  refused("0/sourceRung", [](Json& j) { j[0]["codec"] = "webp"; });
  refused("2/sourceRung", [](Json& j) { j[2]["sourceRung"] = true; });
  refused("1/source", [](Json& j) { j[1]["source"] = "../png"; });
  refused("1/sourceColours", [](Json& j) { j[1].erase("sourceColours"); });
  refused("1/sourceColours", [](Json& j) { j[1]["sourceColours"] = "no"; });
  refused("2/source", [](Json& j) { j[2]["source"] = "png", j[2]["sourceColours"] = true; });
}

TEST(Textures, RulesAreChecked) {
  const auto refused = [](const char* place, auto change) {
    Json j = Json::parse(write_textures({texture(0, 3)}));
    change(j["textures"][0]);
    try {
      read_textures(as_bytes(j.dump()));
      ADD_FAILURE() << place;
    } catch (const FormatError& e) {
      EXPECT_EQ(e.place(), std::string("/textures/0/") + place);
    }
  };
  refused("codec", [](Json& j) { j["codec"] = "jpeg-xl"; });
  refused("colourSpace", [](Json& j) { j["colourSpace"] = "p3"; });
  refused("channels", [](Json& j) { j["channels"] = 2; });
  refused("columns", [](Json& j) { j["columns"] = 5; });
  refused("rows", [](Json& j) { j["rows"] = 1; });
  refused("fragmentWidthPx", [](Json& j) { j["fragmentWidthPx"] = 255; });
  refused("rungQuality", [](Json& j) { j["rungQuality"] = Json::array(); });
  refused("rungQuality/1", [](Json& j) { j["rungQuality"][1] = 5; });
  refused("widthPx", [](Json& j) { j["widthPx"] = 0; });
  refused("name", [](Json& j) { j["name"] = "a\x1b[2J"; });
}

}  // namespace texmesh::textures_test
