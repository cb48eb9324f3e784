#include "pipeline/io/atomic_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <thread>

#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "tests/support/command.h"

namespace texmesh {
namespace {
namespace fs = std::filesystem;
using testing::TemporaryFolder;

ByteSpan bytes_of(const std::string& s) {
  return {reinterpret_cast<const std::uint8_t*>(s.data()), s.size()};
}

TEST(AtomicFile, ReplacesOrLeavesAlone) {
  const TemporaryFolder folder;
  const std::string file = (folder.path() / "a").string();
  write_file_atomically(file, bytes_of("one"));
  EXPECT_TRUE(file_holds(file, bytes_of("one")));
  EXPECT_FALSE(file_holds(file, bytes_of("onE")));
  EXPECT_FALSE(file_holds(file, bytes_of("on")));
  write_file_atomically(file, bytes_of("two"));
  EXPECT_TRUE(file_holds(file, bytes_of("two")));
  EXPECT_THROW(write_file_atomically((folder.path() / "no" / "b").string(), bytes_of("x")), InputError);
  fs::create_directories(folder.path() / "d" / "inside");
  EXPECT_THROW(write_file_atomically((folder.path() / "d").string(), bytes_of("x")), InputError);
  EXPECT_EQ(testing::files_beneath(folder.path().string()), std::vector<std::string>{"a"});
}

TEST(OutputFile, PipesAreWrittenIntoAndLinksStay) {
  const TemporaryFolder folder;
  fs::create_directories(folder.path() / "there");
  const std::string pipe = (folder.path() / "pipe").string(), link = (folder.path() / "link").string();
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  std::string read;
  std::thread reader([&] { std::getline(std::ifstream(pipe), read); });
  write_output_file(pipe, bytes_of("through the pipe"));
  reader.join();
  EXPECT_EQ(read, "through the pipe");
  EXPECT_TRUE(fs::is_fifo(pipe));

  fs::create_symlink("there/file", link);  // leads to nothing yet
  for (const char* text : {"one", "two"}) {
    write_output_file(link, bytes_of(text));
    EXPECT_TRUE(fs::is_symlink(link));
    EXPECT_TRUE(file_holds((folder.path() / "there/file").string(), bytes_of(text)));
  }
  fs::create_symlink("loop", folder.path() / "loop");
  EXPECT_THROW(write_output_file((folder.path() / "loop").string(), bytes_of("x")), InputError);
  EXPECT_TRUE(is_special_file("/dev/stdout"));
  EXPECT_FALSE(is_special_file(link));
}

TEST(AtomicFile, AFullDiskLeavesNothing) {
  const fs::path full = "/dev/full";
  if (!fs::exists(full)) GTEST_SKIP() << "no /dev/full";
  const TemporaryFolder folder;
  fs::create_symlink(full, folder.path() / "link");
  // The temporary is opened with O_NOFOLLOW: a planted symbolic link is refused, not written through.
  EXPECT_THROW(
      write_file_atomically((folder.path() / "a").string(), bytes_of("x"), (folder.path() / "link").string()),
      InputError);
  EXPECT_FALSE(fs::exists(folder.path() / "a"));
}

}  // namespace
}  // namespace texmesh
