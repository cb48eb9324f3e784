
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>

#include "pipeline/cache/cache_files.h"
#include "pipeline/cache/disk_store.h"
#include "tests/pipeline/cache/cache_fixtures.h"

namespace texmesh::prune_test {
namespace fs = std::filesystem;
using namespace testing;  // NOLINT: fixtures

TEST(Prune, TheLeastRecentlyUsedGoesFirstRecordsBeforeBlobs) {
  const Folder folder;
  {
    auto store = open_disk_store(folder.path.string());
    for (int i = 0; i < 4; ++i)
      ASSERT_TRUE(store->put(key_of(std::to_string(i)),
                             {{"own", bytes_of(std::string(1000, static_cast<char>('a' + i)))},
                              {"shared", bytes_of("the same for all")}}));
  }
  for (int i = 0; i < 4; ++i)
    set_age(folder.path / object_path("ac", key_of(std::to_string(i)).digest()), 100000 * (i + 1));
  const PruneResult r = prune_cache(folder.path.string(), {4000, 0});
  EXPECT_GE(r.entries, 1u);
  EXPECT_LE(r.kept_bytes, 4000u);
  auto store = open_disk_store(folder.path.string());
  EXPECT_TRUE(store->find(key_of("0").digest()));   // the youngest
  EXPECT_FALSE(store->find(key_of("3").digest()));  // the oldest
  EXPECT_TRUE(store->take_events().empty());        // nothing half there
}

TEST(Prune, ByAgeSinceTheLastUse) {
  const Folder folder;
  {
    auto store = open_disk_store(folder.path.string());
    ASSERT_TRUE(store->put(key_of("old"), {{"x", bytes_of("old")}}));
    ASSERT_TRUE(store->put(key_of("used"), {{"x", bytes_of("used")}}));
  }
  for (const char* name : {"old", "used"})
    set_age(folder.path / object_path("ac", key_of(name).digest()), 86400 * 40);
  ASSERT_TRUE(open_disk_store(folder.path.string())->find(key_of("used").digest()));  // a use makes it young
  EXPECT_EQ(prune_cache(folder.path.string(), {0, 86400 * 30}).entries, 1u);
  auto store = open_disk_store(folder.path.string());
  EXPECT_TRUE(store->find(key_of("used").digest()));
  EXPECT_FALSE(store->find(key_of("old").digest()));
}

TEST(Prune, NeverWhatARunningBuildHasUsed) {
  const Folder folder;
  auto running = open_disk_store(folder.path.string());
  ASSERT_TRUE(running->put(key_of("mine"), {{"x", bytes_of("mine")}}));
  PruneResult r = prune_cache(folder.path.string(), {1, 0});
  EXPECT_EQ(r.entries, 0u);
  EXPECT_GE(r.kept_in_use, 1u);
  EXPECT_TRUE(running->find(key_of("mine").digest()));
  running.reset();
  r = prune_cache(folder.path.string(), {1, 0});
  EXPECT_EQ(r.entries, 1u);
  EXPECT_FALSE(open_disk_store(folder.path.string())->find(key_of("mine").digest()));
}

TEST(Prune, WhatIsQuarantinedCountsAndGoesBeforeResultsTheOldestFirst) {
  const Folder folder;
  ASSERT_TRUE(open_disk_store(folder.path.string())->put(key_of("a"), {{"x", bytes_of("result")}}));
  fs::create_directories(folder.path / "quarantine");
  for (const char* name : {"old", "young"}) {
    std::ofstream(folder.path / "quarantine" / name) << std::string(3000, 'q');
    std::this_thread::sleep_for(std::chrono::milliseconds(20));  // times of files have ticks
  }
  PruneResult r = prune_cache(folder.path.string(), {5000, 0});
  EXPECT_EQ(r.others, 1u);
  EXPECT_EQ(r.entries, 0u);
  EXPECT_LE(r.kept_bytes, 5000u);
  EXPECT_GE(r.kept_bytes, 3000u);
  EXPECT_FALSE(fs::exists(folder.path / "quarantine/old"));
  EXPECT_TRUE(fs::exists(folder.path / "quarantine/young"));
  r = prune_cache(folder.path.string(), {2000, 0});
  EXPECT_FALSE(fs::exists(folder.path / "quarantine/young"));
  EXPECT_TRUE(open_disk_store(folder.path.string())->find(key_of("a").digest()));
}

TEST(Prune, NowAndThenReadsNoRecordWhereNothingHasToGo) {
  const Folder folder;
  ASSERT_TRUE(open_disk_store(folder.path.string())->put(key_of("a"), {{"x", bytes_of("result")}}));
  const fs::path orphan = folder.path / object_path("cas", sha256(*bytes_of("orphan")));
  ASSERT_TRUE(publish_object(orphan.string(), *bytes_of("orphan")));
  set_age(orphan, 86400);
  prune_now_and_then(folder.path.string(), {1'000'000, 86400});
  EXPECT_TRUE(fs::exists(orphan));  // only the records tell that it is one
  fs::remove(folder.path / "pruned");
  set_age(folder.path / object_path("ac", key_of("a").digest()), 2 * 86400);
  prune_now_and_then(folder.path.string(), {1'000'000, 86400});
  EXPECT_FALSE(open_disk_store(folder.path.string())->find(key_of("a").digest()));
  EXPECT_FALSE(fs::exists(orphan));
}

TEST(Prune, ForgetsBuildsThatWereKilled) {
  const Folder folder;
  open_disk_store(folder.path.string());
  std::ofstream(folder.path / "running/12345-0") << "";  // nobody holds it
  EXPECT_EQ(cache_statistics(folder.path.string()).running, 0u);
  EXPECT_FALSE(fs::exists(folder.path / "running/12345-0"));
}

TEST(VerifyCache, FindsEveryFlippedBit) {
  const Folder folder;
  constexpr int kObjects = 40;
  {
    auto store = open_disk_store(folder.path.string());
    for (int i = 0; i < kObjects; ++i)
      ASSERT_TRUE(store->put(key_of(std::to_string(i)), {{"x", bytes_of("blob " + std::to_string(i))}}));
  }
  EXPECT_TRUE(verify_cache(folder.path.string()).empty());
  for (int i = 0; i < kObjects; i += 2) {
    const fs::path file =
        folder.path / (i % 4 ? object_path("ac", key_of(std::to_string(i)).digest())
                             : object_path("cas", sha256(*bytes_of("blob " + std::to_string(i)))));
    std::fstream f(file, std::ios::binary | std::ios::in | std::ios::out);
    char c = 0;
    f.seekg(i % 5).get(c);
    f.seekp(i % 5).put(static_cast<char>(c ^ (1 << i % 8)));
  }
  // A damaged blob takes its record with it.
  EXPECT_EQ(verify_cache(folder.path.string()).size(), kObjects / 2u + kObjects / 4u);
  EXPECT_TRUE(verify_cache(folder.path.string()).empty());
  auto store = open_disk_store(folder.path.string());
  for (int i = 0; i < kObjects; ++i)
    EXPECT_EQ(store->find(key_of(std::to_string(i)).digest()).has_value(), i % 2 == 1);
}

}  // namespace texmesh::prune_test
