#include "tools/cli/options/command_line.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <stdexcept>
#include <string>

#include "pipeline/io/atomic_file.h"
#include "pipeline/io/exit_codes.h"
#include "tools/cli/options/units.h"

namespace texmesh::told_errors_test {

struct Told {
  int exit_code = 0;
  std::string text;
};

Told told_of(const std::function<int()>& run) {
  ::testing::internal::CaptureStderr();
  const int code = run_and_print_errors(run);
  return {code, ::testing::internal::GetCapturedStderr()};
}

TEST(ToldErrors, WhatIsGivenIsTheExitCode) {
  const Told t = told_of([] { return 42; });
  EXPECT_EQ(t.exit_code, 42);
  EXPECT_EQ(t.text, "");
}

TEST(ToldErrors, EachKindHasItsCodeAndSaysWhatItFound) {
  const Told usage = told_of([]() -> int { throw UsageError("--time", "", "seconds", "much"); });
  EXPECT_EQ(usage.exit_code, kExitUsage);
  EXPECT_NE(usage.text.find("much"), std::string::npos);
  const Told input = told_of([]() -> int { throw InputError("scan.glb", "byte 4", "a GLB", "a letter"); });
  EXPECT_EQ(input.exit_code, kExitModelFailed);
  EXPECT_NE(input.text.find("a letter"), std::string::npos);
  const Told file = told_of([] { return static_cast<int>(std::filesystem::file_size("/nothing/there")); });
  EXPECT_EQ(file.exit_code, kExitModelFailed);
  EXPECT_NE(file.text.find("/nothing/there"), std::string::npos);
  const Told internal = told_of([]() -> int { throw std::logic_error("two and two"); });
  EXPECT_EQ(internal.exit_code, kExitInternal);
  EXPECT_NE(internal.text.find("internal error: two and two"), std::string::npos);
}

TEST(ToldErrors, MissingRightsAreNoUsageError) {
  const auto asked = [](const auto& error) { return [&error]() -> int { throw error; }; };
  const PermissionError rights("scans", "", "", "cannot be listed");
  const InputError name("scans", "", "", "cannot be listed");
  EXPECT_EQ(told_of([&] { return as_usage(asked(rights)); }).exit_code, kExitModelFailed);
  EXPECT_EQ(told_of([&] { return as_usage(asked(name)); }).exit_code, kExitUsage);
  const auto no_folder = [] { return check_output_file("/nothing/there/x"), 0; };
  EXPECT_EQ(told_of([&] { return as_usage(no_folder); }).exit_code, kExitUsage);
}

}  // namespace texmesh::told_errors_test
