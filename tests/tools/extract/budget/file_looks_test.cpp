// Files that are chosen by whole pictures.
#include "tools/extract/budget/budget_search.h"

#include <gtest/gtest.h>

#include "tests/support/packages.h"

namespace texmesh::file_looks_test {

const std::string kGolden = std::string(TEXMESH_SOURCE_DIR) + "/tests/golden/v2.0-scan.texmesh";
constexpr std::uint64_t kBytes = 30000;

ExtractBudget small_request() {
  ExtractBudget out;
  out.display_px = 64;  // small pictures, quick tests
  return out;
}

class Looks : public ::testing::Test {
 protected:
  DealtBytes good() {
    const std::uint64_t mesh = search_.mesh(kMesh).fixed_bytes;
    return search_.curves().allocate(static_cast<double>(kBytes - mesh));
  }
  FoundFile looked_at(const DealtBytes& images) {
    FoundFile out = search_.file_of(kMesh, images);
    search_.look_at(out);
    return out;
  }
  std::size_t worst(const DealtBytes& images) const {
    std::size_t out = 0;
    for (std::size_t i = 0; i < images.images.size(); ++i)
      if (images.images[i].loss > images.images[out].loss) out = i;
    return out;
  }

  static constexpr MeshKey kMesh{0, 1, 0};
  PackageReader package_{open_store(kGolden)};
  TextureSource textures_{package_, 40.0 * kBytes, {}};
  const Reference reference_{package_, small_request(), {}, textures_, {}};
  Candidates candidates_{reference_, textures_};
  ProxyDifferences proxies_;
  Search search_{reference_, candidates_, proxies_, kBytes};
};

TEST_F(Looks, ATextureThatIsMuchTooSmallGrows) {
  DealtBytes images = good();
  images.last = worst(images);
  ImagePlan& plan = images.images[images.last].plan;
  plan.share /= 8;
  plan.quality = kHighestQuality;
  FoundFile best = looked_at(images);
  const double before = best.difference;
  search_.try_other_files(best);
  EXPECT_LT(best.difference, before);
  EXPECT_GT(best.images.images[images.last].plan.share, plan.share);
  EXPECT_TRUE(search_.filling().fills(best.file));
  FoundFile again = search_.file_of(best.key, best.images);
  search_.look_at(again);
  EXPECT_EQ(again.file.glb, best.file.glb);
  EXPECT_EQ(again.difference, best.difference);
}

TEST_F(Looks, WhatIsPlannedAsTheSourcesCoefficientsMayBecomeSmaller) {
  DealtBytes images = good();
  const std::size_t image = worst(images);
  ASSERT_TRUE(candidates_.stored_bytes(image));
  images.last = image;
  images.images[image].plan = {{FileImage::kJpeg, false, true}, 1, 40};
  FoundFile best = looked_at(images);
  best.difference = 1e9;  // anything is nearer
  search_.try_other_files(best);
  EXPECT_FALSE(best.images.images[image].plan.coding.stored);
}

TEST_F(Looks, FewOfTheSourcesCoefficientsLoseToASmallerTexture) {
  DealtBytes images = good();
  const std::size_t image = worst(images);
  images.last = image == 0 ? 1 : 0;  // the texture itself stays poor
  images.images[image].plan = {{FileImage::kJpeg, false, true}, 1, kLowestQuality};
  FoundFile best = looked_at(images);
  const double before = best.difference;
  search_.try_smaller_than_stored(best);
  EXPECT_LT(best.difference, before);
  EXPECT_FALSE(best.images.images[image].plan.coding.stored);
}

TEST_F(Looks, ATextureThatTakesTooMuchGivesBytesToTheOneThatLosesMost) {
  DealtBytes images = good();
  ASSERT_GT(images.images.size(), 1u);
  const std::size_t most = worst(images), other = most == 0 ? 1 : 0;
  while (const CodedImage* more = search_.curves().neighbour(other, images.images[other], 1)) {
    const double loss = images.images[other].loss;
    images.images[other] = *more;
    if (!(more->loss < loss)) break;
  }
  const double bytes = images.images[other].bytes;
  images.last = most;
  FoundFile best = looked_at(images);
  const double before = best.difference;
  search_.try_other_files(best);
  EXPECT_LT(best.difference, before);
  EXPECT_LT(best.images.images[other].bytes, bytes);
}

}  // namespace texmesh::file_looks_test
