// What bytes of each texture are worth.
#include "tools/extract/budget/loss_curves.h"

#include <gtest/gtest.h>

#include "tests/support/packages.h"

namespace texmesh {
namespace {

const std::string kGolden = std::string(TEXMESH_SOURCE_DIR) + "/tests/golden/v2.0-scan.texmesh";

TEST(LossCurves, MoreBytesLoseLess) {
  PackageReader package(open_store(kGolden));
  ExtractRequest request;
  request.bytes = 60000;
  request.display_px = 64;  // small pictures, quick tests
  BudgetSource source(package, request, {});
  ASSERT_GT(source.image_count(), 0u);
  ImageCoder coder(source);
  LossCurves curves(source, coder);
  curves.measure(40000);
  double before = 1e9;
  for (const double bytes : {0.0, 2000.0, 8000.0, 20000.0, 40000.0}) {
    const Allocation found = curves.allocate(bytes);
    ASSERT_EQ(found.images.size(), source.image_count());
    EXPECT_LE(found.loss, before);
    before = found.loss;
    double sum = 0;
    for (const CodedImage& image : found.images) sum += image.bytes;
    EXPECT_NEAR(sum, found.bytes, 1e-6 * sum);
    if (bytes > 2000) EXPECT_LE(found.bytes, bytes);
    EXPECT_LT(found.last, source.image_count());
  }
  EXPECT_GT(curves.allocate(0).loss, before);
}

TEST(LossCurves, NeighboursAreTheFilesOfACurveInTurn) {
  PackageReader package(open_store(kGolden));
  ExtractRequest request;
  request.bytes = 60000;
  request.display_px = 64;
  BudgetSource source(package, request, {});
  ImageCoder coder(source);
  LossCurves curves(source, coder);
  curves.measure(40000);
  CodedImage at = curves.allocate(0).images[0];
  EXPECT_EQ(curves.neighbour(0, at, -1), nullptr);
  std::vector<CodedImage> up{at};
  while (const CodedImage* next = curves.neighbour(0, up.back(), 1)) {
    EXPECT_GT(next->bytes, up.back().bytes);
    EXPECT_LT(next->loss, up.back().loss);
    up.push_back(*next);
  }
  ASSERT_GT(up.size(), 2u);
  for (std::size_t k = up.size(); k-- > 1;) {
    const CodedImage* next = curves.neighbour(0, up[k], -1);
    ASSERT_NE(next, nullptr);
    EXPECT_EQ(next->plan, up[k - 1].plan);
  }
}

TEST(LossCurves, ImagesOfOneMaterialAreOneGroup) {
  PackageReader package(open_store(kGolden));
  ExtractRequest request;
  request.bytes = 60000;
  request.display_px = 64;
  const BudgetSource source(package, request, {});
  ASSERT_EQ(source.groups.size(), source.image_count());
  for (const ShownTexture& t : source.shown)
    EXPECT_EQ(source.groups[t.image], source.groups[source.shown[0].image]);
}

}  // namespace
}  // namespace texmesh
