// What is known of an object, from the model and its curator to whoever gets a file: compile --meta, dump,
// diff, verify, extract, report.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "format/base/bytes.h"
#include "tests/support/schema.h"
#include "tests/support/small_builds.h"

namespace texmesh::testing::command_compile_about_test {

using Json = nlohmann::json;

class CompileAbout : public ::testing::Test {
 protected:
  CompileAbout() {
    write_text(folder_ / "profile.json", kCheapProfile);
    write_text(
        folder_ / "tent.obj",
        "# Author: A. Smith\n# unit: cm\n# made with a tool\nv 0 0 0\nv 2 0 0\nv 2 2 1\nv 0 2 1\nf 1 2 3\nf 1 3 4\n");
  }
  CommandResult compile(const std::vector<std::string>& more = {},
                        const std::string& package = "tent.texmesh") {
    std::vector<std::string> arguments{TEXMESH_BINARY,          "compile", folder_ / "tent.obj", "-o",
                                       folder_ / package,       "--cache", folder_ / "cache",    "--profile",
                                       folder_ / "profile.json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_command(arguments);
  }
  std::string meta(const std::string& json) {
    write_text(folder_ / "meta.json", json);
    return folder_ / "meta.json";
  }
  Json about(const std::string& package = "tent.texmesh") {
    const CommandResult dumped = run_command({TEXMESH_BINARY, "dump", folder_ / package, "about", "--json"});
    EXPECT_EQ(dumped.exit_code, 0) << dumped.errors;
    return Json::parse(dumped.output)["about"];
  }
  TemporaryFolder folder_;
};

TEST_F(CompileAbout, ALicenceOrCodeThatDoesNotExistIsAUsageErrorThatNamesTheField) {
  for (const auto& [json, field] :
       {std::pair{R"({"licence":"CC-BY-9.0"})", "/licence"},
        {R"({"coordinateReference":{"epsg":99999}})", "/coordinateReference/epsg"},
        {R"({"creater":"A"})", "/creater"}}) {
    const CommandResult refused = compile({"--meta", meta(json)});
    EXPECT_EQ(refused.exit_code, 2) << json;
    EXPECT_NE(refused.errors.find(field), std::string::npos) << refused.errors;
    EXPECT_FALSE(std::filesystem::exists(folder_ / "tent.texmesh"));
  }
  EXPECT_EQ(compile({"--meta", folder_ / "none.json"}).exit_code, 2);
  EXPECT_EQ(compile({"--up", "z", "--meta", meta(R"({"upAxis":"z"})")}).exit_code, 2);
}

TEST_F(CompileAbout, TheCuratorsUpAxisTurnsTheObjectAsTheFlagDoes) {
  const std::string up_is_z = meta(R"({"upAxis":"z"})");
  ASSERT_EQ(compile({"--meta", up_is_z}).exit_code, 0);
  EXPECT_EQ(about()["upAxis"], "y") << "that of the package's coordinates";
  const std::string by_word = testing::read_text(folder_ / "tent.texmesh");
  ASSERT_EQ(compile({"--up", "Z"}).exit_code, 0);
  EXPECT_EQ(about()["upAxis"], "y");
  ASSERT_EQ(compile({"--up", "z", "--meta", meta(R"({"upAxis":"y"})")}).exit_code, 0);
  EXPECT_EQ(testing::read_text(folder_ / "tent.texmesh"), by_word);
  ASSERT_EQ(compile({"--up", "keep", "--meta", meta(R"({"upAxis":"z"})")}).exit_code, 0);
  EXPECT_EQ(about()["upAxis"], "z") << "refused";
}

TEST_F(CompileAbout, TheCuratorsWordsStandOverTheModels) {
  ASSERT_EQ(compile().exit_code, 0);
  EXPECT_EQ(about()["creator"], "A. Smith");
  EXPECT_EQ(about()["unit"]["metres"], 0.01);
  EXPECT_FALSE(about().contains("upAxis"));
  const CommandResult made = compile({"--title", "Tent", "--meta",
                                      meta(R"({"title":"-","licence":"cc0-1.0","unit":"mm","description":")" +
                                           std::string(10000, 'd') + "\"}")});
  ASSERT_EQ(made.exit_code, 0) << made.errors;
  EXPECT_EQ(about()["title"], "Tent");
  EXPECT_EQ(about()["description"].get<std::string>().size(), 10000u);
  EXPECT_EQ(about()["licence"], "CC0-1.0");
  EXPECT_EQ(about()["unit"]["metres"], 0.001);
  EXPECT_EQ(about()["source"]["comments"], Json::array({"Author: A. Smith", "unit: cm"}));
  EXPECT_TRUE(follows_schema(about(), "about.v2"));
  const CommandResult verified = run_command({TEXMESH_BINARY, "verify", folder_ / "tent.texmesh"});
  EXPECT_EQ(verified.exit_code, 0) << verified.output;
  const CommandResult summary = run_command({TEXMESH_BINARY, "dump", folder_ / "tent.texmesh"});
  EXPECT_TRUE(
      summary.output.starts_with("Tent\nby        A. Smith\nlicence   CC0-1.0\nunit      mm, 0.001 m"))
      << summary.output;
}

TEST_F(CompileAbout, OtherWordsMakeNoMeshAnewAndDiffNamesThem) {
  ASSERT_EQ(compile({"--meta", meta(R"({"licence":"CC0-1.0"})")}, "a.texmesh").exit_code, 0);
  std::set<std::string> ran;
  const CommandResult second =
      compile({"--json", "--meta", meta(R"({"licence":"MIT","extras":{"room":4}})")}, "b.texmesh");
  for (const Json& e : events_of(second.output))
    if (e["event"] == "stage-finished" && e["result"] == "ran") ran.insert(e["stage"].get<std::string>());
  EXPECT_EQ(ran, std::set<std::string>{"package"});
  const CommandResult diff =
      run_command({TEXMESH_BINARY, "diff", folder_ / "a.texmesh", folder_ / "b.texmesh", "--json"});
  const Json recorded = Json::parse(diff.output)["recorded"];
  EXPECT_TRUE(follows_schema(Json::parse(diff.output), "diff.v1"));
  std::set<std::string> names;
  for (const Json& d : recorded) {
    EXPECT_EQ(d["kind"], "about") << d;
    names.insert(d["name"].get<std::string>());
  }
  EXPECT_EQ(names, (std::set<std::string>{"extras", "licence", "licence at"}));
}

TEST_F(CompileAbout, AFileThatIsHandedOutSaysWhoseItIs) {
  ASSERT_EQ(compile({"--meta", meta(R"({"attribution":"Museum","licence":"CC-BY-4.0"})")}).exit_code, 0);
  ASSERT_EQ(run_command({TEXMESH_BINARY, "extract", folder_ / "tent.texmesh", "-o", folder_ / "tent.glb"})
                .exit_code,
            0);
  const std::string glb = read_text(folder_ / "tent.glb");
  BytesIn in({reinterpret_cast<const std::uint8_t*>(glb.data()), glb.size()}, "glb");
  in.raw(12);
  const std::uint32_t json_bytes = in.u32();
  in.raw(4);
  const Json root = Json::parse(in.text(json_bytes));
  EXPECT_EQ(root["asset"]["copyright"], "Museum. Licence: CC-BY-4.0");
  EXPECT_EQ(root["asset"]["extensions"]["KHR_xmp_json_ld"]["packet"], 0);
  // The file is a source as good as the first.
  ASSERT_EQ(run_command({TEXMESH_BINARY, "compile", folder_ / "tent.glb", "-o", folder_ / "again.texmesh",
                         "--cache", folder_ / "cache", "--profile", folder_ / "profile.json"})
                .exit_code,
            0);
  EXPECT_EQ(about("again.texmesh")["licence"], "CC-BY-4.0");
  EXPECT_EQ(about("again.texmesh")["attribution"], "Museum");
  EXPECT_EQ(about("again.texmesh")["creator"], "A. Smith");
}

}  // namespace texmesh::testing::command_compile_about_test
