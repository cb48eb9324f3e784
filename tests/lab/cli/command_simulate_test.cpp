// texmesh-lab simulate as a user runs it: chapter 4's experiments, every policy, test packets, several
// objects, lost packets.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/support/command.h"
#include "tests/support/schema.h"

namespace texmesh::testing::command_simulate_test {

using Json = nlohmann::json;
const std::string kGolden = std::string(TEXMESH_SOURCE_DIR) + "/tests/golden/v2.0-scan.texmesh";

CommandResult lab(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), TEXMESH_LAB_BINARY);
  return run_command(arguments);
}
/// What it prints, which follows the schema that its help names.
Json json_of(std::vector<std::string> arguments) {
  arguments.push_back("--json");
  const CommandResult r = lab(arguments);
  EXPECT_EQ(r.exit_code, 0) << r.errors;
  const Json document = Json::parse(r.output);
  EXPECT_TRUE(follows_schema(document, "lab-simulate.v1")) << r.output;
  return document;
}

TEST(LabSimulate, TheoremHoldsAsCorrected) {
  const Json theorem = json_of({"simulate", "--theorem"});
  EXPECT_LE(theorem["identity_error"].get<double>(), 1e-9);
  EXPECT_EQ(theorem["corrected_bound_broken"], 0);
  ASSERT_EQ(theorem["rows"].size(), 1000u);
  for (const Json& r : theorem["rows"]) {
    const double surplus_s = r["surplus_s"], bound_s = r["corrected_bound_s"];
    ASSERT_LE(std::abs(surplus_s), bound_s * (1 + 1e-9) + 1e-8);
    ASSERT_NEAR(surplus_s, r["last_residual_s"].get<double>(), 1e-8);
  }
  for (const char* column : {"dT_n [s]", "corrected bound [s]", "published [s]"})
    EXPECT_NE(lab({"simulate", "--theorem", "--seeds", "1"}).output.find(column), std::string::npos);
}

TEST(LabSimulate, OneFormOfOutputAndOneThingToPlay) {
  for (const std::vector<std::string>& both :
       {std::vector<std::string>{"--json", "--csv"}, {kGolden, "--theorem"}}) {
    std::vector<std::string> arguments{"simulate", "--bandwidth", "1MB/s"};
    arguments.insert(arguments.end(), both.begin(), both.end());
    EXPECT_EQ(lab(arguments).exit_code, 2) << both[0];
  }
  const CommandResult csv = lab({"simulate", "--theorem", "--seeds", "1", "--csv"});
  EXPECT_EQ(csv.output.rfind("run,surplus_s,", 0), 0u);
  EXPECT_EQ(std::count(csv.output.begin(), csv.output.end(), '\n'), 51);
}

TEST(LabSimulate, APackageIsPlayedByEveryPolicy) {
  for (const char* policy : {"htca", "guard", "price", "proportional", "static"}) {
    const auto played = [&](const char* bandwidth) {
      return json_of(
          {"simulate", kGolden, "--time", "3", "--bandwidth", bandwidth, "--rtt", "10", "--policy", policy});
    };
    const Json r = played("40kB/s");
    EXPECT_EQ(r["late_s"].get<double>() > 0.3, false) << policy << r;
    EXPECT_LT(r["texture_flip"].get<double>(), played("5kB/s")["texture_flip"].get<double>()) << policy;
    EXPECT_GE(r["flip"].get<double>(), r["texture_flip"].get<double>()) << policy;
  }
}

TEST(LabSimulate, DecisionsAreLinesAndPartsOfThePolicyMayBeOthers) {
  const CommandResult csv = lab({"simulate", kGolden, "--time", "3", "--bandwidth", "40kB/s", "--csv"});
  EXPECT_EQ(csv.exit_code, 0) << csv.errors;
  EXPECT_EQ(csv.output.rfind("position,plane,fragment,rung,", 0), 0u);
  for (const std::vector<std::string>& more :
       {std::vector<std::string>{"--policy", "thesis", "--order", "credit"},
        {"--estimator", "ewma", "--beta0", "10kB/s"},
        {"--estimator", "harmonic", "--samples", "3", "--window", "2"},
        {"--hard-limits", "--slow-start", "--connect-costs", "--loss", "0.01", "--seed", "7"}}) {
    std::vector<std::string> arguments{"simulate",    kGolden,  "--time", "3",
                                       "--bandwidth", "40kB/s", "--rtt",  "20"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    json_of(arguments);
  }
  EXPECT_EQ(lab({"simulate", kGolden, "--bandwidth", "1MB/s", "--loss", "nan"}).exit_code, 2);
  EXPECT_EQ(lab({"simulate", kGolden, "--bandwidth", "1MB/s", "--beta0", "0"}).exit_code, 2);
}

TEST(LabSimulate, ServersDieAndLie) {
  const auto with = [](std::vector<std::string> mirrors) {
    std::vector<std::string> arguments{"simulate", kGolden, "--time", "3", "--bandwidth", "1MB/s"};
    for (const std::string& m : mirrors) arguments.insert(arguments.end(), {"--mirror", m});
    return json_of(arguments);
  };
  EXPECT_TRUE(with({"40kB/s,dead=0s"})["complete_s"].is_null());
  EXPECT_FALSE(with({"40kB/s,dead=0s", "40kB/s"})["complete_s"].is_null());
  const Json lied = with({"40kB/s,lies=0s", "40kB/s"});
  EXPECT_EQ(lied["servers"][0]["dropped"], "bytes of another digest");
  EXPECT_EQ(lab({"simulate", kGolden, "--bandwidth", "1MB/s", "--mirror", "1MB/s,sleeps=2s"}).exit_code, 2);
}

TEST(LabSimulate, TestPacketsMeasureTheLink) {
  const std::vector<std::string> base{"simulate",    kGolden,  "--time",    "6",
                                      "--bandwidth", "40kB/s", "--display", "800"};
  std::vector<std::string> probed = base;
  probed.insert(probed.end(), {"--probe", "fixed", "--probe-size", "2kB"});
  const Json r = json_of(probed);
  ASSERT_TRUE(r.contains("probes"));
  EXPECT_LT(r["probes"]["mean_error"], 0.5);
  EXPECT_FALSE(json_of(base).contains("probes"));
  std::vector<std::string> beside = probed;
  beside.insert(beside.end(), {"--beside", kGolden});
  EXPECT_EQ(lab(beside).exit_code, 2);
}

TEST(LabSimulate, ObjectsShareALink) {
  const std::vector<std::string> base{"simulate",    kGolden,   "--time",    "4",
                                      "--bandwidth", "100kB/s", "--display", "400"};
  std::vector<std::string> page = base;
  page.insert(page.end(), {"--beside", kGolden + ",200"});
  const Json j = json_of(page);
  ASSERT_EQ(j["objects"].size(), 2u);
  EXPECT_EQ(j["objects"][0]["display_px"], 400);
  EXPECT_EQ(j["objects"][1]["display_px"], 200);
  EXPECT_NE(lab(page).output.find("by itself"), std::string::npos);
  for (const char* bad : {",0", ",1e9"}) {
    std::vector<std::string> wrong = base;
    wrong.insert(wrong.end(), {"--beside", kGolden + bad});
    EXPECT_EQ(lab(wrong).exit_code, 2) << bad;
  }
}

TEST(LabSimulate, LostPacketsCostPointsAndFragments) {
  TemporaryFolder folder;
  std::vector<std::string> arguments{"simulate", kGolden, "--time", "9",   "--bandwidth", "1MB/s",
                                     "--scale",  "0",     "--loss", "0.4", "--no-repeat"};
  const Json j = json_of(arguments);
  ASSERT_EQ(j["rows"].size(), 4u);
  EXPECT_EQ(j["rows"][0]["lost_points"], 0);
  EXPECT_GT(j["rows"][3]["lost_points"], 0);  // few packets hold the golden package's 384 points
  arguments.insert(arguments.end(), {"--picture", folder / "lost.png"});
  const CommandResult text = lab(arguments);
  EXPECT_EQ(text.exit_code, 0) << text.errors;
  EXPECT_NE(text.output.find("HTTP loses none"), std::string::npos);
  EXPECT_EQ(read_text(folder / "lost.png").substr(1, 3), "PNG");
  arguments.back() = folder / "no/lost.png";
  EXPECT_EQ(lab(arguments).exit_code, 1);
  EXPECT_EQ(lab({"simulate", kGolden, "--bandwidth", "1MB/s", "--no-repeat"}).exit_code, 2) << "no loss";
}

TEST(Lab, ShellsKnowItsCommands) {
  const CommandResult bash = lab({"completion", "bash"});
  EXPECT_EQ(bash.exit_code, 0);
  EXPECT_NE(bash.output.find("complete -o default -F _texmesh_lab texmesh-lab"), std::string::npos);
  EXPECT_NE(lab({"completion", "man"}).output.find(".TH TEXMESH-LAB"), std::string::npos);
  EXPECT_NE(lab({"--help"}).output.find("experiment"), std::string::npos);
}

}  // namespace texmesh::testing::command_simulate_test
