// texmesh doctor as a user runs it: models and packages, limits, exit codes, documents.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/support/command.h"
#include "tests/support/schema.h"

namespace texmesh::testing::command_doctor_test {

using Json = nlohmann::json;
const std::string kPackage = std::string(TEXMESH_SOURCE_DIR) + "/tests/golden/v2.0-scan.texmesh";

CommandResult texmesh(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), TEXMESH_BINARY);
  return run_command(arguments);
}

struct DoctorCommand : ::testing::Test {
  TemporaryFolder folder;
};

TEST_F(DoctorCommand, AModelAsTextAndAsJson) {
  const std::string scan = folder / "scan.glb";
  ASSERT_EQ(
      run_command({TEXMESH_MAKE_SCAN, "--triangles", "1500", "--texture", "128", "--textures", "-o", scan})
          .exit_code,
      0);
  const CommandResult text = texmesh({"doctor", scan});
  ASSERT_EQ(text.exit_code, 0) << text.errors;
  EXPECT_EQ(text.output.find("scan.glb\ntexture 0 "), 0u) << text.output;
  const CommandResult r = texmesh({"doctor", scan, "--json", "-j", "1"});
  ASSERT_EQ(r.exit_code, 0) << r.errors;
  const Json json = Json::parse(r.output);
  EXPECT_TRUE(follows_schema(json, "doctor.v1"));
  EXPECT_EQ(json["input"], "scan.glb");
  EXPECT_EQ(json["good"], true);
  EXPECT_GT(json["charts"], 0);
  EXPECT_EQ(json["auto_atlas"], "compile --atlas auto keeps the source's atlas: " +
                                    std::to_string(json["charts"].get<int>()) + " charts are few");
  EXPECT_NE(text.output.find(json["auto_atlas"].get<std::string>()), std::string::npos) << text.output;
  EXPECT_EQ(texmesh({"doctor", scan, "--json", "-j", "2"}).output, r.output);  // whatever the threads
}

TEST_F(DoctorCommand, LimitsAreAGate) {
  const CommandResult good = texmesh({"doctor", kPackage, "--max-charts", "6", "--min-cover", "0.1"});
  EXPECT_EQ(good.exit_code, 0) << good.errors;
  EXPECT_NE(good.output.find("good enough\n"), std::string::npos) << good.output;
  const std::string junit = folder / "doctor.xml";
  const CommandResult bad =
      texmesh({"doctor", kPackage, "--max-charts", "5", "--min-cover", "0.1", "--junit", junit, "--json"});
  EXPECT_EQ(bad.exit_code, 4) << bad.errors;
  const Json json = Json::parse(bad.output);
  EXPECT_TRUE(follows_schema(json, "doctor.v1"));
  EXPECT_EQ(json["good"], false);
  EXPECT_EQ(json["reasons"], Json({"charts: 6, expected at most 5"}));
  EXPECT_FALSE(json.contains("auto_atlas")) << "of packages";
  EXPECT_NE(read_text(junit).find("<testsuite name=\"texmesh doctor\" tests=\"2\" failures=\"1\" "),
            std::string::npos);
  EXPECT_EQ(texmesh({"doctor", kPackage, "--max-charts", "5"}).exit_code, 4);
  EXPECT_EQ(texmesh({"doctor", kPackage, "--min-cover", "2"}).exit_code, 2);
  EXPECT_EQ(texmesh({"doctor", kPackage, "--min-cover", "nan"}).exit_code, 2);
}

TEST_F(DoctorCommand, DumpShowsTheSameFigures) {
  const CommandResult text = texmesh({"doctor", kPackage}), dumped = texmesh({"dump", kPackage, "atlas"});
  ASSERT_EQ(dumped.exit_code, 0) << dumped.errors;
  EXPECT_EQ("v2.0-scan.texmesh\n" + dumped.output, text.output);
  const Json json = Json::parse(texmesh({"dump", kPackage, "atlas", "--json"}).output);
  EXPECT_EQ(json["atlas"]["atlases"], Json::parse(texmesh({"doctor", kPackage, "--json"}).output)["atlases"]);
}

TEST_F(DoctorCommand, WhatHasNoAtlasAndWhatIsNoModel) {
  const std::string bare = folder / "bare.obj";
  write_text(bare, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const CommandResult r = texmesh({"doctor", bare, "--max-charts", "0"});
  EXPECT_EQ(r.exit_code, 0) << r.errors;
  EXPECT_NE(r.output.find("No material has a texture"), std::string::npos) << r.output;
  EXPECT_TRUE(follows_schema(Json::parse(texmesh({"doctor", bare, "--json"}).output), "doctor.v1"));
  write_text(bare, "nothing\n");
  EXPECT_EQ(texmesh({"doctor", bare}).exit_code, 1);
  EXPECT_EQ(texmesh({"doctor", folder / "none.glb"}).exit_code, 1);
  EXPECT_EQ(texmesh({"doctor"}).exit_code, 2);
}

TEST_F(DoctorCommand, NotANumberAsATextureCoordinateIsSaid) {
  const std::string model = folder / "nan.obj";
  write_text(folder / "m.mtl", "newmtl m\nmap_Kd t.png\n");
  write_text(model,
             "mtllib m.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt nan 0\nvt 0 1\nf 1/1 2/2 3/3\n");
  const CommandResult r = texmesh({"doctor", model});
  EXPECT_EQ(r.exit_code, 0) << r.errors;
  EXPECT_NE(r.errors.find("1 texture coordinate with NaN or infinity set to 0"), std::string::npos)
      << r.errors;
}

}  // namespace texmesh::testing::command_doctor_test
