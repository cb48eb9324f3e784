// A cache folder of which several threads and processes read the same damaged file.
#include "pipeline/cache/disk_store.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <latch>
#include <thread>

#include "pipeline/cache/cache_files.h"
#include "tests/pipeline/cache/cache_fixtures.h"
#include "tests/support/command.h"

namespace texmesh::testing::disk_store_damage_test {
namespace fs = std::filesystem;
using Fate = QuarantineResult::Fate;

/// A cache in which one blob is the output of two results, under two names.
class SharedBlob : public ::testing::Test {
 protected:
  static constexpr const char* kNames[] = {"ladder", "scales"};

  static bool put(Store& store, const std::string& name) {
    return store.put(key_of(name), {{name, bytes_of("rungs")}});
  }
  fs::path path() const { return fs::path(folder()) / object_path("cas", sha256(*bytes_of("rungs"))); }
  fs::path quarantined() const { return fs::path(folder()) / "quarantine" / path().filename(); }
  const std::string& folder() const { return cache_; }

  TemporaryFolder temporary_;
  const std::string cache_ = temporary_ / "cache";
};

TEST_F(SharedBlob, OnlyTheFileThatWasReadIsMovedAway) {
  auto store = open_disk_store(folder());
  ASSERT_TRUE(put(*store, "ladder"));
  write_text(path().string(), "runGs");
  const auto damaged = stamp_of(path().string());
  ASSERT_TRUE(damaged);
  EXPECT_EQ(move_to_quarantine(folder(), path().string(), *damaged).fate, Fate::kMoved);
  EXPECT_EQ(read_text(quarantined().string()), "runGs");
  EXPECT_EQ(move_to_quarantine(folder(), path().string(), *damaged).fate, Fate::kReplaced);  // gone
  ASSERT_TRUE(put(*store, "ladder"));  // the first reader has computed the result again
  EXPECT_EQ(move_to_quarantine(folder(), path().string(), *damaged).fate, Fate::kReplaced);
  EXPECT_EQ(read_text(path().string()), "rungs");
  EXPECT_EQ(read_text(quarantined().string()), "runGs");
}

TEST_F(SharedBlob, WhatCannotBeMovedAwayHasAReason) {
  auto store = open_disk_store(folder());
  ASSERT_TRUE(put(*store, "ladder"));
  write_text(fs::path(folder()) / "quarantine", "a file where the folder should be");
  const QuarantineResult r = move_to_quarantine(folder(), path().string(), *stamp_of(path().string()));
  EXPECT_EQ(r.fate, Fate::kFailed);
  EXPECT_FALSE(r.reason.empty());
  EXPECT_EQ(read_text(path().string()), "rungs");
}

/// As processes of one build do: each has its own store, reads, and computes again what is no hit.
TEST_F(SharedBlob, DamageIsToldOnceHoweverManyHaveReadIt) {
  constexpr int kReaders = 8, kRounds = 60;
  std::vector<std::unique_ptr<Store>> stores;
  for (int k = 0; k < kReaders; ++k) stores.push_back(open_disk_store(folder()));
  for (const char* name : kNames) ASSERT_TRUE(put(*stores[0], name));
  for (int round = 0; round < kRounds; ++round) {
    write_text(path().string(), "runGs");
    std::latch start(kReaders);
    std::vector<std::thread> readers;
    for (int k = 0; k < kReaders; ++k)
      readers.emplace_back([&, k] {
        const char* name = kNames[k % 2];
        start.arrive_and_wait();
        if (!stores[k]->find(key_of(name).digest())) put(*stores[k], name);
      });
    for (std::thread& r : readers) r.join();
    std::vector<StoreEvent> events;
    for (const auto& s : stores)
      for (const StoreEvent& e : s->take_events()) events.push_back(e);
    ASSERT_EQ(events.size(), 1u) << "round " << round << ": " << events.back().text;
    EXPECT_EQ(events[0].code, "cache-entry-damaged");
    EXPECT_NE(events[0].text.find("moved to quarantine/" + path().filename().string()), std::string::npos);
    EXPECT_EQ(read_text(quarantined().string()), "runGs");  // no sound file went the same way
    EXPECT_EQ(read_text(path().string()), "rungs");
    fs::remove(quarantined());
  }
}

TEST_F(SharedBlob, WhoeverOnlyLooksTellsOfADamagedFileOnce) {
  {
    auto store = open_disk_store(folder());
    for (const char* name : kNames) ASSERT_TRUE(put(*store, name));
  }
  write_text(path().string(), "runGs");
  auto store = look_into_disk_store(folder());
  for (const char* name : kNames) EXPECT_FALSE(store->find(key_of(name).digest()));
  EXPECT_EQ(store->take_events().size(), 1u);
  EXPECT_EQ(read_text(path().string()), "runGs");
}

}  // namespace texmesh::testing::disk_store_damage_test
