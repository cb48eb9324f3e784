#include "stages/jpeg/block_scan.h"

#include <gtest/gtest.h>

namespace texmesh::bit_writer_test {

TEST(BitWriter, FirstBitHighestAndTheLastByteFilledWithOnes) {
  Bytes out{7};
  BitWriter writer(out);
  writer.reserve(4);
  writer.put(1, 1);
  writer.put(0, 2);
  writer.put(0x2a5, 10);
  writer.finish();
  EXPECT_EQ(out, (Bytes{7, 0b10010101, 0b00101111}));
}

TEST(BitWriter, AZeroStandsBehindEvery255) {
  Bytes out;
  BitWriter writer(out);
  for (int k = 0; k < 100; ++k) {
    writer.reserve(8);
    writer.put(0xffffffffu, 32);
  }
  writer.put(0x7f, 7);
  writer.finish();
  ASSERT_EQ(out.size(), 802u);
  for (std::size_t k = 0; k < out.size(); ++k) EXPECT_EQ(out[k], k % 2 ? 0 : 255);
}

TEST(BitWriter, NothingOfNothing) {
  Bytes out{1, 2};
  BitWriter(out).finish();
  EXPECT_EQ(out, (Bytes{1, 2}));
}

}  // namespace texmesh::bit_writer_test
