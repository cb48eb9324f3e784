#include "pipeline/graph/store.h"

#include <gtest/gtest.h>

namespace texmesh::key_test {

Key key_of(const std::string& option) { return Key("ladder", 3).add("option ladder.rungs", option); }

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

}  // namespace texmesh::key_test
