#include "stages/measure/fragment_meter.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "tests/support/meshes.h"

namespace texmesh::distortion_test {

using testing::Random;

TEST(Distortion, EqualOppositeAndMasked) {
  Random random{1};
  std::vector<std::uint8_t> source(16 * 16), mask(16 * 16, 255), other;
  for (auto& v : source) v = static_cast<std::uint8_t>(random.next());
  const DistortionMeter meter(source, mask, 16, 16);
  EXPECT_EQ(meter.against(source).mse, 0);
  EXPECT_NEAR(meter.against(source).dssim, 0, 1e-12);
  other = source;
  for (auto& v : other) v = static_cast<std::uint8_t>(255 - v);
  EXPECT_GT(meter.against(other).dssim, 1);  // negative correlation
  EXPECT_LT(meter.against(other).dssim, 2);

  for (std::size_t k = 0; k < 256; ++k) mask[k] = k % 3 == 0 ? 255 : 0;
  const DistortionMeter masked(source, mask, 16, 16);
  EXPECT_EQ(masked.against(source).mse, 0);
  other = source;
  for (std::size_t k = 0; k < 256; ++k)
    other[k] = mask[k] ? source[k] : static_cast<std::uint8_t>(random.next());
  EXPECT_EQ(masked.against(other).mse, 0);
  EXPECT_NEAR(masked.against(other).dssim, 0, 1e-12);
  other[0] = static_cast<std::uint8_t>(source[0] ^ 16);
  EXPECT_NEAR(masked.against(other).mse, 256.0 / 86, 1e-9);
}

TEST(Distortion, AgainstTheFormulaInOneWindow) {
  Random random{2};
  std::vector<std::uint8_t> a(64), b(64);
  for (std::size_t k = 0; k < 64; ++k) {
    a[k] = static_cast<std::uint8_t>(random.next() % 200);
    b[k] = static_cast<std::uint8_t>(a[k] + random.next() % 40);
  }
  double ma = 0, mb = 0, va = 0, vb = 0, cov = 0;
  for (std::size_t k = 0; k < 64; ++k) ma += a[k] / 64.0, mb += b[k] / 64.0;
  for (std::size_t k = 0; k < 64; ++k) {
    va += (a[k] - ma) * (a[k] - ma) / 64;
    vb += (b[k] - mb) * (b[k] - mb) / 64;
    cov += (a[k] - ma) * (b[k] - mb) / 64;
  }
  const double ssim =
      (2 * ma * mb + 6.5025) * (2 * cov + 58.5225) / ((ma * ma + mb * mb + 6.5025) * (va + vb + 58.5225));
  const DistortionMeter meter(a, std::vector<std::uint8_t>(64, 255), 8, 8);
  EXPECT_NEAR(meter.against(b).dssim, 1 - ssim, 1e-12);
}

}  // namespace texmesh::distortion_test
