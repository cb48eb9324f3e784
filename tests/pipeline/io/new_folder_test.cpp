// Copies into a folder that is being made.
#include "pipeline/io/new_folder.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <csignal>

#include "tests/support/command.h"

namespace texmesh::testing::new_folder_test {
namespace fs = std::filesystem;

std::string error_of_copy(const TemporaryFolder& folder, const std::string& name) {
  NewFolder made(folder / "made", {true, [](const fs::path&) { return true; }, "", ""});
  try {
    made.copy("copy/file", folder / name);
    made.publish();
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

TEST(NewFolder, CopiesFilesForEverybodyToRead) {
  TemporaryFolder folder;
  const std::string text(3'000'001, 'x');
  write_text(folder / "source", text);
  fs::permissions(folder / "source", fs::perms{0400});
  EXPECT_EQ(error_of_copy(folder, "source"), "");
  EXPECT_TRUE(read_text(folder / "made/copy/file") == text);
  EXPECT_EQ(fs::status(folder / "made/copy/file").permissions(), fs::perms{0644});
}

TEST(NewFolder, RefusesWhatIsNoFile) {
  TemporaryFolder folder;
  ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
  EXPECT_NE(error_of_copy(folder, "pipe").find("cannot be copied"), std::string::npos);
  EXPECT_NE(error_of_copy(folder, "none").find("none: cannot be copied: No such file"), std::string::npos);
}

TEST(NewFolder, SaysWhyACopyCannotBeWritten) {
  TemporaryFolder folder;
  write_text(folder / "source", std::string(10000, 'x'));
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  ::getrlimit(RLIMIT_FSIZE, &before);
  const rlimit little{4096, before.rlim_max};
  ::setrlimit(RLIMIT_FSIZE, &little);
  const std::string error = error_of_copy(folder, "source");
  ::setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_NE(error.find("cannot be written: File too large"), std::string::npos) << error;
}

}  // namespace texmesh::testing::new_folder_test
