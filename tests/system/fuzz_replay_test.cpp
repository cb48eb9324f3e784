// All fuzz targets (tests/fuzz/) over their seeds, the inputs that once did harm, and mutations of both. A
// target aborts where a reader does anything but answer or throw its own error.
#include <gtest/gtest.h>

#include <ctime>

#include "tests/fuzz/mutate.h"
#include "tests/support/sanitizers.h"

namespace texmesh::fuzz::fuzz_replay_test {

constexpr double kMostSeconds = testing::sanitizers_take(1.0);

class FuzzReplay : public ::testing::TestWithParam<Target> {};

/// Processor time: other tests may run beside this one.
void run_in_time(const Target& target, ByteSpan input) {
  const std::clock_t start = std::clock();
  target.run(input);
  EXPECT_LT(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC, kMostSeconds)
      << input.size() << " bytes";
}

TEST_P(FuzzReplay, SeedsAreAccepted) {
  const std::vector<Bytes> seeds = GetParam().seeds();
  ASSERT_FALSE(seeds.empty());
  for (std::size_t k = 0; k < seeds.size(); ++k) EXPECT_TRUE(GetParam().run(seeds[k])) << "seed " << k;
}

TEST_P(FuzzReplay, WhatOnceDidHarmDoesNone) {
  for (const Bytes& input : regressions(GetParam().name)) run_in_time(GetParam(), input);
}

TEST_P(FuzzReplay, MutationsGiveAnAnswerOrAnError) {
  const Target& target = GetParam();
  std::vector<Bytes> corpus = target.seeds();
  for (Bytes& input : regressions(target.name)) corpus.push_back(std::move(input));
  Random random{2024};
  constexpr std::size_t kRuns = 1500;
  for (std::size_t run = 0; run < kRuns; ++run) {
    const Bytes other = corpus[random.below(corpus.size())];
    run_in_time(target,
                mutate(target, corpus[run % corpus.size()], random, plain_mutator(target, other, random)));
  }
}

INSTANTIATE_TEST_SUITE_P(Targets, FuzzReplay, ::testing::ValuesIn(targets()),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace texmesh::fuzz::fuzz_replay_test
