// texmesh report as a user runs it: the folder, what is printed, exit codes.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/support/command.h"
#include "tests/support/packages.h"
#include "tests/support/schema.h"

namespace texmesh::testing::command_report_test {

using Json = nlohmann::json;

CommandResult report(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), {TEXMESH_BINARY, "report"});
  return run_command(arguments);
}

class ReportCommand : public ::testing::Test {
 protected:
  void SetUp() override {
    const Bytes bytes = make_package_parts().build();
    write_text(package(), std::string(bytes.begin(), bytes.end()));
  }
  std::string package() const { return folder_ / "scan.texmesh"; }
  TemporaryFolder folder_;
};

TEST_F(ReportCommand, WritesThePageAndSaysTheVerdict) {
  const CommandResult r =
      report({package(), "-o", folder_ / "r", "--views", "2", "--max-flip", "1", "--max-flip-p95", "1"});
  EXPECT_EQ(r.exit_code, 0) << r.errors;
  EXPECT_EQ(r.output.find("The object looks like the original at every size. Every switch size holds"), 0u)
      << r.output;
  EXPECT_NE(r.output.find("r/index.html\n"), std::string::npos);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "r/index.html"));
}

TEST_F(ReportCommand, ExitCode4WhereASizeDoesNotHoldAndTheReportIsThere) {
  const CommandResult r =
      report({package(), "-o", folder_ / "r", "--views", "2", "--max-flip", "0", "--json"});
  EXPECT_EQ(r.exit_code, 4) << r.errors;
  const Json j = Json::parse(r.output);
  EXPECT_TRUE(follows_schema(j, "report.v1"));
  EXPECT_EQ(j["holds"], false);
  for (const Json& file : j["files"])
    EXPECT_TRUE(std::filesystem::exists(folder_ / ("r/" + file.get<std::string>()))) << file;
}

TEST_F(ReportCommand, OtherFoldersAndInputsAreRefusedAtOnce) {
  std::filesystem::create_directories(folder_ / "other");
  write_text(folder_ / "other/mine.txt", "x");
  EXPECT_EQ(report({package(), "-o", folder_ / "other"}).exit_code, 1);
  EXPECT_EQ(read_text(folder_ / "other/mine.txt"), "x");
  EXPECT_EQ(report({folder_ / "none.texmesh", "-o", folder_ / "r"}).exit_code, 1);
  EXPECT_EQ(report({package(), "-o", folder_ / "r", "--against", folder_ / "none.glb"}).exit_code, 1);
  EXPECT_EQ(report({package()}).exit_code, 2);
  EXPECT_EQ(report({package(), "-o", folder_ / "r", "--views", "0"}).exit_code, 2);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "r"));
}

}  // namespace texmesh::testing::command_report_test
