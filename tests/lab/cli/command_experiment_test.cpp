// texmesh-lab experiment as a user runs it: folders, tables, profiles, exit codes.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/lab/experiment/simulated_results.h"
#include "tests/support/command.h"
#include "tests/support/packages.h"
#include "tests/support/schema.h"
#include "tests/support/small_builds.h"

namespace texmesh::testing::command_experiment_test {

using Json = nlohmann::json;

CommandResult experiment(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), {TEXMESH_LAB_BINARY, "experiment"});
  return run_command(arguments);
}

class ExperimentCommand : public ::testing::Test {
 protected:
  /// Files of so many judges of one threshold at 128 px.
  std::vector<std::string> judges(const ExperimentDesign& design, const SimulatedJudge& judge,
                                  std::size_t count) const {
    std::vector<std::string> out;
    for (std::size_t k = 0; k < count; ++k) {
      out.push_back(folder_ / ("judge-" + std::to_string(k) + ".json"));
      write_text(out.back(), results_json(simulated_results(design, judge, k)));
    }
    return out;
  }
  CommandResult fit(std::vector<std::string> files, const std::vector<std::string>& more = {}) const {
    files.insert(files.begin(), "fit");
    files.insert(files.end(), more.begin(), more.end());
    files.insert(files.end(), {"--draws", "60"});
    return experiment(files);
  }
  TemporaryFolder folder_;
};

TEST_F(ExperimentCommand, MakesAFolderThatItsSchemaDescribes) {
  const CommandResult r = experiment({"make", "--stimuli", "ellipsoids", "--sizes", "20,40", "--views", "1",
                                      "--objects", "1", "--repeats", "1", "-o", folder_ / "e", "--json"});
  ASSERT_EQ(r.exit_code, 0) << r.errors;
  const Json said = Json::parse(r.output), design = Json::parse(read_text(folder_ / "e/design.json"));
  EXPECT_TRUE(follows_schema(design, "experiment-design.v1"));
  EXPECT_EQ(said["design"], design["id"]);
  EXPECT_EQ(said["trials"], 2 * (8 + 6));
  for (const char* file :
       {"index.html", "experiment.js", "experiment.css", "trial.js", "display.js", "results.js"})
    EXPECT_TRUE(std::filesystem::exists((folder_ / "e/") + file)) << file;
  EXPECT_EQ(experiment({"make", "--stimuli", "ellipsoids", "-o", folder_ / "e"}).exit_code,
            1);  // never replaced
}

TEST_F(ExperimentCommand, JudgesMoveUntilAlike) {
  ASSERT_EQ(experiment({"make", "--move", "--stimuli", "quadrics", "--sizes", "64", "--views", "1",
                        "--objects", "1", "--repeats", "1", "-o", folder_ / "e"})
                .exit_code,
            0);
  EXPECT_TRUE(follows_schema(Json::parse(read_text(folder_ / "e/design.json")), "experiment-design.v1"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "e/move.js"));
  SimulatedJudge judge;
  judge.exponent = 1;
  const std::vector<std::string> files = judges(simulated_moves(320, 8), judge, 3);
  EXPECT_TRUE(follows_schema(Json::parse(read_text(files[0])), "experiment-results.v1"));
  const CommandResult r = fit(files, {"--json", "-o", folder_ / "p.json"});
  ASSERT_EQ(r.exit_code, 0) << r.errors << r.output;
  const Json document = Json::parse(r.output);
  EXPECT_TRUE(follows_schema(document, "experiment-fit.v1"));
  EXPECT_EQ(document["matches"].size(), 7u);
  EXPECT_TRUE(follows_schema(Json::parse(read_text(folder_ / "p.json")), "jnd-profile.v1"));
}

TEST_F(ExperimentCommand, UsageErrorsNameTheOption) {
  const auto said = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "make");
    arguments.insert(arguments.end(), {"-o", folder_ / "e"});
    const CommandResult r = experiment(arguments);
    EXPECT_EQ(r.exit_code, 2) << r.errors;
    EXPECT_FALSE(std::filesystem::exists(folder_ / "e"));
    return r.errors;
  };
  const std::string q = "--stimuli=quadrics";
  EXPECT_NE(said({}).find("--stimuli"), std::string::npos);
  EXPECT_NE(said({"--stimuli", "mesh"}).find("PKG"), std::string::npos);
  EXPECT_NE(said({"x.texmesh", q}).find("--stimuli"), std::string::npos);
  EXPECT_NE(said({q, "--levels", "0.1,0.05,0.2"}).find("--levels"), std::string::npos);
  EXPECT_NE(said({q, "--levels", "0.1,nan,0.2"}).find("--levels"), std::string::npos);
  EXPECT_NE(said({q, "--levels", "0.1,0.2"}).find("3 to 20 numbers"), std::string::npos);
  EXPECT_NE(said({q, "--levels", "0.1,0.2,0.9"}).find("--levels"), std::string::npos);
  EXPECT_NE(said({q, "--sizes", "3"}).find("--sizes"), std::string::npos);
  EXPECT_NE(said({q, "--move", "--sizes", "64,128"}).find("one size with --move"), std::string::npos);
  EXPECT_NE(said({q, "--sizes", "2000", "--views", "20"}).find("--views"), std::string::npos);
  EXPECT_NE(said({q, "--post", "javascript:alert(1)"}).find("--post"), std::string::npos);
  EXPECT_NE(said({q, "--post", "https://a.b/ 'unsafe-inline'"}).find("--post"), std::string::npos);
  EXPECT_NE(said({q, "--post", "https://a.b;script-src *"}).find("--post"), std::string::npos);
  EXPECT_NE(said({q, "--repeats", "60", "--sizes", "20,30,40,50,60,70", "--levels",
                  "0.01,0.02,0.03,0.04,0.05,0.06,0.07,0.08,0.09,0.1,0.11,0.12,0.13,0.14,0.15"})
                .find("--repeats"),
            std::string::npos);
}

TEST_F(ExperimentCommand, ScalesOfAPackage) {
  write_text(folder_ / "cheap.json", kCheapProfile);
  ASSERT_EQ(
      run_command({TEXMESH_MAKE_SCAN, "-o", folder_ / "scan.glb", "--triangles", "3000", "--texture", "128"})
          .exit_code,
      0);
  const CommandResult compiled =
      run_command({TEXMESH_BINARY, "compile", folder_ / "scan.glb", "-o", folder_ / "scan.texmesh",
                   "--no-cache", "--quiet", "--profile", folder_ / "cheap.json", "--ssf.scales", "20",
                   "--perceptual_values.kept_scales", "12"});
  ASSERT_EQ(compiled.exit_code, 0) << compiled.errors;
  const CommandResult r = experiment({"make", folder_ / "scan.texmesh", "--sizes", "32", "--views", "2",
                                      "--repeats", "2", "-o", folder_ / "e", "--json"});
  ASSERT_EQ(r.exit_code, 0) << r.errors;
  const Json said = Json::parse(r.output);
  EXPECT_EQ(said["kind"], "mesh");
  EXPECT_GE(said["levels"].size(), 3u);
  EXPECT_TRUE(follows_schema(Json::parse(read_text(folder_ / "e/design.json")), "experiment-design.v1"));
  EXPECT_EQ(experiment({"make", folder_ / "scan.texmesh", "--levels", "0.1,0.2,0.3", "-o", folder_ / "f"})
                .exit_code,
            2);
  EXPECT_EQ(experiment({"make", folder_ / "none.texmesh", "-o", folder_ / "f"}).exit_code, 1);
}

TEST_F(ExperimentCommand, FitsAndWritesTheProfile) {
  const std::vector<std::string> files = judges(simulated_design({64, 128}, 16), {}, 5);
  const CommandResult text = fit(files, {"-o", folder_ / "p.json", "--page", folder_ / "fit.html"});
  ASSERT_EQ(text.exit_code, 0) << text.errors;
  EXPECT_NE(text.output.find("75 % of the answers are right at a change of 0."), std::string::npos)
      << text.output;
  EXPECT_TRUE(follows_schema(Json::parse(read_text(folder_ / "p.json")), "jnd-profile.v1"));
  EXPECT_NE(read_text(folder_ / "fit.html").find("<svg"), std::string::npos);
  const CommandResult json = fit(files, {"--json"});
  const Json document = Json::parse(json.output);
  EXPECT_TRUE(follows_schema(document, "experiment-fit.v1"));
  EXPECT_NEAR(document["jnd"]["value"].get<double>(), 0.1, 0.02);
  EXPECT_EQ(json.output, fit(files, {"--json", "--jobs", "1"}).output);
  for (const std::string& file : files)
    EXPECT_TRUE(follows_schema(Json::parse(read_text(file)), "experiment-results.v1"));
}

TEST_F(ExperimentCommand, ExitCodes) {
  const ExperimentDesign design = simulated_design({128}, 12);
  SimulatedJudge blind;
  blind.threshold = 0.6;
  const std::vector<std::string> outside = judges(design, blind, 3);
  EXPECT_EQ(fit(outside, {"-o", folder_ / "p.json"}).exit_code, 4);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "p.json"));

  const std::vector<std::string> good = judges(design, {}, 3);
  write_text(folder_ / "broken.json", "{\"version\":1,");
  std::vector<std::string> with_broken = good;
  with_broken.push_back(folder_ / "broken.json");
  const CommandResult refused = fit(with_broken);
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_NE(refused.errors.find("broken.json"), std::string::npos);
  const CommandResult skipped = fit(with_broken, {"--skip"});
  EXPECT_EQ(skipped.exit_code, 0) << skipped.errors;
  EXPECT_NE(skipped.errors.find("left out: "), std::string::npos);

  write_text(folder_ / "other.json", results_json(simulated_results(simulated_design({128}, 12, 5), {}, 9)));
  EXPECT_EQ(fit({good[0], folder_ / "other.json"}).exit_code, 1);
  write_text(folder_ / "three.json", results_json(simulated_results(design, {}, 9, 3)));
  const CommandResult three = fit({folder_ / "three.json"});
  EXPECT_EQ(three.exit_code, 1);
  EXPECT_NE(three.errors.find("3 answers"), std::string::npos) << three.errors;
  write_text(folder_ / "large.json", std::string(3u << 20, ' '));
  EXPECT_EQ(fit({folder_ / "large.json"}).exit_code, 1);
  EXPECT_EQ(fit({folder_ / "none.json"}).exit_code, 1);
  EXPECT_EQ(experiment({"fit"}).exit_code, 2);
  EXPECT_EQ(experiment({"fit", good[0], "--draws", "1"}).exit_code, 2);
  EXPECT_EQ(experiment({}).exit_code, 2);
}

TEST_F(ExperimentCommand, AProfileOutOfRangeIsAUsageErrorThatNamesTheField) {
  for (const auto& [field, profile] : std::vector<std::pair<std::string, std::string>>{
           {"/jnd", R"({"version":1,"jnd":7})"},
           {"/reference_px", R"({"version":1,"jnd":0.1,"reference_px":0})"},
           {"/distance_exponent", R"({"version":1,"jnd":0.1,"distance_exponent":-1})"}}) {
    write_text(folder_ / "p.json", profile);
    const CommandResult r = run_command({TEXMESH_BINARY, "compile", folder_ / "none.glb", "-o",
                                         folder_ / "x.texmesh", "--jnd-profile", folder_ / "p.json"});
    EXPECT_EQ(r.exit_code, 2);
    EXPECT_NE(r.errors.find("p.json: " + field + ": expected a number in"), std::string::npos) << r.errors;
  }
}

TEST_F(ExperimentCommand, AnswersAreComparedWithTheDesign) {
  ASSERT_EQ(experiment({"make", "--stimuli", "quadrics", "--sizes", "20", "--views", "1", "--objects", "1",
                        "-o", folder_ / "e"})
                .exit_code,
            0);
  const std::vector<std::string> files = judges(simulated_design({128}, 12), {}, 3);
  const CommandResult r = fit(files, {"--design", folder_ / "e"});
  EXPECT_EQ(r.exit_code, 1);
  EXPECT_NE(r.errors.find("the given design"), std::string::npos) << r.errors;
}

}  // namespace texmesh::testing::command_experiment_test
