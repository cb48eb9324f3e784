#include "stages/base/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <vector>

#include "format/base/errors.h"

namespace texmesh::parallel_test {

RunContext threads(int count) {
  RunContext context;
  context.threads = count;
  return context;
}

TEST(Parallel, EveryIndexIsVisitedOnce) {
  for (const int count : {1, 2, 8})
    for (const std::size_t size : {0u, 1u, 7u, 1000u}) {
      std::vector<int> visits(size, 0);
      parallel_for(threads(count), size, 3, [&](std::size_t begin, std::size_t end) {
        EXPECT_LE(begin, end);
        for (std::size_t i = begin; i < end; ++i) ++visits[i];
      });
      EXPECT_EQ(visits, std::vector<int>(size, 1)) << size << " on " << count << " threads";
    }
}

TEST(Parallel, SumsAreTheSameForAnyNumberOfThreads) {
  const auto part = [](std::size_t begin, std::size_t end) {
    double sum = 0;
    for (std::size_t i = begin; i < end; ++i) sum += 1.0 / static_cast<double>(i + 1);
    return sum;
  };
  const double alone = parallel_sum(threads(1), 100'003, 1000, part);
  EXPECT_NEAR(alone, 12.09, 0.01);  // ln n + 0.5772
  EXPECT_EQ(parallel_sum(threads(8), 100'003, 1000, part), alone);
}

TEST(Parallel, AnExceptionOfAPieceIsRethrown) {
  for (const int count : {1, 4})
    EXPECT_THROW(parallel_for(threads(count), 100, 1,
                              [](std::size_t begin, std::size_t) {
                                if (begin == 50) throw std::runtime_error("piece 50");
                              }),
                 std::runtime_error);
}

TEST(Parallel, CancellationEndsTheLoop) {
  const std::atomic<bool> cancelled = true;
  for (const int count : {1, 4}) {
    RunContext context = threads(count);
    context.cancelled = &cancelled;
    EXPECT_THROW(parallel_for(context, 100, 1, [](std::size_t, std::size_t) {}), Cancelled);
  }
}

}  // namespace texmesh::parallel_test
