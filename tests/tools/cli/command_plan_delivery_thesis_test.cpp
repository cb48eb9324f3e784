// --profile thesis and --policy thesis: compiled, planned, checked and fetched as programs.
#include <gtest/gtest.h>
#include <httplib.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numeric>
#include <thread>

#include "tests/support/command.h"
#include "tests/support/schema.h"

namespace texmesh::testing::command_plan_delivery_thesis_test {

using Json = nlohmann::json;

CommandResult texmesh(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), TEXMESH_BINARY);
  return run_command(arguments);
}
Json json_of(std::vector<std::string> arguments) {
  arguments.push_back("--json");
  const CommandResult r = texmesh(arguments);
  EXPECT_EQ(r.exit_code, 0) << r.errors;
  return Json::parse(r.output);
}

struct ThesisProfile : ::testing::Test {
  static void SetUpTestSuite() {
    folder = new TemporaryFolder;
    scan = *folder / "scan.glb";
    package = *folder / "scan.texmesh";
    ASSERT_EQ(run_command(
                  {TEXMESH_MAKE_SCAN, "--triangles", "2500", "--texture", "512", "--charts", "8", "-o", scan})
                  .exit_code,
              0);
    const CommandResult r = texmesh({"compile", scan, "-o", package, "--profile", "thesis", "--no-cache",
                                     "--quiet", "--quality.views", "1", "--quality.largest_px", "128"});
    ASSERT_EQ(r.exit_code, 0) << r.errors;
  }
  static void TearDownTestSuite() { delete folder; }
  static inline TemporaryFolder* folder = nullptr;
  static inline std::string scan, package;
};

TEST_F(ThesisProfile, MakesThePackageOfChapters2To8) {
  EXPECT_EQ(texmesh({"verify", package}).exit_code, 0);
  const Json provenance = json_of({"dump", package, "provenance"});
  const std::string text = provenance.dump();
  for (const char* option :
       {"\"order\":\"thesis\"", "\"signal\":\"radius\"", "\"allocate\":\"vqp\"", "\"chain\":\"survivor\"",
        "\"default_quality\":\"features\"", "\"statistic\":\"average\""})
    EXPECT_NE(text.find(option), std::string::npos) << option;
  const Json scales = json_of({"dump", package, "scales"})["scales"];
  ASSERT_GE(scales.size(), 2u);
  for (std::size_t k = 1; k < scales.size(); ++k)
    EXPECT_TRUE(scales[k]["major"]) << "minor scales are not stored";
}

TEST_F(ThesisProfile, IsPlannedSimulatedAndCheckedByThePolicy) {
  const std::vector<std::string> request{package,  "--time",   "3",     "--bandwidth",
                                         "60kB/s", "--policy", "thesis"};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.end(), request.begin(), request.end());
    return more;
  };
  const Json plan = json_of(with({"plan"}));
  EXPECT_TRUE(follows_schema(plan, "plan.v1"));
  EXPECT_EQ(plan["skipped"], 0) << "limits are hard";
  for (const Json& plane : plan["planes"]) EXPECT_EQ(plane["plane"], plane["texture"]) << "1,000 px";
  const Json small = json_of(with({"plan", "--display", "100"}));
  for (const Json& plane : small["planes"]) EXPECT_NE(plane["plane"], plane["texture"]) << "8.1.1";
  const Json played = json_of(with({"simulate"}));
  EXPECT_TRUE(follows_schema(played, "simulate.v1"));
  EXPECT_EQ(json_of(with({"check", "--max-flip", "1"}))["scale"], plan["scale"]);
  EXPECT_EQ(texmesh(with({"plan", "--rule", "flip"})).exit_code, 0) << "the rule may be another";
}

TEST_F(ThesisProfile, TakesTheViewersOwnJnd) {
  const auto scale = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"plan", package, "--time", "30", "--bandwidth", "50Mbit/s", "--policy",
                               "thesis", "--rule", "flip", "--display", "2000"});
    return json_of(more)["scale"].get<int>();
  };
  const int printed = scale({}), keen = scale({"--jnd", "0.001"}), blind = scale({"--jnd", "1"});
  EXPECT_EQ(keen, printed);
  EXPECT_GT(blind, printed);
  const CommandResult none = texmesh({"plan", package, "--bandwidth", "1Mbit/s", "--jnd", "0"});
  EXPECT_NE(none.exit_code, 0);
  EXPECT_NE(none.errors.find("--jnd"), std::string::npos) << none.errors;
}

/// The thesis's own input: every vertex is a feature at S_0.
TEST(ThesisProfileOfARangeScan, WeighsFragmentsByTheDensityOfTheScale) {
  const TemporaryFolder folder;
  const std::string scan = folder / "scan.json", package = folder / "scan.texmesh";
  ASSERT_EQ(run_command({TEXMESH_MAKE_SCAN, "--range-scan", "--range-columns", "128", "--range-rows", "96",
                         "-o", scan})
                .exit_code,
            0);
  const CommandResult r = texmesh({"compile", scan, "-o", package, "--profile", "thesis", "--no-cache",
                                   "--quiet", "--quality.views", "1", "--quality.largest_px", "128",
                                   "--fragmentation.min_fragment_px", "32"});
  ASSERT_EQ(r.exit_code, 0) << r.errors;
  EXPECT_EQ(texmesh({"verify", package}).exit_code, 0);
  const Json fragments = json_of({"dump", package, "fragments"})["fragments"][0]["fragments"];
  const Json scales = json_of({"dump", package, "tables"})["tables"][0]["scales"];
  ASSERT_GE(scales.size(), 3u);
  ASSERT_EQ(fragments.size(), 12u);
  std::vector<double> texture;  // what VQP owes to the texture alone
  for (std::size_t row = 0; row < scales.size(); ++row) {
    std::vector<double> f, vqp;
    for (const Json& fragment : fragments) f.push_back(fragment["features"][row]);
    const auto [least, most] = std::ranges::minmax(f);
    EXPECT_EQ(most > 1.05 * least, row > 0) << least << " to " << most << " at " << scales[row]["scale"];
    for (std::size_t k = 0; k < 12; ++k) {
      const double eta = (f[k] - least) / (most - least);
      if (row == 0) texture.push_back(fragments[k]["vqp"].get<double>() - 0.25 * eta);
      vqp.push_back(texture[k] + 0.25 * eta);
    }
    const double gamma = std::accumulate(vqp.begin(), vqp.end(), 0.0) / 12;
    EXPECT_NEAR(scales[row]["gamma"].get<double>(), gamma, 1e-4);
    for (std::size_t k = 0; k < 12; ++k) {
      const double q = scales[row]["quality"].get<double>() + 60 * (vqp[k] - gamma);
      const std::size_t at = fragments[k]["fragment"];
      EXPECT_NEAR(scales[row]["fragment_quality"][at], std::clamp(q, 5.0, 97.0), 5e-3) << row << " " << k;
    }
  }
}

TEST_F(ThesisProfile, IsFetchedByThePolicy) {
  httplib::Server server;
  server.set_mount_point("/", std::filesystem::path(package).parent_path().string());
  const int port = server.bind_to_any_port("127.0.0.1");
  std::thread serving([&] { server.listen_after_bind(); });
  const std::string url = "http://127.0.0.1:" + std::to_string(port) + "/scan.texmesh";
  const Json fetched = json_of({"fetch", url, "--time", "4", "--policy", "thesis"});
  server.stop();
  serving.join();
  EXPECT_EQ(fetched["skipped"], 0);
  EXPECT_EQ(fetched["given_up"], 0);
  EXPECT_EQ(fetched["requests"], fetched["fragments"]) << "fragment by fragment";
}

TEST_F(ThesisProfile, NamesThatAreNotInstalledAreUsage) {
  const CommandResult r = texmesh({"compile", scan, "-o", *folder / "x.texmesh", "--profile", "museum"});
  EXPECT_EQ(r.exit_code, 2);
  EXPECT_NE(r.errors.find("thesis"), std::string::npos) << "says which there are: " << r.errors;
  EXPECT_EQ(texmesh({"plan", package, "--bandwidth", "1MB/s", "--policy", "printed"}).exit_code, 2);
}

}  // namespace texmesh::testing::command_plan_delivery_thesis_test
