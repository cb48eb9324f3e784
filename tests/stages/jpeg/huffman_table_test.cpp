#include "stages/jpeg/jpeg_stream.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/meshes.h"

namespace texmesh::huffman_table_test {

using testing::Random;

TEST(HuffmanTable, EverySymbolHasACodeOfAtMost16Bits) {
  Random random{11};
  for (int round = 0; round < 200; ++round) {
    std::vector<std::uint8_t> symbols;
    std::vector<std::uint64_t> weights;
    const std::size_t count = 1 + random.next() % 200;
    for (std::size_t k = 0; k < count; ++k) {
      symbols.push_back(static_cast<std::uint8_t>(k));
      // Fibonacci-like weights make the deepest trees.
      weights.push_back(round % 2 || k < 2 ? 1 + random.next() % 1000 : weights[k - 1] + weights[k - 2]);
      if (weights[k] > (std::uint64_t{1} << 50)) weights[k] = 1;
    }
    const HuffmanTable table = make_huffman_table(symbols, weights);
    std::uint64_t used = 0, codes = 0;
    for (std::size_t l = 1; l <= 16; ++l) {
      used += std::uint64_t{table.bits[l]} << (16 - l);
      codes += table.bits[l];
    }
    EXPECT_EQ(codes, count);
    EXPECT_LT(used, 65536u) << "the code of ones only stays free";
    std::vector<std::uint8_t> sorted = table.symbols;
    std::sort(sorted.begin(), sorted.end());
    EXPECT_EQ(sorted, symbols);
  }
  const HuffmanTable table = make_huffman_table({1, 2, 3}, {1, 1000, 10});
  EXPECT_EQ(table.symbols, (std::vector<std::uint8_t>{2, 3, 1}));
  EXPECT_EQ(table.bits[1], 1);
}

}  // namespace texmesh::huffman_table_test
