#include "pipeline/graph/graph_run.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <set>
#include <stdexcept>
#include <utility>

#include "pipeline/graph/memory_store.h"
#include "pipeline/graph/stage.h"
#include "tests/pipeline/graph/fake_graph.h"

namespace texmesh::graph_run_test {

using namespace testing;  // NOLINT: the fake graph

/// A store without claims over another one.
struct Unclaimed : Store {
  explicit Unclaimed(MemoryStore& s) : store(s) {}
  std::optional<std::vector<StoredBlob>> find(const Sha256& k) override { return store.MemoryStore::find(k); }
  SharedBytes load(const StoredBlob& b) override { return store.MemoryStore::load(b); }
  bool put(const Key& k, const std::vector<std::pair<std::string, SharedBytes>>& o) override {
    return store.MemoryStore::put(k, o);
  }
  std::optional<std::string> preimage(const Sha256& k) override { return store.MemoryStore::preimage(k); }
  std::optional<std::string> find_note(const Sha256& k) override { return store.MemoryStore::find_note(k); }
  bool put_note(const Sha256& k, const std::string& t) override { return store.MemoryStore::put_note(k, t); }
  MemoryStore& store;
};

TEST(GraphRun, RunsEverythingOnceThenNothing) {
  Fake fake;
  MemoryStore store;
  Notes first, second;
  EXPECT_EQ(fake.run(store, "abc", {}, 2, &first), "aabcR+a");
  EXPECT_EQ(fake.ran, (Ran{"join", "left", "middle", "right"}));
  EXPECT_EQ(fake.run(store, "abc", {}, 2, &second), "aabcR+a");
  EXPECT_EQ(fake.ran, Ran{});
  EXPECT_EQ(first, second);  // notes come back from the store
  ASSERT_EQ(first.size(), 1u);
}

TEST(GraphRun, RunsOnce) {
  Fake fake;
  MemoryStore store;
  const RunContext context;
  const std::vector<Stage> stages = fake.table();
  GraphRun graph(stages, store, context);
  graph.give(kSource, Text("s"), sha256({}), 1);
  graph.run(kJoin);
  const Ran ran = fake.ran;
  EXPECT_THROW(graph.run(kJoin), std::logic_error);
  EXPECT_EQ(fake.ran, ran);
}

TEST(GraphRun, AnEqualResultStopsTheWave) {
  Fake fake;
  MemoryStore store;
  fake.run(store, "abc");
  // "left" sees another source but gives the same text; "right" differs, so middle and join run.
  EXPECT_EQ(fake.run(store, "axy"), "aaxyR+a");
  EXPECT_EQ(fake.ran, (Ran{"join", "left", "middle", "right"}));
  // An option that only "left" reads: it runs, gives the same, and nothing after it does.
  FakeOptions options;
  options.scales = 7;
  EXPECT_EQ(fake.run(store, "axy", options), "aaxyR+a");
  EXPECT_EQ(fake.ran, Ran{"left"});
  options.unread = 3;
  fake.run(store, "axy", options);
  EXPECT_EQ(fake.ran, Ran{});
  options.zim.difference = 30;  // "right" declares the whole section
  fake.run(store, "axy", options);
  EXPECT_EQ(fake.ran, Ran{"right"});
}

TEST(GraphRun, WorksWithoutAStoreAndOnAnyNumberOfThreads) {
  for (int threads : {1, 2, 8}) {
    Fake fake;
    NullStore store;
    EXPECT_EQ(fake.run(store, "abc", {}, threads), "aabcR+a");
    EXPECT_EQ(fake.ran, (Ran{"join", "left", "middle", "right"})) << threads;
  }
}

TEST(GraphRun, AFailureIsReportedAndNothingAfterItRuns) {
  Fake fake;
  MemoryStore store;
  fake.fail = "right";
  EXPECT_THROW(fake.run(store, "abc"), StageError);
  EXPECT_FALSE(fake.ran.contains("join"));
  fake.fail = "";
  EXPECT_EQ(fake.run(store, "abc"), "aabcR+a");
  EXPECT_FALSE(fake.ran.contains("left"));  // its result was kept
}

TEST(GraphRun, ALostBlobIsComputedAgain) {
  struct Forgetful : MemoryStore {
    std::string lost;
    std::optional<std::vector<StoredBlob>> find(const Sha256& key) override {
      auto run = MemoryStore::find(key);
      if (run && !run->empty() && run->front().name == lost) return std::nullopt;
      return run;
    }
  } store;
  Fake fake;
  fake.run(store, "abc");
  store.lost = "join";
  EXPECT_EQ(fake.run(store, "abc"), "aabcR+a");
  EXPECT_EQ(fake.ran, (Ran{"join", "middle"}));  // middle is never stored
}

/// Somebody has put what is no result, under the right keys and with the right digests.
TEST(GraphRun, AResultThatDoesNotDecodeIsComputedAgainAndReplaced) {
  struct Poisoned : MemoryStore {
    std::string victim, notes_of;
    std::multiset<std::string> rejected;
    bool put(const Key& key, const std::vector<std::pair<std::string, SharedBytes>>& outputs) override {
      auto wrong = outputs;
      const auto garbage = std::make_shared<const Bytes>(300, 0x67);
      if (outputs.front().first == victim) wrong.front().second = garbage;
      if (outputs.front().first == notes_of) wrong.back().second = garbage;
      return MemoryStore::put(key, wrong);
    }
    void reject(const Sha256& key, const std::vector<StoredBlob>& found, const std::string& why) override {
      rejected.insert(found.front().name);
      MemoryStore::reject(key, found, why);
    }
  };
  for (int threads : {1, 8})
    for (const std::string victim : {"left", "right", "join", "notes of left"}) {
      Poisoned store;
      Fake fake;
      store.victim = victim;
      if (victim == "notes of left") store.notes_of = "left";
      fake.run(store, "abc");
      store.victim = store.notes_of = "";
      Notes notes;
      EXPECT_EQ(fake.run(store, "abc", {}, threads, &notes), "aabcR+a") << victim;
      EXPECT_EQ(notes.size(), 1u);
      EXPECT_EQ(store.rejected, (std::multiset<std::string>{victim == "notes of left" ? "left" : victim}));
      const auto rejected = store.rejected;
      fake.run(store, "abc");  // what was computed meanwhile stands in the right places
      EXPECT_EQ(fake.run(store, "abc", {}, threads), "aabcR+a") << victim;
      EXPECT_EQ(fake.ran, Ran{}) << victim;
      EXPECT_EQ(store.rejected, rejected);
    }
}

/// The poisoned result was used by nobody yet: what comes after it gets the key of the right one at once.
TEST(GraphRun, WhatFollowsAResultThatDoesNotDecodeIsKeptUnderItsRightKey) {
  MemoryStore store;
  Fake fake;
  fake.run(store, "abc");
  MemoryStore poisoned;
  const std::vector<Stage> stages = fake.table();
  const RunContext context;
  GraphRun graph(stages, store, context);
  graph.give(kSource, Text("abc"), sha256(Bytes{'a', 'b', 'c'}), 3);
  graph.run(kJoin);
  const Sha256 left = graph.keys().at("left"), join = graph.keys().at("join");
  const auto key = key_from_preimage(*store.preimage(left));
  ASSERT_TRUE(key);
  const auto bytes = [](const char* s) {
    return std::make_shared<const Bytes>(s, s + std::char_traits<char>::length(s));
  };
  auto outputs = *store.find(left);
  poisoned.put(*key, {{"left", bytes("no text")}, {"left.notes", store.load(outputs.back())}});
  EXPECT_EQ(fake.run(poisoned, "abc"), "aabcR+a");
  EXPECT_TRUE(poisoned.find(join));
  EXPECT_EQ(fake.run(poisoned, "abc"), "aabcR+a");
  EXPECT_EQ(fake.ran, Ran{});
}

TEST(GraphRun, CancelledBeforeAnyWork) {
  Fake fake;
  MemoryStore store;
  const std::atomic<bool> cancelled{true};
  RunContext context;
  context.cancelled = &cancelled;
  const std::vector<Stage> stages = fake.table();
  GraphRun graph(stages, store, context);
  graph.give(kSource, Text("abc"), sha256({}), 0);
  EXPECT_THROW(graph.run(kJoin), Cancelled);
  EXPECT_EQ(fake.ran, Ran{});
}

TEST(GraphRun, WaitsForWhoeverComputesTheSameAndTakesTheResult) {
  // The claim is given only after somebody else has put the result of "left".
  struct Contended : MemoryStore {
    Fake* fake = nullptr;
    bool waited = false;
    std::unique_ptr<Claim> claim(const Sha256&, const RunContext&) override {
      if (!std::exchange(waited, true)) {
        Unclaimed mine(*this);
        fake->run(mine, "abc");
      }
      return std::make_unique<Claim>();
    }
  } store;
  Fake first, other;
  store.fake = &other;
  EXPECT_EQ(first.run(store, "abc", {}, 1), "aabcR+a");
  EXPECT_EQ(first.ran, Ran{});  // everything came from the other one
  EXPECT_TRUE(other.ran.contains("left"));
}

/// Two consumers of one stage want its two results at once, and the store has lost both of them.
struct LostResults : MemoryStore {
  std::mutex lost_mutex;
  std::condition_variable changed;
  std::set<std::string> asked_for;
  bool loses = false;

  /// Answers when both results have been asked for. Waits for a bounded time: where the graph lets one
  /// consumer ask at a time, the second request comes only after the first answer.
  SharedBytes load(const StoredBlob& blob) override {
    if (!loses || !blob.name.starts_with("split.") || blob.name.ends_with("notes"))
      return MemoryStore::load(blob);
    std::unique_lock lock(lost_mutex);
    asked_for.insert(blob.name);
    changed.notify_all();
    changed.wait_for(lock, std::chrono::milliseconds(500), [&] { return asked_for.size() == 2; });
    return nullptr;
  }
};

TEST(GraphRun, AStageWhoseResultsAreLostRunsOnceForAllItsConsumers) {
  static constexpr Artefact<Text> kA{"split.a"}, kB{"split.b"}, kFirst{"first"}, kSecond{"second"};
  LostResults store;
  std::atomic<int> runs{0};
  int unguarded = 0;  // as the state behind a source is; the thread sanitizer watches it
  const auto split = [&](const Text& text, const RunContext&) {
    ++runs;
    ++unguarded;
    return Results<Text, Text>({text.substr(0, 1), text.substr(1)}, {});
  };
  const auto copy = [](const Text& text, int, const RunContext&) { return text + "'"; };
  const auto join = [](const Text& a, const Text& b, const RunContext&) { return a + b; };
  const auto run = [&](int changed) {
    const OptionValue option("ssf.scales", changed);
    const std::vector<Stage> stages{
        make_stage({"split", 1, ""}, inputs(kSource), outputs(kA, kB), options(), {}, split),
        make_stage({"first", 1, ""}, inputs(kA), outputs(kFirst), options(option), {}, copy),
        make_stage({"second", 1, ""}, inputs(kB), outputs(kSecond), options(option), {}, copy),
        make_stage({"join", 1, ""}, inputs(kFirst, kSecond), outputs(kJoin), options(), {}, join)};
    RunContext context;
    context.threads = 2;
    GraphRun graph(stages, store, context);
    graph.give(kSource, Text("abc"), sha256({}), 3);
    return *graph.run(kJoin);
  };
  EXPECT_EQ(run(20), "a'bc'");
  EXPECT_EQ(runs, 1);
  store.loses = true;
  EXPECT_EQ(run(7), "a'bc'");  // both consumers run again; the stage before them is found in the store
  EXPECT_EQ(runs, 2);
  EXPECT_EQ(unguarded, 2);
}

TEST(GraphRun, ArtefactsOfOtherTypesAreRefusedBeforeAnythingRuns) {
  static constexpr Artefact<int> kLeftNumber{"left"}, kSourceNumber{"source"}, kJoinNumber{"join"};
  Fake fake;
  MemoryStore store;
  const RunContext context;
  std::vector<Stage> stages = fake.table();
  {
    GraphRun graph(stages, store, context);
    EXPECT_THROW(graph.give(kSourceNumber, 3, sha256({}), 0), std::logic_error);
    EXPECT_THROW(graph.run(kJoinNumber), std::logic_error);
  }
  stages.push_back(make_stage({"reader", 1, ""}, inputs(kLeftNumber), outputs(Artefact<Text>{"reader"}),
                              options(), {}, [](int, const RunContext&) { return Text(); }));
  EXPECT_THROW(GraphRun(stages, store, context), std::logic_error);
  stages.pop_back();
  stages.push_back(stages[0]);  // "left" would be made twice
  EXPECT_THROW(GraphRun(stages, store, context), std::logic_error);
  EXPECT_EQ(fake.ran, Ran{});
}

TEST(GraphRun, TheKeyHoldsEveryFieldOfWhatTheFunctionGets) {
  ZimFake zim;
  zim.share = 0.25;
  const Stage stage = make_stage({"s", 1, ""}, inputs(kSource), outputs(kLeft),
                                 options(OptionValue("zim", zim), OptionValue("ladder.mode", Text("jpeg"))),
                                 {}, [](const Text&, const ZimFake& z, const Text& mode, const RunContext&) {
                                   return mode + std::to_string(z.difference);
                                 });
  ASSERT_EQ(stage.options.size(), 2u);
  EXPECT_EQ(stage.options[0].fields, (OptionTexts{{"zim.difference", "20"}, {"zim.share", "0.25"}}));
  EXPECT_EQ(stage.options[1].fields, (OptionTexts{{"ladder.mode", "\"jpeg\""}}));
  const StageResult result = stage.run(std::vector<Object>{make_object(Text())}, {});
  EXPECT_EQ(*static_cast<const Text*>(result.objects.at(0).get()), "jpeg20");
}

/// A collection of fake models, "geometry|texture" each: import splits them, one stage works on either half
/// (that of the texture reads zim.difference, and only textures that begin with 'x' depend on it), join takes
/// both.
struct FakeCollection {
  std::multiset<std::string> ran;
  std::vector<Text> models;
  MemoryStore store;

  std::vector<Stage> table(const FakeOptions& o) {
    static constexpr Artefact<Text> kShape{"import.geometry"}, kImage{"import.texture"},
        kGeometry{"geometry"}, kTexture{"texture"};
    const auto import = [this](const Text& s, const RunContext&) {
      ran.insert("import");
      return Results<Text, Text>({s.substr(0, s.find('|')), s.substr(s.find('|') + 1)}, {});
    };
    const auto geometry = [this](const Text& shape, const RunContext&) {
      ran.insert("geometry");
      return shape + "G";
    };
    const auto texture = [this](const Text& t, const ZimFake& zim, const RunContext&) {
      ran.insert("texture");
      return t + "T" + (t.starts_with('x') ? std::to_string(zim.difference) : Text());
    };
    const auto join = [this](const Text& a, const Text& b, const RunContext&) {
      ran.insert("join");
      return a + b;
    };
    return {make_stage({"import", 1, ""}, inputs(kSource), outputs(kShape, kImage), options(), {}, import),
            make_stage({"geometry", 1, ""}, inputs(kShape), outputs(kGeometry), options(), {}, geometry),
            make_stage({"texture", 1, ""}, inputs(kImage), outputs(kTexture),
                       options(OptionValue("zim", o.zim)), {}, texture),
            make_stage({"join", 1, ""}, inputs(kGeometry, kTexture), outputs(kJoin), options(), {}, join)};
  }

  void run(const FakeOptions& o = {}) {
    ran.clear();
    const std::vector<Stage> stages = table(o);
    const RunContext context;
    for (const Text& source : models) {
      GraphRun graph(stages, store, context);
      const Bytes bytes(source.begin(), source.end());
      graph.give(kSource, source, sha256(bytes), bytes.size());
      graph.run(kJoin);
    }
  }
};

TEST(GraphRun, OfAThousandModelsOnlyWhatDependsOnAChangeRuns) {
  FakeCollection collection;
  constexpr int kModels = 1000, kSensitive = 100;
  for (int i = 0; i < kModels; ++i)
    collection.models.push_back("g" + std::to_string(i) + "|" + (i < kSensitive ? "x" : "t") +
                                std::to_string(i));
  collection.run();
  EXPECT_EQ(collection.ran.size(), 4u * kModels);
  collection.run();
  EXPECT_EQ(collection.ran, Ran{});
  collection.models[617] = "g617|another";  // one texture of one model
  collection.run();
  EXPECT_EQ(collection.ran, (Ran{"import", "join", "texture"}));
  FakeOptions options;  // one option: its stage everywhere, and what follows where the bytes differ
  options.zim.difference = 31;
  collection.run(options);
  EXPECT_EQ(collection.ran.count("texture"), static_cast<std::size_t>(kModels));
  EXPECT_EQ(collection.ran.count("join"), static_cast<std::size_t>(kSensitive));
  EXPECT_EQ(collection.ran.size(), static_cast<std::size_t>(kModels + kSensitive));
}

}  // namespace texmesh::graph_run_test
