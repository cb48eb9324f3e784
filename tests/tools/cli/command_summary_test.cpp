// A collection in shards, as an engine runs it: list, compile --shard, summary merge; and the sandbox around
// the models.
#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "tests/support/command.h"
#include "tests/support/schema.h"
#include "tests/support/small_builds.h"

namespace texmesh::testing::command_summary_test {
namespace fs = std::filesystem;
using Json = nlohmann::json;

class Fleet : public ::testing::Test {
 protected:
  void SetUp() override {
    write_text(folder_ / "profile.json", kCheapProfile);
    ASSERT_NO_FATAL_FAILURE(make_tiny_models(TEXMESH_MAKE_SCAN, 4, folder_ / "in"));
  }
  CommandResult compile(const std::vector<std::string>& more, const std::string& out = "out",
                        const std::vector<std::string>& environment = {}) const {
    std::vector<std::string> all{
        TEXMESH_BINARY, "compile",        "in",  "-o", out, "--cache", out + "-cache", "--profile",
        "profile.json", "--proxies.mode", "none"};
    all.insert(all.end(), more.begin(), more.end());
    return run_command(all, environment, folder_.path().string());
  }
  CommandResult texmesh(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), TEXMESH_BINARY);
    return run_command(arguments, {}, folder_.path().string());
  }
  TemporaryFolder folder_;
};

TEST_F(Fleet, ShardsOfAnArrayMakeOneReport) {
  write_text(folder_ / "in/scan_00001.glb", "broken");
  std::vector<std::string> merge{"summary", "merge"};
  for (const char* task : {"0", "1", "2"}) {
    const CommandResult r =
        compile({"--shard", "auto", "--summary", std::string(task) + ".json"}, "out",
                {std::string("SLURM_ARRAY_TASK_ID=") + task, "SLURM_ARRAY_TASK_COUNT=3",
                 "SLURM_ARRAY_TASK_MIN=0", "SLURM_ARRAY_TASK_MAX=2", "SLURM_ARRAY_TASK_STEP=1"});
    EXPECT_TRUE(r.exit_code == 0 || r.exit_code == 1) << r.output << r.errors;
    EXPECT_NE(r.output.find(std::string("shard ") + task + " of 3: "), std::string::npos) << r.output;
    merge.push_back(std::string(task) + ".json");
  }
  const Json listed = Json::parse(texmesh({"list", "in", "-o", "out", "--shards", "3", "--json"}).output);
  EXPECT_TRUE(follows_schema(listed, "list.v1"));
  EXPECT_EQ(listed["models"].size(), 4u);
  EXPECT_EQ(listed["collection"], Json::parse(read_text(folder_ / "0.json"))["collection"]);
  merge.insert(merge.end(), {"-o", "all.json", "--junit", "all.xml", "--html", "page/all.html"});
  fs::create_directories(folder_ / "page");
  const CommandResult merged = texmesh(merge);
  EXPECT_EQ(merged.exit_code, 1) << "a broken model" << merged.output << merged.errors;
  const Json summary = Json::parse(read_text(folder_ / "all.json"));
  EXPECT_TRUE(follows_schema(summary, "summary.v1"));
  EXPECT_EQ(summary["compiled"], 3);
  EXPECT_EQ(summary["failed"], 1);
  EXPECT_FALSE(summary.contains("problems"));
  EXPECT_NE(read_text(folder_ / "all.xml").find("tests=\"4\" failures=\"1\""), std::string::npos);
  EXPECT_NE(read_text(folder_ / "page/all.html").find("1 without a new package"), std::string::npos);
  EXPECT_EQ(files_beneath(folder_ / "page/all-posters").size(), 3u);
  // A task's summary is lost, another one half-written.
  fs::resize_file(folder_ / "1.json", 100);
  const CommandResult torn = texmesh({"summary", "merge", "0.json", "1.json"});
  EXPECT_EQ(torn.exit_code, 75);
  EXPECT_NE(torn.errors.find("half-written: 1.json"), std::string::npos) << torn.errors;
  EXPECT_NE(torn.errors.find("no summary of shards 1-2 of 3"), std::string::npos) << torn.errors;
  // A run with nothing to do says what the models took when they were made, and the next array is split by
  // that.
  ASSERT_EQ(compile({"--summary", "again.json"}).exit_code, 1);
  const Json again = Json::parse(read_text(folder_ / "again.json"));
  for (const Json& m : again["models"])
    if (m["result"] == "unchanged") EXPECT_GT(m["made"]["seconds"], 0) << m;
  EXPECT_EQ(compile({"--shard", "0/2", "--costs", "again.json"}).exit_code |
                compile({"--shard", "1/2", "--costs", "again.json"}).exit_code,
            1);
  EXPECT_EQ(compile({"--shard", "0/2", "--costs", "profile.json"}).exit_code, 2);
  EXPECT_EQ(compile({"--shard", "0/2", "--costs", "1.json"}).exit_code, 2);
}

TEST_F(Fleet, AnEmptyShardSaysSo) {
  const CommandResult r = compile({"--shard", "7/9"});
  EXPECT_EQ(r.exit_code, 0) << r.errors;
  EXPECT_NE(r.output.find("shard 7 of 9: 0 of 4 models"), std::string::npos) << r.output;
}

TEST_F(Fleet, TheSandboxChangesNoByteAndSaysWhatHolds) {
  const CommandResult version = texmesh({"--version", "--verbose"});
  EXPECT_EQ(version.exit_code, 0);
  EXPECT_NE(version.output.find("sandbox: "), std::string::npos) << version.output;
  const bool complete = version.output.find("no bounds") == std::string::npos;
  ASSERT_EQ(compile({"--sandbox", "off"}, "off").exit_code, 0);
  const CommandResult bounded = compile({"--verbose"}, "auto");
  EXPECT_EQ(bounded.exit_code, 0) << bounded.output;
  EXPECT_NE(bounded.output.find(complete ? "sandbox: files" : "sandbox, degraded: "), std::string::npos)
      << bounded.output;
  EXPECT_TRUE(packages_in(folder_ / "auto") == packages_in(folder_ / "off"));
  // A library may have started a thread before the process bounds itself: then files are not bounded, and a
  // note says so.
  const bool held = complete && bounded.output.find("sandbox-degraded") == std::string::npos;
  const CommandResult required = compile({"--sandbox", "require"}, "required");
  EXPECT_EQ(required.exit_code, held ? 0 : complete ? 75 : 2) << required.output << required.errors;
  if (held) EXPECT_TRUE(packages_in(folder_ / "required") == packages_in(folder_ / "off"));
  EXPECT_EQ(compile({"--sandbox", "some"}).exit_code, 2);
}

}  // namespace texmesh::testing::command_summary_test
