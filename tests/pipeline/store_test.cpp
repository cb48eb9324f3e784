#include "pipeline/cache/disk_store.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "format/errors.h"
#include "pipeline/atomic_file.h"

namespace texmesh {
namespace {
namespace fs = std::filesystem;

struct Folder {
  fs::path path =
      fs::temp_directory_path() / ("texmesh-store-" + std::to_string(::getpid()) + "-" +
                                   ::testing::UnitTest::GetInstance()->current_test_info()->name());
  Folder() { fs::remove_all(path); }
  ~Folder() { fs::remove_all(path); }
};

Bytes bytes_of(const std::string& s) {
  return std::make_shared<const std::vector<std::uint8_t>>(s.begin(), s.end());
}
Key key_of(const std::string& option) { return Key("ladder", 3).add("option ladder.rungs", option); }

std::vector<fs::path> files_in(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& e : fs::recursive_directory_iterator(folder))
    if (e.is_regular_file()) files.push_back(e.path());
  return files;
}

TEST(Key, DependsOnEveryPartAndOnItsLimits) {
  const Sha256 base = key_of("[8]").digest();
  EXPECT_EQ(base, key_of("[8]").digest());
  EXPECT_NE(base, key_of("[9]").digest());
  EXPECT_NE(base, Key("ladder", 4).add("option ladder.rungs", "[8]").digest());
  EXPECT_NE(base, Key("lut", 3).add("option ladder.rungs", "[8]").digest());
  // Labels and values are length-prefixed: moving a character across the border changes the key.
  EXPECT_NE(Key("s", 1).add("ab", "c").digest(), Key("s", 1).add("a", "bc").digest());
  EXPECT_NE(Key("s", 1).add("a", "b").add("c", "d").digest(),
            Key("s", 1).add("c", "d").add("a", "b").digest());
}

TEST(DiskStore, GivesBackWhatWasPut) {
  const Folder folder;
  {
    auto store = open_disk_store(folder.path.string());
    EXPECT_FALSE(store->find(key_of("[8]").digest()));
    EXPECT_TRUE(store->put(key_of("[8]"), {{"ladder", bytes_of("rungs")}, {"ladder.notes", bytes_of("")}}));
  }
  auto store = open_disk_store(folder.path.string());
  const auto found = store->find(key_of("[8]").digest());
  ASSERT_TRUE(found);
  ASSERT_EQ(found->size(), 2u);
  EXPECT_EQ((*found)[0].name, "ladder");
  EXPECT_EQ(*store->load((*found)[0]), *bytes_of("rungs"));
  EXPECT_EQ(store->load((*found)[1])->size(), 0u);
  EXPECT_FALSE(store->find(key_of("[9]").digest()));
}

TEST(DiskStore, EveryTruncationAndEveryFlippedByteIsAMiss) {
  const Folder folder;
  auto store = open_disk_store(folder.path.string());
  ASSERT_TRUE(store->put(key_of("[8]"), {{"ladder", bytes_of("some bytes")}}));
  for (const fs::path& file : files_in(folder.path)) {
    std::ifstream in(file, std::ios::binary);
    const std::string good((std::istreambuf_iterator<char>(in)), {});
    for (std::size_t i = 0; i < 2 * good.size(); ++i) {
      std::string bad = good;
      if (i < good.size())
        bad[i] = static_cast<char>(bad[i] ^ 1);
      else
        bad.resize(i - good.size());
      std::ofstream(file, std::ios::binary | std::ios::trunc) << bad;
      EXPECT_FALSE(store->find(key_of("[8]").digest())) << file << " " << i;
      fs::create_directories(file.parent_path());
    }
    std::ofstream(file, std::ios::binary | std::ios::trunc) << good;
    EXPECT_TRUE(store->find(key_of("[8]").digest()));
  }
}

TEST(DiskStore, LeavesNoTemporaryFiles) {
  const Folder folder;
  auto store = open_disk_store(folder.path.string());
  ASSERT_TRUE(store->put(key_of("[8]"), {{"ladder", bytes_of("x")}}));
  ASSERT_TRUE(store->put_note(key_of("n").digest(), "note"));
  EXPECT_EQ(*store->find_note(key_of("n").digest()), "note");
  for (const fs::path& f : files_in(folder.path))
    EXPECT_EQ(f.filename().string().find("tmp"), std::string::npos) << f;
}

TEST(DiskStore, AFolderThatCannotBeMadeIsAnInputError) {
  EXPECT_THROW(open_disk_store("/proc/texmesh-cache"), InputError);
}

TEST(AtomicFile, ReplacesOrLeavesAlone) {
  const Folder folder;
  fs::create_directories(folder.path);
  const std::string file = (folder.path / "a").string();
  write_file_atomically(file, *bytes_of("one"));
  EXPECT_TRUE(file_holds(file, *bytes_of("one")));
  EXPECT_FALSE(file_holds(file, *bytes_of("onE")));
  EXPECT_FALSE(file_holds(file, *bytes_of("on")));
  write_file_atomically(file, *bytes_of("two"));
  EXPECT_TRUE(file_holds(file, *bytes_of("two")));
  EXPECT_THROW(write_file_atomically((folder.path / "no" / "b").string(), *bytes_of("x")), InputError);
  fs::create_directories(folder.path / "d" / "inside");
  EXPECT_THROW(write_file_atomically((folder.path / "d").string(), *bytes_of("x")), InputError);
  EXPECT_EQ(files_in(folder.path).size(), 1u);  // nothing but "a"
}

TEST(AtomicFile, AFullDiskLeavesNothing) {
  const fs::path full = "/dev/full";
  if (!fs::exists(full)) GTEST_SKIP() << "no /dev/full";
  const Folder folder;
  fs::create_directories(folder.path);
  fs::create_symlink(full, folder.path / "link");
  // The temporary is opened with O_NOFOLLOW: a planted symbolic link is refused, not written through.
  EXPECT_THROW(
      write_file_atomically((folder.path / "a").string(), *bytes_of("x"), (folder.path / "link").string()),
      InputError);
  EXPECT_FALSE(fs::exists(folder.path / "a"));
}

}  // namespace
}  // namespace texmesh
