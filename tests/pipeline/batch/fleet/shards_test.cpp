#include "pipeline/batch/plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <random>

#include "format/base/errors.h"

namespace texmesh::shards_test {

using Variables = std::map<std::string, std::string>;

Shard read(const std::string& text, const Variables& variables) {
  return read_shard(text, [&](const char* name) -> const char* {
    const auto it = variables.find(name);
    return it == variables.end() ? nullptr : it->second.c_str();
  });
}
std::string refusal(const std::string& text, const Variables& variables) {
  try {
    const Shard s = read(text, variables);
    return "accepted " + std::to_string(s.index) + "/" + std::to_string(s.count);
  } catch (const InputError& e) {
    return e.found();
  }
}
Variables slurm(const std::string& id, const std::string& count, const std::string& least,
                const std::string& most, const std::string& step = "1") {
  return {{"SLURM_ARRAY_TASK_ID", id},
          {"SLURM_ARRAY_TASK_COUNT", count},
          {"SLURM_ARRAY_TASK_MIN", least},
          {"SLURM_ARRAY_TASK_MAX", most},
          {"SLURM_ARRAY_TASK_STEP", step}};
}

TEST(Shards, WhatTheUserWritesNeedsNoVariables) {
  EXPECT_EQ(read("2/8", {}), (Shard{2, 8}));
  EXPECT_EQ(read("0/1", slurm("5", "8", "0", "7")), (Shard{0, 1}));
  for (const char* wrong : {"", "8/8", "-1/8", "1/0", "1/1000001", "1", "/", "1/", "/2", "auto/", "auto/0",
                            "auto/x", "1/2/3", " 1/2", "1/2 ", "0x1/2"})
    EXPECT_EQ(refusal(wrong, {}), wrong);
}

TEST(Shards, EveryEngineIsUnderstood) {
  EXPECT_EQ(read("auto", slurm("5", "8", "0", "7")), (Shard{5, 8}));
  EXPECT_EQ(read("auto", slurm("1", "8", "1", "8")), (Shard{0, 8}));
  EXPECT_EQ(read("auto", slurm("9", "4", "0", "9", "3")), (Shard{3, 4}));
}

TEST(Shards, EnginesThatTellNoCountNeedOne) {
  EXPECT_EQ(read("auto", {{"AWS_BATCH_JOB_ARRAY_INDEX", "3"}, {"AWS_BATCH_JOB_ARRAY_SIZE", "10"}}),
            (Shard{3, 10}));
  EXPECT_EQ(read("auto/10", {{"AWS_BATCH_JOB_ARRAY_INDEX", "3"}}), (Shard{3, 10}));
  EXPECT_EQ(read("auto/4", {{"JOB_COMPLETION_INDEX", "3"}}), (Shard{3, 4}));
  EXPECT_EQ(refusal("auto", {{"JOB_COMPLETION_INDEX", "3"}}), "JOB_COMPLETION_INDEX=3");
  EXPECT_EQ(refusal("auto/3", {{"JOB_COMPLETION_INDEX", "3"}}), "JOB_COMPLETION_INDEX=3, --shard auto/3");
}

TEST(Shards, NothingAndContradictionsAreRefusedWithWhatWasFound) {
  EXPECT_EQ(refusal("auto", {}), "none of them set");
  EXPECT_EQ(refusal("auto", {{"JOB_COMPLETION_INDEX", ""}}), "none of them set");
  EXPECT_EQ(refusal("auto", {{"AWS_BATCH_JOB_ARRAY_INDEX", "1"},
                             {"AWS_BATCH_JOB_ARRAY_SIZE", "4"},
                             {"JOB_COMPLETION_INDEX", "2"}}),
            "AWS_BATCH_JOB_ARRAY_INDEX=1 AWS_BATCH_JOB_ARRAY_SIZE=4, JOB_COMPLETION_INDEX=2");
  EXPECT_EQ(refusal("auto/5", {{"AWS_BATCH_JOB_ARRAY_INDEX", "1"}, {"AWS_BATCH_JOB_ARRAY_SIZE", "4"}}),
            "AWS_BATCH_JOB_ARRAY_INDEX=1 AWS_BATCH_JOB_ARRAY_SIZE=4, --shard auto/5");
  for (const char* number : {"x", "-1", "1.5", "99999999999", "1 "})
    EXPECT_EQ(refusal("auto/5", {{"JOB_COMPLETION_INDEX", number}}), number);
  // Tasks 3 and 5 of an array run again: as an array of two they would be other shards.
  EXPECT_NE(refusal("auto", slurm("3", "2", "3", "5", "2")).find("SLURM_ARRAY_TASK_MIN=3"),
            std::string::npos);
  EXPECT_NE(refusal("auto", slurm("0", "2", "0", "5")).find("SLURM_ARRAY_TASK_COUNT=2"), std::string::npos);
  EXPECT_NE(refusal("auto", slurm("9", "8", "0", "7")).find("SLURM_ARRAY_TASK_ID=9"), std::string::npos);
}

TEST(Shards, NoShardCostsMoreThanTheMeanAndOneModel) {
  std::mt19937 random(7);
  std::vector<std::string> names;
  for (int i = 0; i < 3000; ++i) names.push_back("m" + std::to_string(i));
  std::vector<ModelCost> models;
  for (const std::string& name : names)
    models.push_back({name, 1 + (random() % 100 == 0 ? random() % 10'000'000 : random() % 100'000)});
  for (const int shards : {1, 2, 7, 40, 2999, 5000}) {
    const std::vector<int> shard_of = balance_shards(models, shards);
    std::vector<std::uint64_t> cost(static_cast<std::size_t>(shards));
    std::uint64_t all = 0, most = 0;
    for (std::size_t i = 0; i < models.size(); ++i) {
      ASSERT_GE(shard_of[i], 0);
      ASSERT_LT(shard_of[i], shards);
      cost[static_cast<std::size_t>(shard_of[i])] += models[i].cost_us;
      all += models[i].cost_us;
      most = std::max(most, models[i].cost_us);
    }
    for (const std::uint64_t c : cost)
      EXPECT_LE(c, all / static_cast<std::uint64_t>(shards) + most) << shards;
  }
}

TEST(Shards, DependOnNamesAndCostsNotOnTheOrder) {
  std::vector<std::string> names;
  for (int i = 0; i < 100; ++i) names.push_back("m" + std::to_string(i));
  std::vector<ModelCost> models;
  for (const std::string& name : names) models.push_back({name, 5});  // all alike: names decide
  const std::vector<int> first = balance_shards(models, 7);
  const std::string digest = collection_digest(models);
  std::vector<std::size_t> order(models.size());
  std::iota(order.begin(), order.end(), 0);
  std::shuffle(order.begin(), order.end(), std::mt19937(3));
  std::vector<ModelCost> shuffled;
  for (const std::size_t i : order) shuffled.push_back(models[i]);
  const std::vector<int> second = balance_shards(shuffled, 7);
  for (std::size_t k = 0; k < order.size(); ++k) EXPECT_EQ(second[k], first[order[k]]);
  EXPECT_EQ(collection_digest(shuffled), digest);
  shuffled[3].cost_us = 6;
  EXPECT_NE(collection_digest(shuffled), digest);
}

TEST(Shards, ModelsWithoutACostAreSpread) {
  std::vector<std::string> names{"a", "b", "c", "d"};
  std::vector<ModelCost> models;
  for (const std::string& name : names) models.push_back({name, 0});
  std::vector<int> shards = balance_shards(models, 4);
  std::sort(shards.begin(), shards.end());
  EXPECT_EQ(shards, (std::vector<int>{0, 1, 2, 3}));
}

}  // namespace texmesh::shards_test
