// What bytes of each texture are worth.
#include "tools/extract/budget/candidates.h"

#include <gtest/gtest.h>

#include "tests/support/packages.h"

namespace texmesh::loss_curves_test {

ExtractBudget small_pictures() {
  ExtractBudget out;
  out.display_px = 64;  // quick tests
  return out;
}

const std::string kGolden = std::string(TEXMESH_SOURCE_DIR) + "/tests/golden/v2.0-scan.texmesh";

TEST(LossCurves, MoreBytesLoseLess) {
  PackageReader package(open_store(kGolden));
  TextureSource textures(package, 2.4e6, {});
  const Reference reference(package, small_pictures(), {}, textures, {});
  ASSERT_GT(reference.images.size(), 0u);
  Candidates candidates(reference, textures);
  const LossCurves curves(reference, candidates, 40000);
  double before = 1e9;
  for (const double bytes : {0.0, 2000.0, 8000.0, 20000.0, 40000.0}) {
    const DealtBytes found = curves.allocate(bytes);
    ASSERT_EQ(found.images.size(), reference.images.size());
    EXPECT_LE(found.loss, before);
    before = found.loss;
    double sum = 0;
    for (const CodedImage& image : found.images) sum += image.bytes;
    EXPECT_NEAR(sum, found.bytes, 1e-6 * sum);
    if (bytes > 2000) EXPECT_LE(found.bytes, bytes);
    EXPECT_LT(found.last, reference.images.size());
  }
  EXPECT_GT(curves.allocate(0).loss, before);
}

TEST(LossCurves, NeighboursAreTheFilesOfACurveInTurn) {
  PackageReader package(open_store(kGolden));
  TextureSource textures(package, 2.4e6, {});
  const Reference reference(package, small_pictures(), {}, textures, {});
  Candidates candidates(reference, textures);
  const LossCurves curves(reference, candidates, 40000);
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
  TextureSource textures(package, 2.4e6, {});
  const Reference reference(package, small_pictures(), {}, textures, {});
  ASSERT_EQ(reference.groups.size(), reference.images.size());
  for (const PictureTexture& t : reference.shown)
    EXPECT_EQ(reference.groups[t.image], reference.groups[reference.shown[0].image]);
}

}  // namespace texmesh::loss_curves_test
