#include "pipeline/io/atomic_file.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <ctime>
#include <filesystem>
#include <fstream>
#include <thread>

#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "pipeline/io/machine.h"
#include "tests/support/command.h"

namespace texmesh::atomic_file_test {
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

/// A temporary of `file` with this writer's mark.
std::string left_by(const std::string& file, const std::string& mark) {
  const std::string path = file + ".tmp-" + mark + "-0";
  testing::write_text(path, "half");
  return path;
}

void make_old(const std::string& path, int days) {
  const timespec time{::time(nullptr) - days * 86400, 0};
  const timespec times[2] = {time, time};
  ASSERT_EQ(::utimensat(AT_FDCWD, path.c_str(), times, 0), 0);
}

TEST(Temporaries, AreRemovedWhenTheirWriterIsGoneWhateverLocksSay) {
  const TemporaryFolder folder;
  const std::string package = folder / "a.texmesh", own = owner_mark();
  const pid_t pid = ::fork();
  if (pid == 0) ::_exit(0);
  ::waitpid(pid, nullptr, 0);
  const std::string live = left_by(package, own);
  make_old(live, 3);
  const std::string dead = left_by(package, own.substr(0, own.rfind('-') + 1) + std::to_string(pid));
  const std::string elsewhere = left_by(package, "node7-0123456789ab-7");
  const std::string old = left_by(package, "node8-0123456789ab-7");
  make_old(old, 3);
  const std::string other = left_by(folder / "a.json", "node8-0123456789ab-7");
  make_old(other, 3);
  testing::write_text(folder / "a.texmesh.tmp-mine", "a user's");
  make_old(folder / "a.texmesh.tmp-mine", 3);
  EXPECT_EQ(remove_stale_temporaries(folder.path().string(), ".texmesh"), 2u);
  for (const std::string& kept : {live, elsewhere, other, folder / "a.texmesh.tmp-mine"})
    EXPECT_TRUE(fs::exists(kept)) << kept;
  EXPECT_FALSE(fs::exists(dead));
  EXPECT_FALSE(fs::exists(old));
}

TEST(Temporaries, TheLongestNamesAreWritten) {
  const TemporaryFolder folder;
  const std::string name = std::string(NAME_MAX - 8, 'x') + ".texmesh", file = folder / name;
  write_file_atomically(file, bytes_of("all"));
  EXPECT_EQ(testing::read_text(file), "all");
  EXPECT_EQ(testing::files_beneath(folder.path().string()), std::vector<std::string>{name});
  EXPECT_NE(temporary_name(file, 1).find(".texmesh.tmp-"), std::string::npos) << "remove_stale_temporaries()";
}

TEST(Temporaries, ANameThatSomebodyHasIsLeftToThem) {
  const TemporaryFolder folder;
  const std::string file = folder / "a", temporary = temporary_name(file, 0);
  testing::write_text(temporary, "another writer's");
  write_file_atomically(file, bytes_of("mine"), temporary);
  EXPECT_EQ(testing::read_text(file), "mine");
  EXPECT_EQ(testing::read_text(temporary), "another writer's");
}

}  // namespace texmesh::atomic_file_test
