// extract --bytes on packages with proxies: files between their sizes, chosen by lit pictures.
#include "tools/extract/proxy/proxy_search.h"

#include <gtest/gtest.h>

#include <functional>

#include "stages/gltf/check_glb.h"
#include "stages/image/png_writer.h"
#include "tests/support/packages.h"
#include "tools/extract/extract.h"

namespace texmesh::proxy_search_test {

/// A sphere; S_5 and the smaller proxy are half of it.
Bytes package_bytes(bool with_proxies) {
  testing::PackageParts parts = testing::make_package_parts();
  if (with_proxies) testing::add_proxies(parts);
  return parts.build();
}

Extracted extract(const Bytes& bytes, std::uint64_t budget,
                  const std::function<void(ExtractBudget&)>& wish = {}, int threads = 2) {
  PackageReader package(open_container(memory_source(bytes)));
  ExtractBudget r;
  r.bytes = {budget};
  r.display_px = 64;
  if (wish) wish(r);
  RunContext context;
  context.threads = threads;
  const Extracted out = extract_model(package, {r}, context);
  Findings findings;
  check_glb(out.glb, "x.glb", findings, GlbRules::kStandalone);
  for (const Finding& f : findings.list()) ADD_FAILURE() << to_string(f);
  return out;
}

TEST(ProxySearch, BudgetsBetweenFilesAreFilledAndNothingLooksWorse) {
  const Bytes plain = package_bytes(false), with = package_bytes(true);
  PackageReader package(open_container(memory_source(with)));
  const std::uint64_t least = package.proxy_glb(0).size(), most = package.proxy_glb(1).size();
  int from_proxies = 0;
  for (const std::uint64_t budget :
       {std::uint64_t{2000}, least - 50, (least + most) / 2, std::uint64_t{4000}}) {
    const Extracted before = extract(plain, budget), after = extract(with, budget);
    EXPECT_LE(after.glb.size(), budget);
    if (before.glb.size() <= budget) EXPECT_LE(after.difference, before.difference) << budget;
    if (!after.proxy) continue;
    ++from_proxies;
    EXPECT_EQ(after.proxy, 1u) << budget;  // the whole sphere, which does not fit as it is
    EXPECT_TRUE(after.within);
    EXPECT_LT(after.difference, 0.5 * before.difference) << budget;
    std::uint64_t images = 0;
    for (const ExtractedImage& i : after.images) images += i.bytes;
    EXPECT_EQ(after.mesh_bytes + images, after.glb.size());
  }
  EXPECT_EQ(from_proxies, 3);
  EXPECT_GE(extract(with, 2000).glb.size(), 1960u);
}

TEST(ProxySearch, TheNearestFileIsMadeOfAProxyWhereNothingFits) {
  const Extracted before = extract(package_bytes(false), 500), after = extract(package_bytes(true), 500);
  EXPECT_FALSE(after.within);
  EXPECT_LT(after.glb.size(), before.glb.size());
  // The least that a proxy gives, and told as any other file.
  ASSERT_TRUE(after.proxy);
  ASSERT_FALSE(after.images.empty());
  std::uint64_t images = 0;
  for (const ExtractedImage& i : after.images) {
    EXPECT_LE(i.quality, 5) << i.role;
    images += i.bytes;
  }
  EXPECT_EQ(after.mesh_bytes + images, after.glb.size());
  EXPECT_GT(after.triangles, 0u);
  EXPECT_GT(after.difference, 0);
  EXPECT_EQ(extract(package_bytes(true), 1).glb.size(), after.glb.size()) << "nothing is smaller";
}

TEST(ProxySearch, ScalesLevelsAndPngsAreNotReplaced) {
  const Bytes with = package_bytes(true);
  EXPECT_FALSE(extract(with, 3000, [](ExtractBudget& r) { r.scale = 5; }).proxy);
  EXPECT_FALSE(extract(with, 3000, [](ExtractBudget& r) { r.levels = true; }).proxy);
  EXPECT_FALSE(extract(with, 3000, [](ExtractBudget& r) { r.images = ExtractImages::kPng; }).proxy);
  const Extracted jpeg = extract(with, 3000, [](ExtractBudget& r) { r.images = ExtractImages::kJpeg; });
  EXPECT_EQ(jpeg.proxy, 1u);
  for (const ExtractedImage& i : jpeg.images) EXPECT_EQ(i.format, FileImage::kJpeg);
}

TEST(ProxySearch, ColoursWithAlphaNeverBecomeAJpeg) {
  testing::PackageParts parts = testing::make_package_parts();
  testing::add_proxies(parts);
  Pixels clear{64, 64, 4, {}};
  for (std::uint32_t i = 0; i < 64 * 64; ++i)
    for (const std::uint32_t v : {i % 64 * 4, i / 64 * 4, i % 7 * 30, 200u})
      clear.data.push_back(static_cast<std::uint8_t>(v));
  for (Bytes& proxy : parts.proxies) {
    StandaloneGlb file(proxy, "proxy.glb", GlbRules::kStandalone);
    file.set_images({{0, {FileImage::kPng, write_png(clear)}}});
    proxy = file.finish();
  }
  const Bytes bytes = parts.build();
  for (const ExtractEffort effort : {ExtractEffort::kUsual, ExtractEffort::kBest})
    EXPECT_LE(extract(bytes, 2500, [&](ExtractBudget& r) { r.effort = effort; }).glb.size(), 2500u);
}

TEST(ProxySearch, FilesAreWhereTheSourceIsAndTheSameForAnyThreads) {
  const Bytes with = package_bytes(true);
  const Extracted one = extract(with, 2500, {}, 1), eight = extract(with, 2500, {}, 8);
  ASSERT_EQ(one.proxy, 1u);
  EXPECT_EQ(one.glb, eight.glb);
  Findings findings;
  EXPECT_NEAR(check_glb(one.glb, "x.glb", findings, GlbRules::kStandalone).bounds_min.x, 9, 1e-2);
}

}  // namespace texmesh::proxy_search_test
