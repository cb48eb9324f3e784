// Files for viewers of glTF in packages: what clients read does not change because of them.
#include "tests/support/chunks.h"
#include "tests/support/images.h"
#include "tests/support/small_builds.h"

namespace texmesh::testing::command_compile_gltf_test {

using Json = nlohmann::json;

class CompileGltf : public ::testing::Test {
 protected:
  void SetUp() override {
    Json profile = Json::parse(kCheapProfile);
    profile["scales"]["stream"] = true;
    profile["ssf"].erase("scales");
    profile["simplification"]["min_triangles"] = 100;
    profile["quality"]["flip_mean"] = 0.5;
    profile["quality"]["flip_p95"] = 1;
    write_text(folder_ / "profile.json", profile.dump());
    Random random{5};
    const Bytes glb = chunks_glb(textured_sphere(4, .1), 1, ChunkKind::kExact, random, png_bytes(64, 64, 3));
    write_text(folder_ / "sphere.glb", {glb.begin(), glb.end()});
  }
  std::string compile(const std::string& glb) {
    const std::string package = folder_ / (glb + ".texmesh");
    const CommandResult made =
        run_command({TEXMESH_BINARY, "compile", folder_ / "sphere.glb", "-o", package, "--cache",
                     folder_ / "cache", "--profile", folder_ / "profile.json", "--scales.glb", glb});
    EXPECT_EQ(made.exit_code, 0) << made.output << made.errors;
    return package;
  }
  Json json_of(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), TEXMESH_BINARY);
    arguments.push_back("--json");
    const CommandResult r = run_command(arguments);
    EXPECT_EQ(r.exit_code, 0) << r.output << r.errors;
    return Json::parse(r.output);
  }
  TemporaryFolder folder_;
};

TEST_F(CompileGltf, PlansAndIndexStayAsTheyAre) {
  const std::string ends = compile("ends"), all = compile("all");
  EXPECT_GT(read_text(all).size(), read_text(ends).size());
  for (const char* display : {"64", "100", "4000"}) {
    Json plans[2];
    for (int k = 0; k < 2; ++k) {
      plans[k] = json_of({"plan", k == 0 ? ends : all, "--bandwidth", "1Mbit/s", "--display", display});
      plans[k].erase("package");
    }
    EXPECT_EQ(plans[0], plans[1]) << display;
  }
  std::map<std::string, std::uint64_t> bytes[2];
  for (int k = 0; k < 2; ++k) {
    const Json dump = json_of({"dump", k == 0 ? ends : all, "entries"});
    for (const Json& e : dump["entries"]) bytes[k][e["path"]] = e["bytes"];
  }
  std::size_t beside = 0;
  for (const auto& [path, size] : bytes[1]) {
    if (path.starts_with("gltf/"))
      ++beside;
    else if (path != "manifest.json" && path != "provenance.json")
      EXPECT_EQ(bytes[0][path], size) << path;
  }
  EXPECT_GE(beside, 2u);
}

TEST_F(CompileGltf, TheTreeHasThemAndPacksToTheSameBytes) {
  const std::string all = compile("all"), tree = folder_ / "tree", packed = folder_ / "packed.texmesh";
  EXPECT_EQ(run_command({TEXMESH_BINARY, "unpack", all, "-o", tree}).exit_code, 0);
  EXPECT_TRUE(std::filesystem::exists(tree + "/gltf/index.bin"));
  EXPECT_EQ(run_command({TEXMESH_BINARY, "verify", all, tree}).exit_code, 0);
  EXPECT_EQ(run_command({TEXMESH_BINARY, "pack", tree, "-o", packed}).exit_code, 0);
  EXPECT_EQ(read_text(packed), read_text(all));
  std::filesystem::remove(tree + "/gltf/index.bin");
  EXPECT_EQ(run_command({TEXMESH_BINARY, "verify", tree}).exit_code, 1);
}

TEST_F(CompileGltf, PicturesThatAreNoWholeBlocksAreSound) {
  Random random{6};
  const Bytes glb = chunks_glb(textured_sphere(4, .1), 1, ChunkKind::kExact, random, png_bytes(200, 200, 3));
  write_text(folder_ / "sphere.glb", {glb.begin(), glb.end()});
  for (const char* atlas : {"keep", "rebuild"}) {
    const std::string package = folder_ / (std::string(atlas) + ".texmesh");
    const CommandResult made =
        run_command({TEXMESH_BINARY, "compile", folder_ / "sphere.glb", "-o", package, "--no-cache",
                     "--profile", folder_ / "profile.json", "--scales.glb", "all", "--atlas", atlas});
    EXPECT_EQ(made.exit_code, 0) << made.output << made.errors;
    const CommandResult verified = run_command({TEXMESH_BINARY, "verify", package});
    EXPECT_EQ(verified.exit_code, 0) << atlas << verified.output << verified.errors;
  }
}

TEST_F(CompileGltf, WithoutThemAPackageIsOfTheEarlierVersion) {
  EXPECT_EQ(json_of({"dump", compile("ends")})["package"]["version"]["minor"], 0);
  EXPECT_EQ(json_of({"dump", compile("all")})["package"]["version"]["minor"], 1);
}

}  // namespace texmesh::testing::command_compile_gltf_test
