#include "stages/charts/chart_parts.h"

#include <gtest/gtest.h>

#include "tests/support/meshes.h"

namespace texmesh::pair_queue_test {

TEST(PairQueue, GivesTheCheapestFirstAndOfEqualOnesTheLowest) {
  constexpr std::uint32_t kMembers = 300;
  testing::Random random{5};
  PairQueue queue(kMembers);
  std::size_t in_queue = 0;
  for (int round = 0; round < 6; ++round) {  // more than one sweep
    for (int i = 0; i < 2500; ++i, ++in_queue) {
      const std::uint32_t a = random.next() % kMembers, b = random.next() % kMembers;
      queue.push(a, b, static_cast<double>(random.next() % 50));
    }
    QueuedPair last;
    for (int i = 0; i < 2000; ++i, --in_queue) {
      const QueuedPair e = queue.pop();
      EXPECT_TRUE(e.a <= e.b && queue.is_fresh(e));
      if (i > 0) ASSERT_FALSE(last < e);
      last = e;
    }
  }
  for (; in_queue > 0; --in_queue) queue.pop();
  EXPECT_TRUE(queue.empty());
}

TEST(PairQueue, SweepsWhatIsStaleAndLosesNothing) {
  PairQueue queue(3);
  queue.push(0, 1, 7);
  for (int i = 0; i < 20000; ++i) queue.push(1, 2, 1), queue.touch(2);
  queue.push(0, 2, 9);
  std::vector<double> fresh;
  std::size_t popped = 0;
  for (; !queue.empty(); ++popped)
    if (const QueuedPair e = queue.pop(); queue.is_fresh(e)) fresh.push_back(static_cast<double>(e.cost));
  EXPECT_EQ(fresh, (std::vector<double>{7, 9}));
  EXPECT_LT(popped, 5000u);
}

}  // namespace texmesh::pair_queue_test
