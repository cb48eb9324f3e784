#include "format/rules/proxy_choice.h"

#include <gtest/gtest.h>

#include <cmath>

namespace texmesh::proxy_choice_test {

/// A rough and a good proxy, measured at 128 and 512 px.
Manifest two_proxies() {
  Manifest m;
  m.proxy_sizes_px = {128, 512};
  m.proxies = {{{"", 8192, 20000, {}}, 100, 60, 64, {0.04, 0.2}, {0.1, 0.5}},
               {{"", 28224, 40000, {}}, 300, 200, 128, {0.02, 0.06}, {0.05, 0.2}}};
  return m;
}

TEST(ProxyChoice, LossesAreLinearInTheLogarithmOfTheHeight) {
  const Manifest m = two_proxies();
  EXPECT_EQ(proxy_loss(m, 0, 128).flip, 0.04);
  EXPECT_EQ(proxy_loss(m, 0, 512).flip, 0.2);
  EXPECT_EQ(proxy_loss(m, 0, 512).flip_p95, 0.5);
  EXPECT_NEAR(proxy_loss(m, 0, 256).flip, 0.12, 1e-12);
  EXPECT_NEAR(proxy_loss(m, 0, 256).flip_p95, 0.3, 1e-12);
}

TEST(ProxyChoice, OutsideTheMeasuredHeights) {
  const Manifest m = two_proxies();
  for (const double px : {0.0, 1.0, 127.0}) EXPECT_EQ(proxy_loss(m, 0, px).flip, 0.04) << px;
  EXPECT_NEAR(proxy_loss(m, 1, 1024).flip, 0.06 * 1.6, 1e-12);
  EXPECT_NEAR(proxy_loss(m, 1, 2048).flip_p95, 0.2 * 1.6 * 1.6, 1e-12);
  EXPECT_EQ(proxy_loss(m, 0, 1e9).flip, 1);
}

TEST(ProxyChoice, LossesRiseWithTheHeightHere) {
  const Manifest m = two_proxies();
  double before = 0;
  for (double px = 20; px < 4000; px *= 1.07) {
    const double flip = proxy_loss(m, 0, px).flip;
    EXPECT_GE(flip, before) << px;
    before = flip;
  }
}

TEST(ProxyChoice, TheSmallestThatCannotBeToldServes) {
  const Manifest m = two_proxies();
  EXPECT_EQ(serving_proxy(m, 64), 0u);
  EXPECT_EQ(serving_proxy(m, 128), 0u);
  EXPECT_EQ(serving_proxy(m, 200), 1u);
  EXPECT_EQ(serving_proxy(m, 512), std::nullopt);
  EXPECT_EQ(serving_proxy(Manifest{}, 64), std::nullopt);
  Manifest large = m;  // scales come nearer than a larger file
  for (ManifestProxy& p : large.proxies) p.glb.bytes += kStartBytes;
  EXPECT_EQ(serving_proxy(large, 64), std::nullopt);
  Manifest by_p95 = m;  // the mean alone is not enough
  for (ManifestProxy& p : by_p95.proxies) p.flip_p95 = {0.16, 0.5};
  EXPECT_EQ(serving_proxy(by_p95, 64), std::nullopt);
}

TEST(ProxyChoice, BytesBehindTheFirstRequest) {
  const Manifest m = two_proxies();
  EXPECT_EQ(proxy_bytes_beyond_start(m, 0), 0u);
  EXPECT_EQ(proxy_bytes_beyond_start(m, 1), 28224 + 40000 - kStartBytes);
}

}  // namespace texmesh::proxy_choice_test
