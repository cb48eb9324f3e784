#include "pipeline/cache/disk_store.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>

#include "format/base/errors.h"
#include "pipeline/cache/cache_files.h"
#include "pipeline/cache/cache_layer.h"
#include "pipeline/cache/prune.h"
#include "pipeline/io/atomic_file.h"

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

SharedBytes bytes_of(const std::string& s) {
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

void set_age(const fs::path& path, std::int64_t seconds) {
  fs::last_write_time(path, fs::file_time_type::clock::now() - std::chrono::seconds(seconds));
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
  EXPECT_GE(r.records, 1u);
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
  EXPECT_EQ(prune_cache(folder.path.string(), {0, 86400 * 30}).records, 1u);
  auto store = open_disk_store(folder.path.string());
  EXPECT_TRUE(store->find(key_of("used").digest()));
  EXPECT_FALSE(store->find(key_of("old").digest()));
}

TEST(Prune, NeverWhatARunningBuildHasUsed) {
  const Folder folder;
  auto running = open_disk_store(folder.path.string());
  ASSERT_TRUE(running->put(key_of("mine"), {{"x", bytes_of("mine")}}));
  PruneResult r = prune_cache(folder.path.string(), {1, 0});
  EXPECT_EQ(r.records, 0u);
  EXPECT_GE(r.kept_in_use, 1u);
  EXPECT_TRUE(running->find(key_of("mine").digest()));
  running.reset();
  r = prune_cache(folder.path.string(), {1, 0});
  EXPECT_EQ(r.records, 1u);
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
  EXPECT_EQ(r.records, 0u);
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

TEST(LayeredStore, BringsWhatAFolderHoldsAndNothingDamaged) {
  const Folder folder;
  const std::string shared = (folder.path / "shared").string(), local = (folder.path / "local").string();
  {
    auto store = open_disk_store(shared);
    ASSERT_TRUE(store->put(key_of("a"), {{"x", bytes_of("first")}}));
    ASSERT_TRUE(store->put(key_of("b"), {{"x", bytes_of("second")}}));
    ASSERT_TRUE(store->put_note(key_of("n").digest(), "note"));
  }
  std::ofstream(fs::path(shared) / object_path("cas", sha256(*bytes_of("second")))) << "secOnd";
  const auto open = [&] {
    std::vector<std::unique_ptr<CacheLayer>> layers;
    layers.push_back(open_layer(shared));
    return layered_store(open_disk_store(local), std::move(layers), LayerUse::kFetch);
  };
  auto store = open();
  const auto found = store->find(key_of("a").digest());
  ASSERT_TRUE(found);
  EXPECT_EQ(*store->load(found->front()), *bytes_of("first"));
  EXPECT_EQ(store->find_note(key_of("n").digest()), "note");
  EXPECT_FALSE(store->find(key_of("b").digest()));
  const auto events = store->take_events();
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(events[0].code, "cache-entry-damaged");
  store.reset();
  fs::remove_all(shared);
  EXPECT_TRUE(open_disk_store(local)->find(key_of("a").digest()));  // it is here now
  store = open();
  EXPECT_FALSE(store->find(key_of("c").digest()));
  ASSERT_EQ(store->take_events().size(), 1u);  // unreachable, said once
  EXPECT_FALSE(store->find(key_of("d").digest()));
  EXPECT_TRUE(store->take_events().empty());
}

/// A record of key_of("[8]") in which `from` stands as `to`, sealed as it must be.
std::string lying_record(const std::string& from, const std::string& to) {
  std::string body = *unseal(
      *bytes_of(write_record({key_of("[8]").preimage(), {{"ladder", sha256(*bytes_of("rungs")), 5}}})));
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

TEST(LayeredStore, LookingKeepsNothingThatALayerGives) {
  const Folder folder;
  const std::string shared = (folder.path / "shared").string(), local = (folder.path / "local").string();
  ASSERT_TRUE(open_disk_store(shared)->put(key_of("a"), {{"x", bytes_of("first")}}));
  std::vector<std::unique_ptr<CacheLayer>> layers;
  layers.push_back(open_layer(shared));
  auto store = layered_store(look_into_disk_store(local), std::move(layers), LayerUse::kLook);
  const auto found = store->find(key_of("a").digest());
  ASSERT_TRUE(found);
  EXPECT_EQ(*store->load(found->front()), *bytes_of("first"));
  EXPECT_FALSE(fs::exists(local));
}

TEST(LayeredStore, WhatIsRejectedIsNotBroughtAgain) {
  const Folder folder;
  const std::string shared = (folder.path / "shared").string(), local = (folder.path / "local").string();
  ASSERT_TRUE(open_disk_store(shared)->put(key_of("a"), {{"x", bytes_of("no result")}}));
  std::vector<std::unique_ptr<CacheLayer>> layers;
  layers.push_back(nullptr);  // left out before
  layers.push_back(open_layer(shared));
  auto store = layered_store(open_disk_store(local), std::move(layers), LayerUse::kFetch);
  const auto found = store->find(key_of("a").digest());
  ASSERT_TRUE(found);
  store->reject(key_of("a").digest(), *found, "no result");
  EXPECT_FALSE(store->find(key_of("a").digest()));
  ASSERT_TRUE(store->put(key_of("a"), {{"x", bytes_of("result")}}));
  EXPECT_EQ(*store->load(store->find(key_of("a").digest())->front()), *bytes_of("result"));
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

TEST(OutputFile, PipesAreWrittenIntoAndLinksStay) {
  const Folder folder;
  fs::create_directories(folder.path / "there");
  const std::string pipe = (folder.path / "pipe").string(), link = (folder.path / "link").string();
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  std::string read;
  std::thread reader([&] { std::getline(std::ifstream(pipe), read); });
  write_output_file(pipe, *bytes_of("through the pipe"));
  reader.join();
  EXPECT_EQ(read, "through the pipe");
  EXPECT_TRUE(fs::is_fifo(pipe));

  fs::create_symlink("there/file", link);  // leads to nothing yet
  for (const char* text : {"one", "two"}) {
    write_output_file(link, *bytes_of(text));
    EXPECT_TRUE(fs::is_symlink(link));
    EXPECT_TRUE(file_holds((folder.path / "there/file").string(), *bytes_of(text)));
  }
  fs::create_symlink("loop", folder.path / "loop");
  EXPECT_THROW(write_output_file((folder.path / "loop").string(), *bytes_of("x")), InputError);
  EXPECT_TRUE(is_special_file("/dev/stdout"));
  EXPECT_FALSE(is_special_file(link));
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
