// texmesh diff as a program: what differs between two packages, and which recorded change can be why.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "tests/support/command.h"

namespace texmesh::testing::command_diff_test {

using Json = nlohmann::json;
namespace fs = std::filesystem;

CommandResult texmesh(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), TEXMESH_BINARY);
  return run_command(arguments);
}

/// An OBJ with a texture beside it, so that mesh and image are inputs of their own.
class CliDiff : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = new TemporaryFolder;
    const CommandResult made = run_command(
        {TEXMESH_MAKE_SCAN, "--triangles", "600", "--texture", "128", "-o", *shared_ / "scan.obj"});
    ASSERT_EQ(made.exit_code, 0) << made.errors;
    compile("a.texmesh", {});
  }
  static void TearDownTestSuite() { delete shared_; }

  static void compile(const std::string& output, std::vector<std::string> options) {
    options.insert(options.begin(), {"compile", *shared_ / "scan.obj", "-o", *shared_ / output, "--cache",
                                     *shared_ / "cache"});
    const CommandResult r = texmesh(options);
    ASSERT_EQ(r.exit_code, 0) << r.output << r.errors;
  }
  static Json diff(const std::string& b) {
    const CommandResult r = texmesh({"diff", *shared_ / "a.texmesh", *shared_ / b, "--json"});
    EXPECT_EQ(r.exit_code, 4) << r.errors;
    return Json::parse(r.output);
  }
  static std::set<std::string> recorded(const Json& diff) {
    std::set<std::string> names;
    for (const Json& d : diff["recorded"])
      names.insert(d["kind"].get<std::string>() + " " + d["name"].get<std::string>());
    return names;
  }
  static std::set<std::string> stages(const Json& diff) {
    std::set<std::string> names;
    for (const Json& s : diff["stages"]) names.insert(s["stage"]);
    return names;
  }

  static TemporaryFolder* shared_;
};
TemporaryFolder* CliDiff::shared_ = nullptr;

TEST_F(CliDiff, APackageIsTheSameAsItself) {
  const std::string a = *shared_ / "a.texmesh", tree = *shared_ / "a";
  EXPECT_EQ(texmesh({"unpack", a, "-o", tree}).exit_code, 0);
  const CommandResult r = texmesh({"diff", a, tree});
  EXPECT_EQ(r.exit_code, 0) << r.output << r.errors;
  EXPECT_NE(r.output.find("the same package"), std::string::npos);
}

TEST_F(CliDiff, AnOptionOfTheLadderReachesTexturesOnly) {
  compile("rungs.texmesh", {"--ladder.rungs", "20,60,90"});
  const Json d = diff("rungs.texmesh");
  EXPECT_TRUE(recorded(d).contains("option ladder.rungs"));
  EXPECT_TRUE(stages(d).contains("ladder"));
  std::size_t meshes = 0, packs_of_one = 0;
  for (const Json& e : d["entries"]) {
    const std::string path = e["path"];
    meshes += path.starts_with("mesh/");
    packs_of_one += path.starts_with("texture/") && e["in"][0] != e["in"][1];
  }
  EXPECT_EQ(meshes, 0u);
  EXPECT_GT(packs_of_one, 0u);  // every rung that is asked for is stored
  for (const Json& s : d["stages"]) {
    ASSERT_FALSE(s["causes"].empty()) << s;
    for (const Json& cause : s["causes"]) EXPECT_EQ(d["recorded"][cause.get<int>()]["kind"], "option");
  }
}

TEST_F(CliDiff, AnOptionOfTheMeshIsNoCauseOfTextures) {
  compile("jnd.texmesh", {"--perceptual_values.jnd", "0.2"});
  const Json d = diff("jnd.texmesh");
  EXPECT_EQ(recorded(d), (std::set<std::string>{"option perceptual_values.jnd"}));
  EXPECT_FALSE(stages(d).contains("ladder"));
}

TEST_F(CliDiff, AnotherImageIsNamed) {
  std::string image;
  for (const fs::directory_entry& f : fs::directory_iterator(shared_->path()))
    if (f.path().extension() == ".jpg" || f.path().extension() == ".png") image = f.path().string();
  ASSERT_FALSE(image.empty());
  const std::string before = read_text(image);
  TemporaryFolder other;
  ASSERT_EQ(run_command({TEXMESH_MAKE_SCAN, "--triangles", "600", "--texture", "128", "--seed", "2", "-o",
                         other / "scan.obj"})
                .exit_code,
            0);
  write_text(image, read_text(other / fs::path(image).filename().string()));
  compile("image.texmesh", {});
  write_text(image, before);
  const Json d = diff("image.texmesh");
  EXPECT_EQ(recorded(d), (std::set<std::string>{"input " + fs::path(image).filename().string()}));
  EXPECT_TRUE(stages(d).contains("ladder"));
  const CommandResult text = texmesh({"diff", *shared_ / "a.texmesh", *shared_ / "image.texmesh"});
  EXPECT_NE(text.output.find("can come from: input " + fs::path(image).filename().string()),
            std::string::npos)
      << text.output;
}

TEST_F(CliDiff, WhatCannotBeReadIsAnError) {
  write_text(*shared_ / "no.texmesh", "no package");
  const CommandResult r = texmesh({"diff", *shared_ / "a.texmesh", *shared_ / "no.texmesh"});
  EXPECT_EQ(r.exit_code, 1);
  EXPECT_NE(r.errors.find("no.texmesh"), std::string::npos) << r.errors;
  EXPECT_EQ(texmesh({"diff", *shared_ / "a.texmesh"}).exit_code, 2);
}

}  // namespace texmesh::testing::command_diff_test
