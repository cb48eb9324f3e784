#include "pipeline/graph/graph_run.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <set>
#include <utility>

namespace texmesh {
namespace {

using Text = std::string;

/// A graph of text stages: left and right read the source, middle is derived, join reads all.
struct Fake {
  std::mutex mutex;
  std::multiset<std::string> ran;
  std::string left_suffix;  // changes what "left" computes without changing its key: a silent change of code
  std::string fail;

  StageOutputs text(const std::string& name, Text value) {
    {
      const std::lock_guard lock(mutex);
      ran.insert(name);
    }
    if (fail == name) throw StageError(name, "", "success", "failure");
    Notes notes;
    if (name == "left") add_warning(notes, "left-note", "", value);
    return {{object(std::move(value))}, notes};
  }

  std::vector<Stage> table() {
    auto get = [](const StageInputs& in, const char* n) { return in.get<Text>(n); };
    return {
        {"left",
         1,
         "",
         {"source"},
         {artefact<Text>("left")},
         {"ssf.scales"},
         {},
         true,
         [=, this](const StageInputs& in) {
           return text("left", get(in, "source").substr(0, 1) + left_suffix);
         }},
        {"right",
         1,
         "",
         {"source"},
         {artefact<Text>("right")},
         {"zim"},
         {"draco"},
         true,
         [=, this](const StageInputs& in) { return text("right", get(in, "source") + "R"); }},
        {"middle",
         1,
         "",
         {"left", "right"},
         {{"middle", nullptr, nullptr}},
         {},
         {},
         false,
         [=, this](const StageInputs& in) { return text("middle", get(in, "left") + get(in, "right")); }},
        {"join",
         1,
         "",
         {"middle", "left"},
         {artefact<Text>("join")},
         {},
         {},
         true,
         [=, this](const StageInputs& in) {
           return text("join", get(in, "middle") + "+" + get(in, "left"));
         }},
    };
  }

  Text run(Store& store, const Text& source, const CompileOptions& options = {}, int threads = 2,
           Notes* notes = nullptr) {
    ran.clear();
    RunContext context;
    context.threads = threads;
    const std::vector<Stage> stages = table();
    GraphRun graph(stages, options, store, context);
    const std::vector<std::uint8_t> bytes(source.begin(), source.end());
    graph.give("source", object(source), sha256(bytes), bytes.size());
    const Object result = graph.run("join");
    if (notes) *notes = graph.notes();
    return *static_cast<const Text*>(result.get());
  }
};

using Ran = std::multiset<std::string>;

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

TEST(GraphRun, AnEqualResultStopsTheWave) {
  Fake fake;
  MemoryStore store;
  fake.run(store, "abc");
  // "left" sees another source but gives the same text; "right" differs, so middle and join run.
  EXPECT_EQ(fake.run(store, "axy"), "aaxyR+a");
  EXPECT_EQ(fake.ran, (Ran{"join", "left", "middle", "right"}));
  // An option that only "left" reads: it runs, gives the same, and nothing after it does.
  CompileOptions options;
  options.ssf.scales = 7;
  EXPECT_EQ(fake.run(store, "axy", options), "aaxyR+a");
  EXPECT_EQ(fake.ran, Ran{"left"});
  options.ssf.band = 3;  // nobody reads it
  fake.run(store, "axy", options);
  EXPECT_EQ(fake.ran, Ran{});
  options.zim.difference = 30;  // "right" lists the whole section
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
      const auto garbage = std::make_shared<const std::vector<std::uint8_t>>(300, 0x67);
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
  const CompileOptions options;
  GraphRun graph(stages, options, store, context);
  graph.give("source", object(Text("abc")), sha256(std::vector<std::uint8_t>{'a', 'b', 'c'}), 3);
  graph.run("join");
  const Sha256 left = graph.keys().at("left"), join = graph.keys().at("join");
  const auto key = key_from_preimage(*store.preimage(left));
  ASSERT_TRUE(key);
  const auto bytes = [](const char* s) {
    return std::make_shared<const std::vector<std::uint8_t>>(s, s + std::char_traits<char>::length(s));
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
  const CompileOptions options;
  GraphRun graph(stages, options, store, context);
  graph.give("source", object(Text("abc")), sha256({}), 0);
  EXPECT_THROW(graph.run("join"), Cancelled);
  EXPECT_EQ(fake.ran, Ran{});
}

TEST(GraphRun, ExplainsWhatHasChangedSinceTheEarlierRun) {
  Fake fake;
  MemoryStore store;
  const std::vector<Stage> stages = fake.table();
  const auto run = [&](const CompileOptions& options, const StageKeys& earlier, StageKeys* keys) {
    std::map<std::string, StageExplanation> told;
    const RunContext context;
    GraphRun graph(stages, options, store, context);
    graph.give("source", object(Text("abc")), sha256({}), 3);
    graph.explain(earlier, [&](const Stage& s, const StageExplanation& e) { told[s.name] = e; });
    graph.run("join");
    if (keys) *keys = graph.keys();
    return told;
  };
  using Verdict = StageExplanation::Verdict;
  StageKeys keys;
  auto told = run({}, {}, &keys);
  EXPECT_EQ(told.at("left").verdict, Verdict::kRuns);
  EXPECT_FALSE(told.at("left").has_history);
  EXPECT_EQ(keys.size(), 3u);  // the derived stage has no entry of its own
  told = run({}, keys, nullptr);
  EXPECT_EQ(told.at("left").verdict, Verdict::kHit);
  CompileOptions options;
  options.ssf.scales = 7;
  told = run(options, keys, nullptr);
  EXPECT_EQ(told.at("left").verdict, Verdict::kRuns);
  EXPECT_TRUE(told.at("left").has_history);
  ASSERT_EQ(told.at("left").changes.size(), 1u);
  EXPECT_EQ(told.at("left").changes[0].label, "option ssf.scales");
  EXPECT_EQ(told.at("left").changes[0].from, "20");
  EXPECT_EQ(told.at("left").changes[0].to, "7");
  EXPECT_EQ(told.at("join").verdict, Verdict::kHit);  // left gave the same
}

TEST(GraphRun, AForecastRunsNothing) {
  Fake fake;
  MemoryStore store;
  const std::vector<Stage> stages = fake.table();
  const auto forecast = [&](const CompileOptions& options) {
    const RunContext context;
    GraphRun graph(stages, options, store, context);
    graph.give("source", object(Text("abc")), sha256({}), 3);
    std::map<std::string, StageExplanation> told;
    for (const auto& [stage, e] : graph.forecast()) told[stage->name] = e;
    return told;
  };
  using Verdict = StageExplanation::Verdict;
  auto told = forecast({});
  EXPECT_EQ(told.at("left").verdict, Verdict::kRuns);
  EXPECT_EQ(told.at("join").verdict, Verdict::kUnknown);
  EXPECT_FALSE(told.at("join").waits_for.empty());
  EXPECT_FALSE(told.contains("middle"));
  EXPECT_EQ(fake.ran, Ran{});
  {
    const RunContext context;
    const CompileOptions options;
    GraphRun graph(stages, options, store, context);
    graph.give("source", object(Text("abc")), sha256({}), 3);
    graph.run("join");
  }
  for (const auto& [name, e] : forecast({})) EXPECT_EQ(e.verdict, Verdict::kHit) << name;
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

  /// Answers when both results have been asked for. Waits for a bounded time: where the graph lets one consumer
  /// ask at a time, the second request comes only after the first answer.
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
  LostResults store;
  std::atomic<int> runs{0};
  int unguarded = 0;  // as the state behind a source is; the thread sanitizer watches it
  const auto split = [&](const StageInputs& in) {
    ++runs;
    ++unguarded;
    const Text& text = in.get<Text>("source");
    return StageOutputs{{object(text.substr(0, 1)), object(text.substr(1))}, {}};
  };
  const auto copy_of = [](const std::string& input) {
    return [input](const StageInputs& in) { return StageOutputs{{object(in.get<Text>(input) + "'")}, {}}; };
  };
  const auto join = [](const StageInputs& in) {
    return StageOutputs{{object(in.get<Text>("first") + in.get<Text>("second"))}, {}};
  };
  const std::vector<Stage> stages{
      {"split", 1, "", {"source"}, {artefact<Text>("split.a"), artefact<Text>("split.b")}, {}, {}, true, split},
      {"first", 1, "", {"split.a"}, {artefact<Text>("first")}, {"ssf"}, {}, true, copy_of("split.a")},
      {"second", 1, "", {"split.b"}, {artefact<Text>("second")}, {"ssf"}, {}, true, copy_of("split.b")},
      {"join", 1, "", {"first", "second"}, {artefact<Text>("join")}, {}, {}, true, join}};
  const auto run = [&](const CompileOptions& options) {
    RunContext context;
    context.threads = 2;
    GraphRun graph(stages, options, store, context);
    graph.give("source", object(Text("abc")), sha256({}), 3);
    return *static_cast<const Text*>(graph.run("join").get());
  };
  EXPECT_EQ(run({}), "a'bc'");
  EXPECT_EQ(runs, 1);
  store.loses = true;
  CompileOptions options;  // both consumers run again; the stage before them is found in the store
  options.ssf.scales = 7;
  EXPECT_EQ(run(options), "a'bc'");
  EXPECT_EQ(runs, 2);
  EXPECT_EQ(unguarded, 2);
}

/// A collection of fake models, "geometry|texture" each: import splits them, one stage works on either half
/// (that of the texture reads zim.difference, and only textures that begin with 'x' depend on it), join takes
/// both.
struct FakeCollection {
  std::multiset<std::string> ran;
  std::vector<Text> models;
  MemoryStore store;

  StageOutputs text(const std::string& name, std::vector<Text> values) {
    ran.insert(name);
    StageOutputs outputs;
    for (Text& v : values) outputs.objects.push_back(object(std::move(v)));
    return outputs;
  }

  std::vector<Stage> table() {
    const auto import = [this](const StageInputs& in) {
      const Text& s = in.get<Text>("source");
      return text("import", {s.substr(0, s.find('|')), s.substr(s.find('|') + 1)});
    };
    const auto geometry = [this](const StageInputs& in) {
      return text("geometry", {in.get<Text>("import.geometry") + "G"});
    };
    const auto texture = [this](const StageInputs& in) {
      const Text& t = in.get<Text>("import.texture");
      return text("texture",
                  {t + "T" + (t.starts_with('x') ? std::to_string(in.options.zim.difference) : Text())});
    };
    const auto join = [this](const StageInputs& in) {
      return text("join", {in.get<Text>("geometry") + in.get<Text>("texture")});
    };
    return {{"import",
             1,
             "",
             {"source"},
             {artefact<Text>("import.geometry"), artefact<Text>("import.texture")},
             {},
             {},
             true,
             import},
            {"geometry", 1, "", {"import.geometry"}, {artefact<Text>("geometry")}, {}, {}, true, geometry},
            {"texture", 1, "", {"import.texture"}, {artefact<Text>("texture")}, {"zim"}, {}, true, texture},
            {"join", 1, "", {"geometry", "texture"}, {artefact<Text>("join")}, {}, {}, true, join}};
  }

  void run(const CompileOptions& options = {}) {
    ran.clear();
    const std::vector<Stage> stages = table();
    const RunContext context;
    for (const Text& source : models) {
      GraphRun graph(stages, options, store, context);
      const std::vector<std::uint8_t> bytes(source.begin(), source.end());
      graph.give("source", object(source), sha256(bytes), bytes.size());
      graph.run("join");
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
  CompileOptions options;  // one option: its stage everywhere, and what follows where the bytes differ
  options.zim.difference = 31;
  collection.run(options);
  EXPECT_EQ(collection.ran.count("texture"), static_cast<std::size_t>(kModels));
  EXPECT_EQ(collection.ran.count("join"), static_cast<std::size_t>(kSensitive));
  EXPECT_EQ(collection.ran.size(), static_cast<std::size_t>(kModels + kSensitive));
}

}  // namespace
}  // namespace texmesh
