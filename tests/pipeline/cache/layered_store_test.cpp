// Caches behind the own one.
#include "pipeline/cache/cache_layer.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "pipeline/cache/cache_files.h"
#include "pipeline/cache/disk_store.h"
#include "tests/pipeline/cache/cache_fixtures.h"

namespace texmesh::layered_store_test {
namespace fs = std::filesystem;
using namespace testing;  // NOLINT: fixtures

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

}  // namespace texmesh::layered_store_test
