// texmesh-lab study as a user runs it: tables, CSV, JSON, pictures, exit codes.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/support/command.h"
#include "tests/support/images.h"

namespace texmesh::testing::command_study_test {

using Json = nlohmann::json;

CommandResult texmesh(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), TEXMESH_LAB_BINARY);
  return run_command(arguments);
}

struct StudyCommand : ::testing::Test {
  std::string image(const std::string& name, int channels) {
    const auto bytes = png_bytes(160, 96, channels);
    write_text(folder / name, std::string(bytes.begin(), bytes.end()));
    return folder / name;
  }
  TemporaryFolder folder;
};

TEST_F(StudyCommand, FragmentsAsTableCsvAndJson) {
  const std::string rgba = image("with, alpha.png", 4), grey = image("grey.png", 1);
  const CommandResult text = texmesh({"study", "fragments", rgba, grey, "--grids", "1,2,4", "--qualities",
                                      "20,80", "--csv", folder / "x.csv"});
  ASSERT_EQ(text.exit_code, 0) << text.errors;
  EXPECT_NE(text.output.find("160 x 96 px"), std::string::npos) << text.output;
  EXPECT_NE(text.output.find("4^2"), std::string::npos) << text.output;
  EXPECT_EQ(text.output.find("alpha channel"), text.output.rfind("alpha channel")) << "of one of the two";
  EXPECT_NE(text.output.find("alpha channel"), std::string::npos) << text.output;
  EXPECT_NE(text.output.find("4x3"), std::string::npos) << "48 px in rows of 32 px: " << text.output;
  const CommandResult machine =
      texmesh({"study", "fragments", rgba, grey, "--grids", "1,2,4", "--qualities", "20,80", "--json"});
  ASSERT_EQ(machine.exit_code, 0) << machine.errors;
  const Json document = Json::parse(machine.output);
  ASSERT_EQ(document["fragments"].size(), 2u);
  EXPECT_EQ(document["fragments"][0].value("alpha_left_out", false), true);
  EXPECT_FALSE(document["fragments"][1].contains("alpha_left_out"));
  std::istringstream csv(read_text(folder / "x.csv"));
  std::string line;
  std::getline(csv, line);
  EXPECT_EQ(line.substr(0, 24), "image,width_px,height_px");
  for (const Json& studied : document["fragments"])
    for (const Json& row : studied["rows"]) {
      ASSERT_TRUE(std::getline(csv, line));
      const std::string end = "," + row["quality"].dump() + "," + row["file_standard"].dump() + "," +
                              row["file_optimised"].dump() + "," + row["sum_standard"].dump() + "," +
                              row["sum_optimised"].dump() + "," + row["sum_shared"].dump() + ",,";
      EXPECT_TRUE(line.ends_with(end)) << line << " " << end;
      EXPECT_LT(row["sum_shared"], row["sum_standard"].get<int>() + 700);
    }
  EXPECT_FALSE(std::getline(csv, line));
  EXPECT_EQ(read_text(folder / "x.csv").find("\"" + rgba + "\","),
            read_text(folder / "x.csv").find('\n') + 1);
}

TEST_F(StudyCommand, ThesisAsTextJsonAndPage) {
  const CommandResult text = texmesh({"study", "thesis", "--table", "4.1"});
  ASSERT_EQ(text.exit_code, 0) << text.errors;
  EXPECT_NE(text.output.find("41.68"), std::string::npos);
  EXPECT_EQ(text.output.find("Table 4.2"), std::string::npos);
  const std::string page = folder / "page";
  const CommandResult made = texmesh({"study", "thesis", "--table", "4.1,fig-8.3", "--json", "-o", page});
  ASSERT_EQ(made.exit_code, 0) << made.errors;
  EXPECT_EQ(Json::parse(made.output)["exhibits"].size(), 2u);
  const std::string first = read_text(page + "/index.html");
  EXPECT_NE(first.find("fig-8-3.png"), std::string::npos);
  EXPECT_EQ(texmesh({"study", "thesis", "--table", "4.1,fig-8.3", "-j", "4", "-o", page}).exit_code, 0);
  EXPECT_EQ(read_text(page + "/index.html"), first);
  EXPECT_EQ(texmesh({"study", "thesis", "--table", "9.9"}).exit_code, 2);
  const std::string strange = folder / "strange";
  std::filesystem::create_directory(strange);
  write_text(strange + "/letter.txt", "keep me");
  EXPECT_EQ(texmesh({"study", "thesis", "--table", "4.1", "-o", strange}).exit_code, 1);
  EXPECT_EQ(read_text(strange + "/letter.txt"), "keep me");
}

TEST_F(StudyCommand, QualityOfAModel) {
  const std::string scan = folder / "scan.glb", png = folder / "x.png";
  ASSERT_EQ(run_command({TEXMESH_MAKE_SCAN, "--triangles", "1500", "--texture", "512", "-o", scan}).exit_code,
            0);
  const CommandResult r = texmesh({"study", "quality", scan, "-o", png, "--size", "64", "--views", "2",
                                   "--quality", "30", "--json", "--cache", folder / "cache"});
  ASSERT_EQ(r.exit_code, 0) << r.errors;
  const Json choices = Json::parse(r.output)["quality"];
  ASSERT_EQ(choices.size(), 4u);
  const Json& uniform = choices[0];
  EXPECT_EQ(uniform["choice"], "uniform");
  EXPECT_EQ(uniform["lowest_quality"], 30);
  EXPECT_EQ(uniform["highest_quality"], 30);
  for (const Json& c : choices) {
    EXPECT_LE(c["bytes"], uniform["bytes"]);
    EXPECT_GE(c["bytes"].get<double>(), 0.97 * uniform["bytes"].get<double>()) << c["choice"];
    EXPECT_GT(c["rendered_ssim"], 0.3);
    EXPECT_LE(c["rendered_ssim"], 1);
    EXPECT_GE(c["rendered_difference"], 0);
  }
  EXPECT_GE(choices[3]["surface_ssim"].get<double>(), uniform["surface_ssim"].get<double>() - 1e-6);
  const std::string picture = read_text(png);
  ASSERT_GT(picture.size(), 24u);
  EXPECT_EQ(picture.substr(1, 3), "PNG");
  EXPECT_EQ(static_cast<unsigned char>(picture[18]) * 256 + static_cast<unsigned char>(picture[19]), 5 * 64);

  const CommandResult again = texmesh({"study", "quality", scan, "--size", "64", "--views", "2", "--quality",
                                       "30", "--json", "--no-cache", "-j", "1"});
  EXPECT_EQ(again.output, r.output);  // the same on one thread
}

TEST_F(StudyCommand, PredictionOfAPlanThatIsAProxy) {
  const std::string package = std::string(TEXMESH_SOURCE_DIR) + "/tests/golden/v2.0-proxies.texmesh";
  const std::vector<std::string> study{"study",     "prediction", package,   "--budget", "50kB",
                                       "--display", "128",        "--views", "1"};
  const CommandResult text = texmesh(study);
  EXPECT_EQ(text.exit_code, 0) << text.errors;
  EXPECT_NE(text.output.find("proxy 1"), std::string::npos) << text.output;
  std::vector<std::string> as_json = study;
  as_json.push_back("--json");
  const Json row = Json::parse(texmesh(as_json).output)["plans"][0];
  EXPECT_EQ(row["proxy"], 1);
  EXPECT_GT(row["rendered"], 0);
}

TEST_F(StudyCommand, RungsThatLoadsChoose) {
  const std::string scan = folder / "scan.glb", package = folder / "scan.texmesh";
  ASSERT_EQ(
      run_command({TEXMESH_MAKE_SCAN, "--triangles", "1500", "--texture", "1024", "-o", scan}).exit_code, 0);
  ASSERT_EQ(run_command({TEXMESH_BINARY, "compile", scan, "-o", package, "--no-cache"}).exit_code, 0);
  const CommandResult r = texmesh({"study", "rungs", package, "--json"});
  ASSERT_EQ(r.exit_code, 0) << r.errors;
  const Json use = Json::parse(r.output)["packages"][0];
  EXPECT_EQ(use["loads"], 1000);
  std::size_t shown = 0, rungs = 0, rare = 0;
  for (const Json& plane : use["planes"]) {
    shown += plane["shown"].get<std::size_t>();
    ASSERT_EQ(plane["chosen"].size(), plane["rung_quality"].size());
    for (std::size_t k = 0; k < plane["chosen"].size(); ++k) {
      const auto chosen = plane["chosen"][k].get<std::size_t>();
      EXPECT_LE(chosen, plane["shown"].get<std::size_t>());
      ++rungs;
      const bool is_source = k + 1 == plane["chosen"].size() && plane["mip"] == 0;
      rare += chosen < 10 && plane["chosen"].size() > 1 && !is_source;
    }
  }
  EXPECT_EQ(shown % 1000, 0u) << "every load shows each texture at one size";
  EXPECT_GT(shown, 0u);
  EXPECT_EQ(use["rungs"], rungs);
  EXPECT_EQ(use["rare_rungs"], rare);
  EXPECT_EQ(rare, 0u) << "the ladder stores what a hundredth of the loads choose";
  EXPECT_GT(use["mean_flip"], 0);
  EXPECT_LT(use["mean_flip"], 0.5);
  const CommandResult text = texmesh({"study", "rungs", package});
  EXPECT_NE(text.output.find(std::to_string(rare) + " of " + std::to_string(rungs) + " rungs"),
            std::string::npos)
      << text.output;
}

TEST_F(StudyCommand, OutputsThatCannotBeWrittenAreToldBeforeTheStudy) {
  const std::string grey = image("grey.png", 1), scan = folder / "none.glb";
  for (const auto& arguments :
       {std::vector<std::string>{"study", "fragments", grey, "--csv", folder / "no/x.csv"},
        {"study", "quality", scan, "-o", folder / "no/x.png"}}) {
    const CommandResult result = texmesh(arguments);
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_TRUE(result.output.empty()) << result.output;
    EXPECT_NE(result.errors.find(": cannot be written: "), std::string::npos) << result.errors;
  }
}

TEST_F(StudyCommand, WhatCannotBeStudied) {
  EXPECT_EQ(texmesh({"study"}).exit_code, 2);
  EXPECT_EQ(texmesh({"study", "fragments"}).exit_code, 2);
  EXPECT_EQ(texmesh({"study", "rungs"}).exit_code, 2);
  EXPECT_EQ(texmesh({"study", "rungs", folder / "none.texmesh"}).exit_code, 1);
  EXPECT_EQ(texmesh({"study", "rungs", folder / "none.texmesh", "--loads", "0"}).exit_code, 2);
  const std::string good = image("good.png", 3);
  EXPECT_EQ(texmesh({"study", "fragments", good, "--qualities", "50,50"}).exit_code, 2);
  EXPECT_EQ(texmesh({"study", "fragments", good, "--qualities", "0"}).exit_code, 2);
  EXPECT_EQ(texmesh({"study", "fragments", good, "--grids", "65"}).exit_code, 2);
  EXPECT_EQ(texmesh({"study", "quality", good, "-o", folder / "x.jpg"}).exit_code, 2);
  EXPECT_EQ(texmesh({"study", "quality", good, "--view", "6"}).exit_code, 2);
  EXPECT_EQ(texmesh({"study", "fragments", folder / "none.png"}).exit_code, 1);
  write_text(folder / "bad.png", read_text(good).substr(0, 200));
  const CommandResult bad = texmesh({"study", "fragments", folder / "bad.png"});
  EXPECT_EQ(bad.exit_code, 1);
  EXPECT_NE(bad.errors.find("bad.png"), std::string::npos) << bad.errors;
  write_text(folder / "plain.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const CommandResult plain = texmesh({"study", "quality", folder / "plain.obj", "--no-cache"});
  EXPECT_EQ(plain.exit_code, 1);
  EXPECT_NE(plain.errors.find("texture"), std::string::npos) << plain.errors;
  EXPECT_EQ(texmesh({"study", "quality", "--help"}).output.find("Fig. 3.9") != std::string::npos, true);
}

TEST_F(StudyCommand, TheThesisStandsBesideTheDefaultsInOneTable) {
  const std::string package = std::string(TEXMESH_SOURCE_DIR) + "/tests/golden/v2.0-scan.texmesh";
  const CommandResult r = texmesh({"study", "method", package, "--display", "100", "--views", "1", "--json"});
  ASSERT_EQ(r.exit_code, 0) << r.errors;
  const Json study = Json::parse(r.output)["method"];
  ASSERT_EQ(study.size(), 2u);
  EXPECT_EQ(study[0]["system"], "texmesh");
  EXPECT_EQ(study[1]["system"], "thesis");
  for (const Json& system : study) {
    ASSERT_EQ(system["rows"].size(), 1u);
    EXPECT_GT(system["rows"][0]["bytes"], 0);
    EXPECT_EQ(system["steps"].back()["scale"], 0);
  }
  // As printed, the scale goes by the distance, of which 1 is 1,024 px.
  const Json& steps = study[1]["steps"];
  ASSERT_GE(steps.size(), 2u);
  EXPECT_LE(steps[steps.size() - 2]["up_to_px"], 1024);
  EXPECT_EQ(texmesh({"study", "method", "scan.glb", "--thesis", package}).exit_code, 2);
}

}  // namespace texmesh::testing::command_study_test
