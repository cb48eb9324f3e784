// texmesh extract as a program, on the golden package.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "stages/gltf/check_glb.h"
#include "tests/support/command.h"

namespace texmesh::testing::command_extract_test {

using Json = nlohmann::json;
const std::string kGolden = std::string(TEXMESH_SOURCE_DIR) + "/tests/golden/v2.0-scan.texmesh";

CommandResult extract(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), {TEXMESH_BINARY, "extract"});
  return run_command(arguments);
}

void expect_valid(const std::string& path) {
  const std::string text = read_text(path);
  Findings findings;
  check_glb({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, path, findings,
            GlbRules::kStandalone);
  for (const Finding& f : findings.list()) ADD_FAILURE() << to_string(f);
}

TEST(CliExtract, EveryWayToAskGivesAFile) {
  TemporaryFolder folder;
  const std::vector<std::vector<std::string>> ways{{"--bytes", "20kB", "--display", "100"},
                                                   {"--scale", "0", "--rung", "max"},
                                                   {"--display", "300"},
                                                   {"--display", "300", "--recentre"},
                                                   {"--lods"},
                                                   {"--lods", "--image-format", "webp", "--rung", "0"},
                                                   {"--image-format", "png"}};
  for (std::size_t k = 0; k < ways.size(); ++k) {
    const std::string out = folder / (std::to_string(k) + ".glb");
    std::vector<std::string> arguments{kGolden, "-o", out, "--json"};
    arguments.insert(arguments.end(), ways[k].begin(), ways[k].end());
    const CommandResult r = extract(arguments);
    ASSERT_EQ(r.exit_code, 0) << r.errors;
    const Json json = Json::parse(r.output);
    EXPECT_EQ(json["bytes"], std::filesystem::file_size(out));
    EXPECT_EQ(json["file"], std::to_string(k) + ".glb");
    expect_valid(out);
  }
}

TEST(CliExtract, BytesOutOfReachHaveAnExitCodeAndMoreThanEnoughHaveNone) {
  TemporaryFolder folder;
  const std::string out = folder / "a.glb";
  const CommandResult small = extract({kGolden, "--bytes", "10", "-o", out, "--display", "64"});
  EXPECT_EQ(small.exit_code, 4) << small.errors;
  EXPECT_NE(small.output.find("10 bytes cannot be kept"), std::string::npos);
  expect_valid(out);
  const CommandResult large = extract({kGolden, "--bytes", "1GB", "-o", out, "--display", "64"});
  EXPECT_EQ(large.exit_code, 0) << large.errors;
  EXPECT_NE(large.output.find("note: the package has no more to put into the file"), std::string::npos);
  expect_valid(out);
}

TEST(CliExtract, SeveralNumbersOfBytesGiveAFileEach) {
  TemporaryFolder folder;
  const CommandResult r =
      extract({kGolden, "--bytes", "20kB,9000", "-o", folder / "a.b.glb", "--display", "64", "--json"});
  ASSERT_EQ(r.exit_code, 0) << r.errors;
  EXPECT_EQ(files_beneath(folder.path().string()),
            (std::vector<std::string>{"a.b-20kB.glb", "a.b-9000.glb"}));
  std::istringstream lines(r.output);
  std::string line;
  for (const auto& [name, bytes] : {std::pair{"a.b-20kB.glb", 20000u}, {"a.b-9000.glb", 9000u}}) {
    ASSERT_TRUE(std::getline(lines, line));
    const Json json = Json::parse(line);
    EXPECT_EQ(json["file"], name);
    EXPECT_EQ(json["asked_bytes"], bytes);
    EXPECT_EQ(json["bytes"], std::filesystem::file_size(folder / name));
    expect_valid(folder / name);
  }
  for (const char* bad : {"20kB,20kB", "20kB,", ",", "20kB,0", "20kB,x"})
    EXPECT_EQ(extract({kGolden, "--bytes", bad, "-o", folder / "c.glb"}).exit_code, 2) << bad;
  EXPECT_EQ(files_beneath(folder.path().string()).size(), 2u);
}

TEST(CliExtract, FaultsLeaveNoFile) {
  TemporaryFolder folder;
  const std::string out = folder / "a.glb", damaged = folder / "damaged.texmesh";
  std::string package = read_text(kGolden);
  write_text(damaged, package.substr(0, package.size() / 2));
  EXPECT_EQ(extract({damaged, "-o", out}).exit_code, 1);
  for (std::size_t at = 16384; at < package.size(); at += 1 + package.size() / 40) package[at] ^= 0x41;
  write_text(damaged, package);
  const CommandResult r = extract({damaged, "-o", out});
  EXPECT_EQ(r.exit_code, 1);
  EXPECT_NE(r.errors.find("texmesh: "), std::string::npos);
  EXPECT_EQ(extract({kGolden, "--scale", "98", "-o", out}).exit_code, 1);
  EXPECT_EQ(extract({kGolden, "--rung", "best", "-o", out}).exit_code, 2);
  EXPECT_EQ(extract({folder / "none", "-o", out}).exit_code, 1);
  EXPECT_EQ(extract({kGolden, "-o", folder / "none/a.glb"}).exit_code, 1);
  EXPECT_EQ(extract({kGolden, "-o", out, "--display", "nan"}).exit_code, 2);
  EXPECT_EQ(extract({kGolden}).exit_code, 2);
  EXPECT_EQ(extract({kGolden, "-o", out, "--bytes", "1kB", "--rung", "max"}).exit_code, 2);
  EXPECT_EQ(extract({kGolden, "-o", out, "--image-format", "gif"}).exit_code, 2);
  EXPECT_FALSE(std::filesystem::exists(out));
  EXPECT_EQ(files_beneath(folder.path().string()), std::vector<std::string>{"damaged.texmesh"});
}

}  // namespace texmesh::testing::command_extract_test
