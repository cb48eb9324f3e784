#include "tools/cli/options/command_line.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <stdexcept>
#include <string>

#include "pipeline/io/atomic_file.h"
#include "pipeline/io/exit_codes.h"
#include "tests/support/command.h"
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

TEST(ToldErrors, WhatCannotBePrintedIsAnError) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
  const auto printed_to = [](const std::string& where) {
    return testing::run_command({"/bin/sh", "-c", TEXMESH_BINARY " --version " + where});
  };
  EXPECT_EQ(printed_to("> /dev/full").exit_code, kExitModelFailed);
  EXPECT_NE(printed_to("> /dev/full").errors.find("standard output cannot be written"), std::string::npos);
  EXPECT_EQ(printed_to(">&-").exit_code, kExitOk) << "nobody wants it";
  EXPECT_EQ(printed_to("> /dev/null").exit_code, kExitOk);
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
