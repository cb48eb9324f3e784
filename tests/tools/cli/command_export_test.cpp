// texmesh export as a user runs it: folders, what is printed, exit codes, and packages that are made to harm.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "format/rules/output_transform.h"
#include "stages/gltf/check_glb.h"
#include "tests/support/command.h"
#include "tests/support/packages.h"
#include "tests/support/schema.h"
#include "tests/support/small_builds.h"
#include "tests/tools/publish/pages/html_check.h"

namespace texmesh::testing::command_export_test {

using Json = nlohmann::json;

const std::string kScan = TEXMESH_SOURCE_DIR "/tests/golden/v2.0-scan.texmesh";
constexpr const char* kTargets[] = {"3dtiles", "gltf-lod", "model-viewer", "oembed"};

class ExportCommand : public ::testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(folder_ / "viewer/assets");
    write_text(folder_ / "viewer/index.html", "<!DOCTYPE html>");
    write_text(folder_ / "viewer/assets/a.js", "1");
    write_text(folder_ / "viewer/model-viewer.min.js", "2");
    write_text(folder_ / "viewer/.hidden", "no");
  }
  CommandResult run(const std::string& package, const std::string& target,
                    std::vector<std::string> more = {}) {
    std::vector<std::string> all{TEXMESH_BINARY, "export", package, "--to", target, "-o", folder_ / "out"};
    if (target == "oembed") all.insert(all.end(), {"--url", "https://a.example/x"});
    if (target == "oembed" || target == "model-viewer")
      all.insert(all.end(), {"--viewer", folder_ / "viewer"});
    all.insert(all.end(), more.begin(), more.end());
    return run_command(all);
  }
  std::string text(const std::string& file) const { return read_text(folder_ / ("out/" + file)); }
  std::string written(const PackageParts& parts) {
    const Bytes bytes = parts.build();
    write_text(folder_ / "made.texmesh", std::string(bytes.begin(), bytes.end()));
    return folder_ / "made.texmesh";
  }
  static GlbFacts facts_of(const std::string& glb) {
    Findings findings;
    const Bytes bytes(glb.begin(), glb.end());
    const GlbFacts facts = check_glb(bytes, "x.glb", findings, GlbRules::kStandalone);
    EXPECT_TRUE(findings.empty());
    return facts;
  }
  TemporaryFolder folder_;
};

TEST_F(ExportCommand, EveryTargetWritesWhatItsListNamesTheSameForAnyThreads) {
  for (const std::string target : kTargets) {
    const CommandResult r = run(kScan, target, {"--json", "--jobs", "1"});
    ASSERT_EQ(r.exit_code, 0) << target << r.errors;
    const Json j = Json::parse(r.output);
    EXPECT_TRUE(follows_schema(j, "export.v1"));
    EXPECT_EQ(j["target"], target);
    EXPECT_EQ(text("export.json"), r.output);
    EXPECT_TRUE(std::filesystem::exists(folder_ / ("out/" + j["open"].get<std::string>())));
    for (const Json& f : j["files"])
      EXPECT_TRUE(std::filesystem::exists(folder_ / ("out/" + f["path"].get<std::string>()))) << f;
    const Packages first = packages_in(folder_ / "out");
    ASSERT_EQ(run(kScan, target, {"--jobs", "8"}).exit_code, 0) << "an earlier export is replaced";
    EXPECT_EQ(packages_in(folder_ / "out"), first) << target;
  }
}

TEST_F(ExportCommand, TilesHoldTheScalesWithinTheirBoxes) {
  ASSERT_EQ(
      run_command({TEXMESH_MAKE_SCAN, "-o", folder_ / "s.glb", "--triangles", "4000", "--texture", "1024"})
          .exit_code,
      0);
  write_text(folder_ / "cheap.json", kCheapProfile);
  const CommandResult compiled =
      run_command({TEXMESH_BINARY, "compile", folder_ / "s.glb", "-o", folder_ / "s.texmesh", "--profile",
                   folder_ / "cheap.json", "--no-cache", "--quiet"});
  ASSERT_EQ(compiled.exit_code, 0) << compiled.errors;
  ASSERT_EQ(run(folder_ / "s.texmesh", "3dtiles").exit_code, 0);
  const Json tileset = Json::parse(text("tileset.json"));
  double above = tileset["geometricError"];
  std::uint64_t triangles = 0;
  std::size_t levels = 0;
  for (const Json* tile = &tileset["root"]; tile; ++levels) {
    EXPECT_LE((*tile)["geometricError"], above);
    above = (*tile)["geometricError"];
    const GlbFacts facts = facts_of(text((*tile)["content"]["uri"]));
    EXPECT_GE(facts.triangles, triangles);
    triangles = facts.triangles;
    const auto box = (*tile)["boundingVolume"]["box"].get<std::vector<double>>();
    const Vec3d low{facts.bounds_min.x, -facts.bounds_max.z, facts.bounds_min.y},
        high{facts.bounds_max.x, -facts.bounds_min.z, facts.bounds_max.y};
    for (int k = 0; k < 3; ++k) {
      const double half = box[static_cast<std::size_t>(3 + 4 * k)];
      EXPECT_GE(low[k], box[static_cast<std::size_t>(k)] - half * (1 + 1e-9));
      EXPECT_LE(high[k], box[static_cast<std::size_t>(k)] + half * (1 + 1e-9));
    }
    tile = tile->contains("children") ? &(*tile)["children"][0] : nullptr;
  }
  EXPECT_GE(levels, 2u);
  EXPECT_EQ(above, 0);
}

TEST_F(ExportCommand, TilesAreInMetresWhereTheUnitIsKnown) {
  PackageParts parts = make_package_parts();
  parts.manifest.origin = {100, 200, 300};
  const Vec3d high = parts.manifest.bounds_max;
  parts.about.unit = "mm";
  parts.about.metres_per_unit = 0.001;
  ASSERT_EQ(run(written(parts), "3dtiles").exit_code, 0);
  const Json root = Json::parse(text("tileset.json"))["root"];
  EXPECT_NEAR(root["transform"][12].get<double>(), 0.1, 1e-12);
  EXPECT_NEAR(root["transform"][13].get<double>(), -0.3, 1e-12);
  EXPECT_NEAR(root["transform"][14].get<double>(), 0.2, 1e-12);
  EXPECT_NEAR(facts_of(text("level-0.glb")).bounds_max.x, 0.001 * high.x, 1e-6);
  EXPECT_EQ(text("level-0.glb").find("\"mm\""), std::string::npos) << "the file says it is in metres";
}

// A file of each kind has the object at the same place, as large and the same way up.
TEST_F(ExportCommand, AllFilesAgreeOnUnitsAndAxes) {
  const auto box_of = [&](const std::string& glb) {
    const GlbFacts facts = facts_of(glb);
    return Box3d{facts.bounds_min, facts.bounds_max};
  };
  PackageParts parts = make_package_parts();
  parts.manifest.origin = {100, 200, 300};
  using Case = std::pair<double, const char*>;
  for (const auto& [metres, up] :
       {Case{0, ""}, {0, "z"}, {1, "x"}, {0.001, "y"}, {0.001, "z"}, {0.3048, "x"}}) {
    SCOPED_TRACE(std::to_string(metres) + up);
    parts.about.unit = metres > 0 ? "unit" : "";
    parts.about.metres_per_unit = metres;
    parts.about.up_axis = up;
    const std::string package = written(parts);
    const auto extracted = [&](std::vector<std::string> more) {
      more.insert(more.begin(), {TEXMESH_BINARY, "extract", package, "-o", folder_ / "one.glb"});
      const CommandResult r = run_command(more);
      EXPECT_TRUE(r.exit_code == 0 || r.exit_code == 4) << r.errors;
      EXPECT_EQ(r.output.find("unit of length is not known") != std::string::npos, metres == 0) << r.output;
      return box_of(read_text(folder_ / "one.glb"));
    };
    const auto expect_alike = [&](const Box3d& a, const Box3d& b, const std::string& what) {
      EXPECT_LT(length(a.min - b.min) + length(a.max - b.max), 1e-3 * a.diagonal()) << what;
    };
    const Box3d truth = output_transform(parts.about, parts.manifest.origin,
                                         false)(Box3d{parts.manifest.bounds_min, parts.manifest.bounds_max});
    expect_alike(truth, extracted({"--scale", "0"}), "a scale");
    expect_alike(truth, extracted({"--scale", "0", "--plain"}), "plain");
    const Box3d kept = extracted({"--scale", "0", "--keep-units"});
    EXPECT_NEAR(kept.diagonal() * (metres > 0 ? metres : 1), truth.diagonal(), 1e-3 * truth.diagonal());
    ASSERT_EQ(run(package, "model-viewer").exit_code, 0);
    EXPECT_NEAR(box_of(text("model.glb")).diagonal(), truth.diagonal(), 0.05 * truth.diagonal());
    ASSERT_EQ(run(package, "3dtiles").exit_code, 0);
    Box3d tile = box_of(text("level-0.glb"));
    const Json root = Json::parse(text("tileset.json"))["root"];
    const Vec3d to{root["transform"][12], root["transform"][14], -root["transform"][13].get<double>()};
    tile.min = tile.min + to, tile.max = tile.max + to;
    expect_alike(truth, tile, "tiles");
  }
}

TEST_F(ExportCommand, ModelViewersScriptStandsBesideItsPage) {
  ASSERT_EQ(run(kScan, "model-viewer").exit_code, 0);
  const std::string page = text("index.html");
  EXPECT_NE(page.find("<script type=\"module\" src=\"model-viewer/model-viewer.min.js\"></script>"),
            std::string::npos);
  EXPECT_EQ(page.find("https://cdn."), std::string::npos);
  EXPECT_EQ(text("model-viewer/model-viewer.min.js"), "2");
  ASSERT_EQ(run(kScan, "model-viewer", {"--script", "../mv.js"}).exit_code, 0);
  EXPECT_NE(text("index.html").find("src=\"../mv.js\""), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out/model-viewer"));
  std::filesystem::remove(folder_ / "viewer/model-viewer.min.js");
  const CommandResult missing = run(kScan, "model-viewer");
  EXPECT_EQ(missing.exit_code, 1);
  EXPECT_NE(missing.errors.find("--target viewer"), std::string::npos) << missing.errors;
}

TEST_F(ExportCommand, ModelViewerHasAUsdzForIphones) {
  ASSERT_EQ(run(kScan, "model-viewer", {"--draco"}).exit_code, 0);
  const std::string page = text("index.html");
  EXPECT_NE(page.find(" ios-src=\"model.usdz\" ar=\"\""), std::string::npos);
  EXPECT_NE(page.find("href=\"model.usdz\""), std::string::npos);
  ASSERT_EQ(run_command({TEXMESH_BINARY, "extract", kScan, "--display", "1000", "-o", folder_ / "a.USDZ"})
                .exit_code,
            0);
  EXPECT_EQ(text("model.usdz"), read_text(folder_ / "a.USDZ"));
  EXPECT_EQ(run_command({TEXMESH_BINARY, "extract", kScan, "--lods", "-o", folder_ / "b.usdz"}).exit_code, 1);
}

TEST_F(ExportCommand, LevelsOfDetailShareTheirTextures) {
  ASSERT_EQ(run(kScan, "gltf-lod").exit_code, 0);
  const std::string glb = text("model.glb");
  EXPECT_NE(glb.find("\"MSFT_lod\""), std::string::npos);
  EXPECT_NE(glb.find("MSFT_screencoverage"), std::string::npos);
  ASSERT_EQ(
      run_command({TEXMESH_BINARY, "extract", kScan, "--scale", "0", "-o", folder_ / "one.glb"}).exit_code,
      0);
  EXPECT_EQ(facts_of(glb).image_names.size(), facts_of(read_text(folder_ / "one.glb")).image_names.size());
  // Our own import shows the finest level.
  const CommandResult read = run_command(
      {TEXMESH_BINARY, "render", folder_ / "out/model.glb", "-o", folder_ / "lod.png", "--size", "64"});
  EXPECT_EQ(read.exit_code, 0) << read.errors;
  EXPECT_EQ(std::to_string(facts_of(read_text(folder_ / "one.glb")).triangles),
            read.output.substr(read.output.find(": ") + 2,
                               read.output.find(" triangles") - read.output.find(": ") - 2));
}

TEST_F(ExportCommand, WhatATargetCannotHoldIsExitCode1WithTheReason) {
  const CommandResult r = run(written(make_package_parts()), "gltf-lod", {"--display", "50"});
  EXPECT_EQ(r.exit_code, 1);
  EXPECT_NE(r.errors.find("MSFT_lod"), std::string::npos) << r.errors;
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
}

TEST_F(ExportCommand, Holds220MaterialsAndColoursWithoutAnyTexture) {
  const std::string planes = TEXMESH_SOURCE_DIR "/tests/golden/v2.0-planes.texmesh";
  write_text(folder_ / "c.obj",
             "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nv 0 1 0 1 1 0\nf 1 2 3\nf 1 3 4\n");
  const CommandResult compiled =
      run_command({TEXMESH_BINARY, "compile", folder_ / "c.obj", "-o", folder_ / "c.texmesh", "--no-cache",
                   "--quiet", "--quality.views", "1", "--quality.largest_px", "128"});
  ASSERT_EQ(compiled.exit_code, 0) << compiled.errors;
  for (const std::string target : {"3dtiles", "gltf-lod", "model-viewer"}) {
    const std::string glb = "out/" + std::string(target == "3dtiles" ? "level-0.glb" : "model.glb");
    const CommandResult many = run(planes, target);
    ASSERT_EQ(many.exit_code, 0) << target << many.errors;
    EXPECT_EQ(facts_of(read_text(folder_ / glb)).image_names.size(), 220u) << target;
    const CommandResult none = run(folder_ / "c.texmesh", target);
    if (none.exit_code == 1) {  // two triangles have no coarser scale
      EXPECT_EQ(target, "gltf-lod");
      EXPECT_NE(none.errors.find("levels of detail"), std::string::npos) << none.errors;
      continue;
    }
    ASSERT_EQ(none.exit_code, 0) << target << none.errors;
    EXPECT_EQ(facts_of(read_text(folder_ / glb)).image_names.size(), 0u);
  }
}

TEST_F(ExportCommand, HostileTextStaysText) {
  PackageParts parts = make_package_parts();
  parts.manifest.title = "\"><script>alert(1)</script>{{script}}";
  parts.about.description = "' onload=\"x\" {{title}}";
  parts.about.creator = "</p><img src=x onerror=alert(1)>";
  parts.about.licence = "<b>mine</b>";
  const std::string package = written(parts);
  for (const std::string target : {"model-viewer", "oembed"}) {
    ASSERT_EQ(run(package, target).exit_code, 0);
    const std::string page = text("index.html");
    EXPECT_EQ(tag_fault(page), "") << target;
    EXPECT_EQ(page.find("<script>"), std::string::npos);
    EXPECT_EQ(page.find("<img"), std::string::npos);
    EXPECT_EQ(page.find("<b>"), std::string::npos);
    EXPECT_TRUE(attributes(page, "onload").empty());
    EXPECT_NE(page.find("{{script}}"), std::string::npos) << "a value is not looked into";
  }
  EXPECT_EQ(Json::parse(text("oembed.json"))["title"], parts.manifest.title);
}

TEST_F(ExportCommand, OembedCopiesViewerAndPackage) {
  ASSERT_EQ(run(kScan, "oembed", {"--width", "800", "--provider", "Museum"}).exit_code, 0);
  EXPECT_EQ(text("object.texmesh"), read_text(kScan));
  EXPECT_EQ(text("viewer/assets/a.js"), "1");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out/viewer/.hidden"));
  const Json j = Json::parse(text("oembed.json"));
  EXPECT_EQ(j["provider_name"], "Museum");
  EXPECT_EQ(j["provider_url"], "https://a.example");
  EXPECT_NE(j["html"].get<std::string>().find(
                "https://a.example/x/viewer/index.html?panel=none&amp;pkg=../object.texmesh"),
            std::string::npos);
  EXPECT_NE(text("index.html").find("application/json+oembed"), std::string::npos);
}

TEST_F(ExportCommand, ANewerMinorVersionIsExported) {
  const std::string later = folder_ / "later.texmesh";
  ASSERT_EQ(run_command({"python3", TEXMESH_SOURCE_DIR "/tests/golden/make_later",
                         TEXMESH_SOURCE_DIR "/tests/golden/v2.0-webp.texmesh", later})
                .exit_code,
            0);
  for (const std::string target : kTargets) {
    const CommandResult r = run(later, target);
    EXPECT_EQ(r.exit_code, 0) << target << r.errors;
  }
}

TEST_F(ExportCommand, DamageAndOtherFoldersAreExitCode1NonsenseIs2) {
  std::string torn = read_text(kScan);
  torn.resize(torn.size() / 2);
  write_text(folder_ / "torn.texmesh", torn);
  EXPECT_EQ(run(folder_ / "torn.texmesh", "3dtiles").exit_code, 1);
  EXPECT_EQ(run(folder_ / "none.texmesh", "3dtiles").exit_code, 1);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
  EXPECT_EQ(run(kScan, "usdz").exit_code, 2);
  EXPECT_EQ(run(kScan, "3dtiles", {"--bytes", "2MB"}).exit_code, 2);
  EXPECT_EQ(run(kScan, "3dtiles", {"--url", "https://a.example/"}).exit_code, 2);
  EXPECT_EQ(run(kScan, "oembed", {"--plain"}).exit_code, 2);
  EXPECT_EQ(run(kScan, "oembed", {"--url", "javascript:alert(1)"}).exit_code, 2);
  EXPECT_EQ(run(kScan, "gltf-lod", {"--plain"}).exit_code, 2);
  std::filesystem::create_directories(folder_ / "out");
  write_text(folder_ / "out/mine.txt", "x");
  EXPECT_EQ(run(kScan, "3dtiles").exit_code, 1);
  EXPECT_EQ(text("mine.txt"), "x");
}

}  // namespace texmesh::testing::command_export_test
