#include "pipeline/cache/disk_store.h"

#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <thread>

#include "format/base/errors.h"
#include "pipeline/cache/cache_files.h"
#include "tests/pipeline/cache/cache_fixtures.h"

namespace texmesh::disk_store_test {
namespace fs = std::filesystem;
using namespace testing;  // NOLINT: fixtures

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

TEST(DiskStore, TellsOfDamageOnceAndMovesItAway) {
  const Folder folder;
  auto store = open_disk_store(folder.path.string());
  ASSERT_TRUE(store->put(key_of("[8]"), {{"ladder", bytes_of("rungs")}}));
  const fs::path blob = folder.path / object_path("cas", sha256(*bytes_of("rungs")));
  std::ofstream(blob, std::ios::binary | std::ios::trunc) << "runGs";
  EXPECT_FALSE(store->find(key_of("[8]").digest()));
  const auto events = store->take_events();
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(events[0].code, "cache-entry-damaged");
  EXPECT_TRUE(store->take_events().empty());
  EXPECT_FALSE(fs::exists(blob));
  EXPECT_TRUE(fs::exists(folder.path / "quarantine" / blob.filename()));
  ASSERT_TRUE(store->put(key_of("[8]"), {{"ladder", bytes_of("rungs")}}));  // computed again
  EXPECT_TRUE(store->find(key_of("[8]").digest()));
}

TEST(DiskStore, ARecordUnderAnotherKeyIsNotBelieved) {
  const Folder folder;
  auto store = open_disk_store(folder.path.string());
  ASSERT_TRUE(store->put(key_of("[8]"), {{"ladder", bytes_of("rungs")}}));
  const fs::path other = folder.path / object_path("ac", key_of("[9]").digest());
  fs::create_directories(other.parent_path());
  fs::copy_file(folder.path / object_path("ac", key_of("[8]").digest()), other);
  EXPECT_FALSE(store->find(key_of("[9]").digest()));
  EXPECT_TRUE(store->find(key_of("[8]").digest()));
}

TEST(DiskStore, KeepsThePreimageToExplainWith) {
  const Folder folder;
  auto store = open_disk_store(folder.path.string());
  ASSERT_TRUE(store->put(key_of("[8]"), {{"ladder", bytes_of("rungs")}}));
  const auto preimage = store->preimage(key_of("[8]").digest());
  ASSERT_TRUE(preimage);
  const auto key = key_from_preimage(*preimage);
  ASSERT_TRUE(key);
  EXPECT_EQ(key->digest(), key_of("[8]").digest());
  EXPECT_FALSE(store->preimage(key_of("[9]").digest()));
}

TEST(DiskStore, AClaimIsForOneAtATimeAndEndsWithItsHolder) {
  const Folder folder;
  auto a = open_disk_store(folder.path.string()), b = open_disk_store(folder.path.string());
  const Sha256 key = key_of("[8]").digest();
  std::atomic<bool> cancelled{false};
  RunContext context;
  context.cancelled = &cancelled;
  auto claim = a->claim(key, context);
  ASSERT_TRUE(claim);
  std::atomic<bool> got{false};
  std::thread waiter([&] {
    const auto second = b->claim(key, context);
    got = true;
  });
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_FALSE(got);
  claim.reset();
  waiter.join();
  EXPECT_TRUE(got);
  claim = a->claim(key, context);
  cancelled = true;
  EXPECT_THROW(b->claim(key, context), Cancelled);
}

/// A record of key_of("[8]") in which `from` stands as `to`, sealed as it must be.
std::string lying_record(const std::string& from, const std::string& to) {
  std::string body = *unseal(
      *bytes_of(write_entry({key_of("[8]").preimage(), {{"ladder", sha256(*bytes_of("rungs")), 5}}})));
  const auto at = body.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return seal(body.replace(at, from.size(), to));
}

TEST(DiskStore, ASealedRecordOfWrongTypesIsAMissAndMovedAway) {
  const Folder folder;
  auto store = open_disk_store(folder.path.string());
  const fs::path record = folder.path / object_path("ac", key_of("[8]").digest());
  for (const auto& [from, to] :
       std::vector<std::pair<std::string, std::string>>{{"\"version\": 2", "\"version\": \"2\""},
                                                        {"\"version\": 2", "\"version\": [2]"},
                                                        {"\"bytes\": 5", "\"bytes\": \"many\""},
                                                        {"\"bytes\": 5", "\"bytes\": -5"},
                                                        {"\"bytes\": 5", "\"bytes\": 5.5"},
                                                        {"\"name\": \"ladder\"", "\"name\": 7"},
                                                        {"\"sha256\": \"", "\"sha256\": null, \"x\": \""}}) {
    ASSERT_TRUE(store->put(key_of("[8]"), {{"ladder", bytes_of("rungs")}}));
    ASSERT_TRUE(store->find(key_of("[8]").digest()));
    fs::remove(record);
    const std::string text = lying_record(from, to);
    ASSERT_TRUE(publish_object(record.string(), *bytes_of(text)));
    EXPECT_FALSE(store->preimage(key_of("[8]").digest())) << to;
    EXPECT_NO_THROW(prune_cache(folder.path.string(), {1, 0})) << to;
    EXPECT_FALSE(store->find(key_of("[8]").digest())) << to;
    EXPECT_EQ(store->take_events().size(), 1u) << to;
    EXPECT_FALSE(fs::exists(record)) << to;
    EXPECT_TRUE(fs::exists(folder.path / "quarantine" / record.filename())) << to;
  }
}

TEST(DiskStore, WhatIsRejectedIsMovedAwayUnlessItWasReplaced) {
  const Folder folder;
  auto store = open_disk_store(folder.path.string());
  const Sha256 key = key_of("[8]").digest();
  ASSERT_TRUE(store->put(key_of("[8]"), {{"ladder", bytes_of("no ladder")}}));
  const auto wrong = *store->find(key);
  store->reject(key, wrong, "no ladder");
  EXPECT_FALSE(store->find(key));
  ASSERT_EQ(store->take_events().size(), 1u);
  ASSERT_TRUE(store->put(key_of("[8]"), {{"ladder", bytes_of("rungs")}}));
  store->reject(key, wrong, "no ladder");  // of somebody who had read it before
  EXPECT_TRUE(store->find(key));
  EXPECT_TRUE(store->take_events().empty());
}

TEST(DiskStore, LookingWritesNothing) {
  const Folder folder;
  auto nowhere = look_into_disk_store(folder.path.string());
  EXPECT_FALSE(nowhere->find(key_of("a").digest()));
  EXPECT_FALSE(nowhere->put(key_of("a"), {{"x", bytes_of("x")}}));
  EXPECT_FALSE(nowhere->put_note(key_of("a").digest(), "note"));
  EXPECT_FALSE(fs::exists(folder.path));
  ASSERT_TRUE(open_disk_store(folder.path.string())->put(key_of("a"), {{"x", bytes_of("x")}}));
  const fs::path record = folder.path / object_path("ac", key_of("a").digest());
  set_age(record, 86400);
  const auto before = files_in(folder.path);
  const auto time = fs::last_write_time(record);
  EXPECT_TRUE(look_into_disk_store(folder.path.string())->find(key_of("a").digest()));
  std::ofstream(folder.path / object_path("cas", sha256(*bytes_of("x"))), std::ios::trunc) << "y";
  auto store = look_into_disk_store(folder.path.string());
  EXPECT_FALSE(store->find(key_of("a").digest()));
  EXPECT_EQ(store->take_events().size(), 1u);
  EXPECT_EQ(files_in(folder.path), before);
  EXPECT_EQ(fs::last_write_time(record), time);
}

}  // namespace texmesh::disk_store_test
