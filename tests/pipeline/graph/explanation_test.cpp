#include "pipeline/graph/graph_run.h"

#include <gtest/gtest.h>

#include <map>

#include "pipeline/graph/memory_store.h"
#include "tests/pipeline/graph/fake_graph.h"

namespace texmesh::explanation_test {

using namespace testing;  // NOLINT: the fake graph

TEST(Explanation, TellsWhatHasChangedSinceTheEarlierRun) {
  Fake fake;
  MemoryStore store;
  const auto run = [&](const FakeOptions& options, const StageKeys& earlier, StageKeys* keys) {
    std::map<std::string, StageExplanation> told;
    const RunContext context;
    const std::vector<Stage> stages = fake.table(options);
    GraphRun graph(stages, store, context);
    graph.give(kSource, Text("abc"), sha256({}), 3);
    graph.explain(earlier, [&](const Stage& s, const StageExplanation& e) { told[s.name] = e; });
    graph.run(kJoin);
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
  FakeOptions options;
  options.scales = 7;
  told = run(options, keys, nullptr);
  EXPECT_EQ(told.at("left").verdict, Verdict::kRuns);
  EXPECT_TRUE(told.at("left").has_history);
  ASSERT_EQ(told.at("left").changes.size(), 1u);
  EXPECT_EQ(told.at("left").changes[0].label, "option ssf.scales");
  EXPECT_EQ(told.at("left").changes[0].from, "20");
  EXPECT_EQ(told.at("left").changes[0].to, "7");
  EXPECT_EQ(told.at("join").verdict, Verdict::kHit);  // left gave the same
}

TEST(Explanation, AForecastRunsNothing) {
  Fake fake;
  MemoryStore store;
  const auto forecast = [&](const FakeOptions& options) {
    const RunContext context;
    const std::vector<Stage> stages = fake.table(options);
    GraphRun graph(stages, store, context);
    graph.give(kSource, Text("abc"), sha256({}), 3);
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
    const std::vector<Stage> stages = fake.table();
    GraphRun graph(stages, store, context);
    graph.give(kSource, Text("abc"), sha256({}), 3);
    graph.run(kJoin);
  }
  for (const auto& [name, e] : forecast({})) EXPECT_EQ(e.verdict, Verdict::kHit) << name;
}

}  // namespace texmesh::explanation_test
