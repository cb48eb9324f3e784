// Packages of every format version stay readable for ever (tests/golden/README.md).
#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "format/container/layout.h"
#include "format/documents/index.h"
#include "format/documents/manifest.h"
#include "format/documents/textures.h"
#include "stages/fragment_codec/fragment_codec.h"
#include "stages/jpeg/jpeg.h"
#include "tests/support/command.h"
#include "tools/inspect/dump/dump.h"
#include "tools/inspect/verify/verify.h"

namespace texmesh::golden_test {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

const fs::path kGolden = fs::path(TEXMESH_SOURCE_DIR) / "tests" / "golden";

std::vector<std::string> golden_packages() {
  std::vector<std::string> names;
  for (const auto& e : fs::directory_iterator(kGolden))
    if (e.path().extension() == ".texmesh") names.push_back(e.path().stem().string());
  std::sort(names.begin(), names.end());
  return names;
}

struct Golden : ::testing::TestWithParam<std::string> {
  std::string path = (kGolden / (GetParam() + ".texmesh")).string();
};

TEST_P(Golden, VerifiesWithoutAFinding) {
  const auto store = open_store(path);
  for (const Finding& f : verify_package(*store, {}).findings) ADD_FAILURE() << to_string(f);
}

/// Every figure that was told when the package was made is told today; later versions may tell more.
void expect_contains(const Json& now, const Json& then, const std::string& place) {
  if (then.is_object()) {
    for (const auto& [key, value] : then.items()) {
      ASSERT_TRUE(now.is_object() && now.contains(key)) << place << "/" << key;
      expect_contains(now[key], value, place + "/" + key);
    }
  } else if (then.is_array()) {
    ASSERT_TRUE(now.is_array() && now.size() == then.size()) << place;
    for (std::size_t i = 0; i < then.size(); ++i)
      expect_contains(now[i], then[i], place + "/" + std::to_string(i));
  } else {
    EXPECT_EQ(now, then) << place;
  }
}

TEST(GoldenPackages, SayWhatTheySaidWhenTheyWereMade) {
  std::size_t described = 0;
  for (const std::string& name : golden_packages()) {
    const fs::path then = kGolden / (name + ".json");
    if (!fs::exists(then)) continue;
    ++described;
    PackageReader package(open_store((kGolden / (name + ".texmesh")).string()));
    expect_contains(dump_json(package, DumpPart::kAll), Json::parse(testing::read_text(then.string())), name);
  }
  EXPECT_GT(described, 0u);
}

TEST_P(Golden, DecodesThroughTheRuntimeReader) {
  PackageReader package(open_store(path));
  for (const ManifestScale& s : package.manifest().scales)
    EXPECT_EQ((s.has_glb() ? package.scale_glb(s.scale) : package.split_prefix(s.scale)).size(), s.glb.bytes);
  for (std::uint32_t plane = 0; plane < package.textures().size(); ++plane) {
    const TextureInfo& t = package.textures()[plane];
    EXPECT_EQ(decode_jpeg(package.preview(plane), 1 << 24).width_px, t.preview_width_px);
    for (std::uint32_t rung = 0; rung < t.rungs.size(); ++rung)
      for (const std::uint16_t f : package.tables().planes[plane].order)
        EXPECT_EQ(decode_fragment_file(t.codec, package.complete_fragment(plane, rung, f), 1 << 24).height_px,
                  t.fragment_height_px);
  }
}

INSTANTIATE_TEST_SUITE_P(All, Golden, ::testing::ValuesIn(golden_packages()), [](const auto& test) {
  std::string name = test.param;
  std::replace_if(
      name.begin(), name.end(), [](char c) { return !std::isalnum(static_cast<unsigned char>(c)); }, '_');
  return name;
});

// A change of a default can take the feature out of a package that `make` makes anew.
TEST(GoldenPackages, ShowTheirFeatures) {
  const auto open = [](const std::string& name) {
    return PackageReader(open_store((kGolden / ("v2.0-" + name + ".texmesh")).string()));
  };
  const auto text_of = [&](const std::string& name, const std::string& entry) {
    const std::vector<std::uint8_t> bytes = open(name).entry(entry);
    return std::string(bytes.begin(), bytes.end());
  };
  const std::vector<std::array<std::string, 3>> features{
      {"webp", "textures.json", R"("codec":"webp")"},
      {"progressive", "textures.json", R"("codec":"jpeg-progressive")"},
      {"requantised", "textures.json", R"("sourceRung":true)"},
      {"png-normals", "textures.json", R"("role":"normal")"},
      {"png-normals", "textures.json", R"("codec":"jpeg-xy")"},
      {"alpha", "textures.json", R"("role":"alpha")"},
      {"source", "textures.json", R"("source":"png")"},
      {"nodes", "mesh/s00.glb", R"("name":"middle")"},
      {"part-names", "mesh/s00.glb", R"("partNames")"},
      {"proxies", "proxies/01.glb", "KHR_draco_mesh_compression"},
  };
  for (const auto& [name, entry, text] : features)
    EXPECT_NE(text_of(name, entry).find(text), std::string::npos) << name << ": " << text;
  EXPECT_EQ(text_of("proxies", "proxies/00.glb").find("KHR_draco_mesh_compression"), std::string::npos);
  EXPECT_EQ(open("planes").textures().size(), 220u);
  EXPECT_GT(open("requantised").textures().front().rungs.size(), 1u);
}

TEST(GoldenPackages, OfTwoOneShowNotes) {
  PackageReader reader(open_store((kGolden / "v2.1-notes.texmesh").string()));
  ASSERT_EQ(reader.annotations().list.size(), 2u);
  const Annotation& first = reader.annotations().list[0];
  EXPECT_EQ(first.texts.size(), 2u);
  EXPECT_TRUE(first.normal && first.camera && first.images.size() == 1);
  EXPECT_EQ(reader.manifest().minor, 1);
}

TEST(GoldenPackages, OfTwoOneShowStepsAsGlbs) {
  PackageReader reader(open_store((kGolden / "v2.1-steps.texmesh").string()));
  EXPECT_EQ(reader.manifest().minor, 1);
  std::vector<std::string> paths;
  for (const EntryRef& e : read_gltf_index(reader.entry(*reader.manifest().gltf))) paths.push_back(e.path);
  EXPECT_EQ(paths, (std::vector<std::string>{"gltf/000-r02.jpg", "gltf/s02.glb"}));
}

TEST(GoldenPackages, TheTreeIsThatOfItsContainer) {
  testing::TemporaryFolder folder;
  const std::string tree = (kGolden / "v2.0-tree").string(), packed = folder / "packed.texmesh";
  for (const Finding& f : verify_package(*open_store(tree), {}).findings) ADD_FAILURE() << to_string(f);
  ASSERT_EQ(testing::run_command({TEXMESH_BINARY, "pack", tree, "-o", packed}).exit_code, 0);
  EXPECT_TRUE(testing::read_text(packed) == testing::read_text((kGolden / "v2.0-webp.texmesh").string()));
}

TEST(GoldenPackages, TheMajorVersionHasOne) {
  const std::string prefix = "v" + std::to_string(kFormatMajor) + ".";
  const auto names = golden_packages();
  EXPECT_TRUE(std::any_of(names.begin(), names.end(), [&](const std::string& n) {
    return n.starts_with(prefix);
  })) << "run tests/golden/make, see its README.md";
}

}  // namespace texmesh::golden_test
