// texmesh render --what as a user runs it: files, legend, exit codes, the cache that it shares with compile.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/support/command.h"

namespace texmesh::testing::painting_test {

using Json = nlohmann::json;

CommandResult texmesh(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), TEXMESH_BINARY);
  return run_command(arguments);
}

class RenderWhat : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = new TemporaryFolder;
    const CommandResult made =
        run_command({TEXMESH_MAKE_SCAN, "--triangles", "1500", "--texture", "256", "-o", scan()});
    ASSERT_EQ(made.exit_code, 0) << made.errors;
  }
  static void TearDownTestSuite() { delete shared_; }
  static std::string scan() { return *shared_ / "scan.glb"; }
  static std::string cache() { return *shared_ / "cache"; }

  static TemporaryFolder* shared_;
  TemporaryFolder folder_;
};
TemporaryFolder* RenderWhat::shared_ = nullptr;

TEST_F(RenderWhat, EveryQuantityAsGlbAndPng) {
  for (const char* what : {"scales", "fragments", "atlas"}) {
    const std::string glb = folder_ / "x.glb", png = folder_ / "x.png";
    const CommandResult r =
        texmesh({"render", scan(), "--what", what, "-o", glb, "--json", "--cache", cache()});
    ASSERT_EQ(r.exit_code, 0) << what << r.errors;
    const Json legend = Json::parse(r.output);
    EXPECT_EQ(legend["what"], what);
    EXPECT_FALSE(legend["quantity"].get<std::string>().empty());
    if (std::string(what) != "atlas") {
      EXPECT_LE(legend["range"][0], legend["range"][1]);
      EXPECT_EQ(legend["stops"].size(), 5u);
    }
    EXPECT_EQ(read_text(glb).substr(0, 4), "glTF");
    const CommandResult again =
        texmesh({"render", scan(), "--what", what, "-o", png, "--size", "64", "--cache", cache()});
    ASSERT_EQ(again.exit_code, 0) << what << again.errors;
    EXPECT_EQ(read_text(png).substr(1, 3), "PNG");
    EXPECT_NE(again.output.find(legend["quantity"].get<std::string>()), std::string::npos) << again.output;
  }
}

TEST_F(RenderWhat, SharesTheCacheWithCompileAndNeedsNoMoreStages) {
  const std::string own = folder_ / "cache";
  ASSERT_EQ(
      texmesh({"render", scan(), "--what", "fragments", "-o", folder_ / "x.glb", "--cache", own}).exit_code,
      0);
  const std::string bytes = read_text(folder_ / "x.glb");
  const CommandResult r = texmesh({"compile", scan(), "-o", folder_ / "p.texmesh", "--cache", own, "--json"});
  ASSERT_EQ(r.exit_code, 0) << r.errors;
  for (const char* hit : {"import", "condition", "fragmentation"})
    EXPECT_NE(r.output.find(std::string("\"stage\":\"") + hit + "\",\"result\":\"hit\""), std::string::npos)
        << r.output;
  EXPECT_EQ(r.output.find("\"stage\":\"simplification\",\"result\":\"hit\""), std::string::npos);
  // Same bytes without a cache, and from the package for what it holds.
  ASSERT_EQ(
      texmesh({"render", scan(), "--what", "fragments", "-o", folder_ / "y.glb", "--no-cache", "-j", "1"})
          .exit_code,
      0);
  EXPECT_EQ(read_text(folder_ / "y.glb"), bytes);
  ASSERT_EQ(texmesh({"unpack", folder_ / "p.texmesh", "-o", folder_ / "tree"}).exit_code, 0);
  for (const char* package : {"p.texmesh", "tree"})
    EXPECT_EQ(
        texmesh({"render", folder_ / package, "--what", "fragments", "-o", folder_ / "f.glb"}).exit_code, 0)
        << package;
}

TEST_F(RenderWhat, OptionsChangeWhatIsSeen) {
  ASSERT_EQ(texmesh({"render", scan(), "--what", "scales", "-o", folder_ / "x.glb", "--json", "--cache",
                     cache(), "--set", "ssf.scales=4"})
                .exit_code,
            0);
  const CommandResult r = texmesh({"render", scan(), "--what", "scales", "-o", folder_ / "x.glb", "--json",
                                   "--cache", cache(), "--set", "ssf.scales=4"});
  EXPECT_EQ(Json::parse(r.output)["range"][1], 4);
}

TEST_F(RenderWhat, ExitCodes) {
  const std::string out = folder_ / "x.glb";
  EXPECT_EQ(texmesh({"render", "--help"}).exit_code, 0);
  EXPECT_EQ(texmesh({"render", scan(), "--what", "atlas", "--unlit", "-o", out}).exit_code, 2);
  EXPECT_EQ(texmesh({"render", scan(), "--what", "eta", "-o", out}).exit_code, 2);
  EXPECT_EQ(texmesh({"render", scan(), "--what", "fragments", "-o", folder_ / "x.obj"}).exit_code, 2);
  EXPECT_EQ(texmesh({"render", scan(), "--what", "fragments", "-o", out, "--set", "ssf.size=4"}).exit_code,
            2);
  EXPECT_EQ(
      texmesh({"render", scan(), "--what", "fragments", "-o", out, "--set", "ssf.scales=999"}).exit_code, 2);
  EXPECT_EQ(
      texmesh({"render", folder_ / "absent.glb", "--what", "fragments", "-o", out, "--no-cache"}).exit_code,
      1);
  const CommandResult package = texmesh(
      {"render", TEXMESH_SOURCE_DIR "/tests/golden/v2.0-scan.texmesh", "--what", "scales", "-o", out});
  EXPECT_EQ(package.exit_code, 1);
  EXPECT_NE(package.errors.find("the model it was compiled from"), std::string::npos);
  EXPECT_TRUE(read_text(out).empty());  // no failure left anything behind
}

}  // namespace texmesh::testing::painting_test
