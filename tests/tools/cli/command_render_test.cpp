// texmesh render as a user runs it: models and packages, sheets, what is printed, exit codes.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "stages/image/decode_image.h"
#include "tests/support/command.h"
#include "tests/support/gltf_builder.h"

namespace texmesh::testing::command_render_test {

using Json = nlohmann::json;
const std::string kPackage = std::string(TEXMESH_SOURCE_DIR) + "/tests/golden/v2.0-scan.texmesh";

CommandResult render(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), {TEXMESH_BINARY, "render"});
  return run_command(arguments);
}

Pixels picture(const std::string& path) {
  const std::string bytes = read_text(path);
  return decode_image(probe_image(path, {bytes.begin(), bytes.end()}, {}));
}

class RenderCommand : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = new TemporaryFolder;
    const CommandResult made = run_command(
        {TEXMESH_MAKE_SCAN, "--triangles", "1500", "--texture", "128", "--textures", "-o", scan()});
    ASSERT_EQ(made.exit_code, 0) << made.errors;
  }
  static void TearDownTestSuite() { delete shared_; }
  static std::string scan() { return *shared_ / "scan.glb"; }
  std::string out() const { return folder_ / "x.png"; }

  static TemporaryFolder* shared_;
  TemporaryFolder folder_;
};
TemporaryFolder* RenderCommand::shared_ = nullptr;

TEST_F(RenderCommand, AModelAsTextAndAsJson) {
  const CommandResult text = render({scan(), "-o", out(), "--size", "64"});
  ASSERT_EQ(text.exit_code, 0) << text.errors;
  EXPECT_EQ(text.output.find("x.png: "), 0u) << text.output;
  const Pixels first = picture(out());
  EXPECT_EQ(first.width_px, 64u);
  const CommandResult r = render({scan(), "-o", out(), "--size", "64", "--json", "-j", "1"});
  const Json json = Json::parse(r.output);
  EXPECT_EQ(json["file"], "x.png");
  EXPECT_EQ(json["environment"], "studio");
  EXPECT_GT(json["triangles"], 1000);
  EXPECT_GE(json["textures"].size(), 3u);
  EXPECT_GT(json["views"][0]["covered_px"], 64 * 64 / 10);
  EXPECT_EQ(picture(out()).data, first.data);  // whatever the threads
}

TEST_F(RenderCommand, SheetsEnvironmentsAndBaseColours) {
  ASSERT_EQ(render({scan(), "-o", out(), "--size", "48", "--views", "5"}).exit_code, 0);
  EXPECT_EQ(picture(out()).width_px, 144u);
  EXPECT_EQ(picture(out()).height_px, 96u);
  std::vector<std::vector<std::uint8_t>> pictures;
  for (const std::vector<std::string>& more :
       {std::vector<std::string>{}, {"--environment", "white"}, {"--unlit"}}) {
    std::vector<std::string> arguments{scan(), "-o", out(), "--size", "48"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    ASSERT_EQ(render(arguments).exit_code, 0);
    pictures.push_back(picture(out()).data);
  }
  EXPECT_NE(pictures[0], pictures[1]);
  EXPECT_NE(pictures[0], pictures[2]);
  EXPECT_NE(pictures[1], pictures[2]);
}

TEST_F(RenderCommand, PackagesAsFileAndTreeWithScalesAndRungs) {
  const std::string tree = folder_ / "tree";
  ASSERT_EQ(run_command({TEXMESH_BINARY, "unpack", kPackage, "-o", tree}).exit_code, 0);
  std::vector<std::vector<std::uint8_t>> pictures;
  std::vector<Json> told;
  for (const std::vector<std::string>& choice : {std::vector<std::string>{kPackage},
                                                 {tree},
                                                 {kPackage, "--rung", "0"},
                                                 {kPackage, "--rung", "preview"},
                                                 {kPackage, "--rung", "source"},
                                                 {kPackage, "--rung", "max", "--scale", "0"}}) {
    std::vector<std::string> arguments = choice;
    arguments.insert(arguments.end(), {"-o", out(), "--size", "48", "--json"});
    const CommandResult r = render(arguments);
    ASSERT_EQ(r.exit_code, 0) << r.errors;
    pictures.push_back(picture(out()).data);
    told.push_back(Json::parse(r.output));
  }
  EXPECT_EQ(pictures[0], pictures[1]);
  EXPECT_NE(pictures[0], pictures[2]);
  EXPECT_NE(pictures[0], pictures[3]);
  EXPECT_EQ(pictures[0], pictures[5]);
  EXPECT_LT(told[3]["textures"][0]["width_px"], told[0]["textures"][0]["width_px"]);
  EXPECT_EQ(told[2]["views"][0]["eye"], told[0]["views"][0]["eye"]);
}

TEST_F(RenderCommand, ExitCodes) {
  EXPECT_EQ(render({"--help"}).exit_code, 0);
  EXPECT_EQ(render({scan()}).exit_code, 2);
  EXPECT_EQ(render({scan(), "-o", folder_ / "x.jpg"}).exit_code, 2);
  EXPECT_EQ(render({scan(), "-o", out(), "--environment", "sun"}).exit_code, 2);
  EXPECT_EQ(render({scan(), "-o", out(), "--views", "0"}).exit_code, 2);
  EXPECT_EQ(render({scan(), "-o", out(), "--views", "64", "--size", "4096"}).exit_code, 2);
  EXPECT_EQ(render({scan(), "-o", out(), "--scale", "3"}).exit_code, 2);
  EXPECT_EQ(render({kPackage, "-o", out(), "--rung", "best"}).exit_code, 2);
  const CommandResult scale = render({kPackage, "-o", out(), "--scale", "98"});
  EXPECT_EQ(scale.exit_code, 1);
  EXPECT_EQ(render({kPackage, "-o", out(), "--rung", "99"}).exit_code, 1);
  EXPECT_EQ(render({folder_ / "absent.glb", "-o", out(), "--scale", "3"}).exit_code, 1);
  EXPECT_EQ(render({scan(), "-o", folder_ / "none/x.png"}).exit_code, 1);
  write_text(folder_ / "bad.glb", read_text(scan()).substr(0, 5000));
  const CommandResult bad = render({folder_ / "bad.glb", "-o", out()});
  EXPECT_EQ(bad.exit_code, 1);
  EXPECT_NE(bad.errors.find("bad.glb"), std::string::npos) << bad.errors;
  EXPECT_TRUE(read_text(out()).empty());  // no failure left anything behind
}

TEST_F(RenderCommand, AMeshOfAnUnpackedPackageHasItsPreviews) {
  const std::string tree = folder_ / "tree";
  ASSERT_EQ(run_command({TEXMESH_BINARY, "unpack", kPackage, "-o", tree}).exit_code, 0);
  const CommandResult r = render({tree + "/mesh/s00.glb", "-o", out(), "--size", "48", "--json"});
  ASSERT_EQ(r.exit_code, 0) << r.errors;
  EXPECT_GE(Json::parse(r.output)["textures"].size(), 1u);
  EXPECT_EQ(run_command({TEXMESH_BINARY, "doctor", "s00.glb"}, {}, tree + "/mesh").exit_code, 0);
  // Without a manifest the folder above is none of the model's business.
  std::filesystem::rename(tree + "/manifest.json", tree + "/other.json");
  const CommandResult bare = render({tree + "/mesh/s00.glb", "-o", out(), "--size", "48", "--json"});
  EXPECT_EQ(Json::parse(bare.output)["textures"].size(), 0u);
  EXPECT_NE(bare.output.find("missing-texture"), std::string::npos) << bare.output;
  std::filesystem::rename(tree + "/other.json", tree + "/manifest.json");
  // Links out of the package are not followed.
  const std::string elsewhere = folder_ / "elsewhere";
  std::filesystem::rename(tree + "/preview", elsewhere);
  std::filesystem::create_directory_symlink(elsewhere, tree + "/preview");
  const CommandResult linked = render({tree + "/mesh/s00.glb", "-o", out(), "--size", "48", "--json"});
  EXPECT_EQ(Json::parse(linked.output)["textures"].size(), 0u);
}

TEST_F(RenderCommand, PathsThatLeaveThePackageAreNotFollowed) {
  const std::string tree = folder_ / "tree";
  ASSERT_EQ(run_command({TEXMESH_BINARY, "unpack", kPackage, "-o", tree}).exit_code, 0);
  for (const char* uri : {"../../preview/000.jpg", "../preview/../preview/000.jpg", "../manifest.json",
                          "../preview/x.jpg", "../poster.jpg", "/etc/hostname"}) {
    GltfBuilder b = quad();
    b.json["images"] = {{{"uri", uri}}};
    b.json["textures"] = {{{"source", 0}}};
    b.json["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
    b.json["meshes"][0]["primitives"][0]["material"] = 0;
    const Bytes glb = b.glb();
    write_text(tree + "/mesh/s99.glb", {glb.begin(), glb.end()});
    const CommandResult r = render({tree + "/mesh/s99.glb", "-o", out(), "--size", "16", "--json"});
    EXPECT_EQ(r.exit_code, 0) << uri << r.errors;
    EXPECT_EQ(Json::parse(r.output)["textures"].size(), 0u) << uri;
    EXPECT_NE(r.output.find("missing-texture"), std::string::npos) << uri << r.output;
  }
}

TEST_F(RenderCommand, AnEmptyPictureSaysWhy) {
  GltfBuilder b = quad();
  b.json["materials"] = {
      {{"alphaMode", "BLEND"}, {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0}}}}}};
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  const Bytes glb = b.glb();
  const std::string model = folder_ / "glass.glb";
  write_text(model, {glb.begin(), glb.end()});
  const CommandResult text = render({model, "-o", out(), "--size", "16"});
  EXPECT_EQ(text.exit_code, 0) << text.errors;
  EXPECT_NE(text.errors.find("every material of the model is wholly transparent (alpha 0)"),
            std::string::npos)
      << text.errors;
  const Json json = Json::parse(render({model, "-o", out(), "--size", "16", "--json"}).output);
  EXPECT_EQ(json["notes"].back()["code"], "empty-picture");
}

}  // namespace texmesh::testing::command_render_test
