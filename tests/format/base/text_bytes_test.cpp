#include "format/base/text_bytes.h"

#include <gtest/gtest.h>

namespace texmesh::text_bytes_test {

using Pieces = std::vector<std::string_view>;

TEST(PiecesOf, AreOneMoreThanSeparators) {
  EXPECT_EQ(pieces_of("a/bc/d", '/'), (Pieces{"a", "bc", "d"}));
  EXPECT_EQ(pieces_of("", '/'), Pieces{""});
  EXPECT_EQ(pieces_of("/a//", '/'), (Pieces{"", "a", "", ""}));
}

TEST(Counted, HasThePluralBehindAllNumbersButOne) {
  EXPECT_EQ(counted(1, "triangle"), "1 triangle");
  EXPECT_EQ(counted(0, "triangle"), "0 triangles");
  EXPECT_EQ(counted(2, "vertex", "vertices"), "2 vertices");
}

}  // namespace texmesh::text_bytes_test
