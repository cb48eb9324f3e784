#include "stages/jpeg/block_transform.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/meshes.h"

namespace texmesh::block_transform_test {

using testing::Random;

BlockValues noise(Random& random) {
  BlockValues out;
  for (float& v : out) v = static_cast<float>(static_cast<int>(random.next() % 256) - 128);
  return out;
}

/// Samples that decode to something else.
int off_by(const BlockValues& samples, const BlockValues& steps) {
  const BlockValues shown = block_inverse_dct(steps);
  int off = 0;
  for (std::size_t k = 0; k < 64; ++k) off += std::fabs(shown[k] - samples[k]) > 0.5f;
  return off;
}

TEST(BlockTransform, FinestStepsLeaveAQuarterFewerSamplesOff) {
  Random random{9};
  int nearest = 0, finest = 0;
  constexpr int kBlocks = 500;
  for (int b = 0; b < kBlocks; ++b) {
    const BlockValues samples = noise(random), coefficients = block_dct(samples);
    BlockValues rounded;
    for (std::size_t k = 0; k < 64; ++k) rounded[k] = static_cast<float>(nearest_integer(coefficients[k]));
    const BlockValues steps = finest_steps(coefficients);
    for (const float s : steps) {
      ASSERT_EQ(s, std::round(s));
      ASSERT_LE(std::fabs(s), 1024);
    }
    nearest += off_by(samples, rounded);
    finest += off_by(samples, steps);
  }
  EXPECT_NEAR(nearest / (64.0 * kBlocks), 0.083, 0.005);
  EXPECT_LT(finest, 0.77 * nearest);
}

TEST(BlockTransform, FinestStepsOfWholeNumbersAreThese) {
  BlockValues whole{};
  EXPECT_EQ(finest_steps(whole), whole);
  for (std::size_t k = 0; k < 64; ++k) whole[k] = static_cast<float>(static_cast<int>(k) % 7 - 3);
  EXPECT_EQ(finest_steps(whole), whole);
}

TEST(BlockTransform, FinestStepsStayInTheRangeOfBaselineJpeg) {
  BlockValues checks;
  for (std::size_t k = 0; k < 64; ++k) checks[k] = (k / 8 + k % 8) % 2 == 0 ? 127.0f : -128.0f;
  for (const float s : finest_steps(block_dct(checks))) EXPECT_LE(std::fabs(s), 1023);
}

}  // namespace texmesh::block_transform_test
