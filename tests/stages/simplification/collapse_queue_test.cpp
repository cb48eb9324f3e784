#include "stages/simplification/collapse_engine.h"

#include <gtest/gtest.h>

#include <utility>
#include <vector>

namespace texmesh::collapse_queue_test {

TEST(Removable, TellsPointsFromComponents) {
  const Removable point = Removable::point(7), component = Removable::component(7);
  EXPECT_FALSE(point.is_component());
  EXPECT_TRUE(component.is_component());
  EXPECT_EQ(point.index(), 7u);
  EXPECT_EQ(component.index(), 7u);
  EXPECT_NE(point, component);
  EXPECT_LT(Removable::point(8), component) << "of equal keys points come first";
}

TEST(CollapseQueue, PointsAndComponentsComeOutByKeyThenByIndex) {
  CollapseQueue queue(4, 3);
  queue.append(Removable::component(0), 1);
  queue.append(Removable::point(3), 1);
  queue.append(Removable::point(0), 5);
  queue.append(Removable::component(2), 0.5);
  queue.append(Removable::point(2), 1);
  queue.order();
  EXPECT_FALSE(queue.contains(Removable::point(1)));
  EXPECT_FALSE(queue.contains(Removable::component(1)));
  queue.set(Removable::point(1), 9);
  queue.set(Removable::point(0), 0.25);
  EXPECT_EQ(queue.key(Removable::point(0)), 0.25);
  queue.erase(Removable::point(3));
  queue.erase(Removable::point(3));  // which is not there
  std::vector<std::pair<bool, std::uint32_t>> out;
  while (!queue.empty()) {
    const Removable top = queue.top();
    out.emplace_back(top.is_component(), top.index());
    queue.erase(top);
  }
  EXPECT_EQ(out, (std::vector<std::pair<bool, std::uint32_t>>{
                     {false, 0}, {true, 2}, {false, 2}, {true, 0}, {false, 1}}));
}

}  // namespace texmesh::collapse_queue_test
