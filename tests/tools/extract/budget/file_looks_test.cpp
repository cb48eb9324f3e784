// Files that are chosen by whole pictures.
#include "tools/extract/budget/file_looks.h"

#include <gtest/gtest.h>

#include "tests/support/packages.h"
#include "tools/extract/budget/quality_search.h"

namespace texmesh {
namespace {

const std::string kGolden = std::string(TEXMESH_SOURCE_DIR) + "/tests/golden/v2.0-scan.texmesh";
constexpr std::uint64_t kBytes = 30000;

ExtractRequest small_request() {
  ExtractRequest out;
  out.bytes = kBytes;
  out.display_px = 64;  // small pictures, quick tests
  return out;
}

class Looks : public ::testing::Test {
 protected:
  Looks() { curves_.measure(static_cast<double>(kBytes)); }

  Allocation good() {
    const std::uint64_t mesh = meshes_.at(kMesh).fixed_bytes;
    return curves_.allocate(static_cast<double>(kBytes - mesh));
  }
  FoundFile looked_at(const Allocation& images) {
    FoundFile out = looks_.file_of(kMesh, images);
    looks_.look_at(out);
    return out;
  }
  std::size_t worst(const Allocation& images) const {
    std::size_t out = 0;
    for (std::size_t i = 0; i < images.images.size(); ++i)
      if (images.images[i].loss > images.images[out].loss) out = i;
    return out;
  }

  static constexpr MeshKey kMesh{0, 1, 0};
  PackageReader package_{open_store(kGolden)};
  BudgetSource source_{package_, small_request(), {}};
  MeshCandidates meshes_{source_};
  ImageCoder coder_{source_};
  LossCurves curves_{source_, coder_};
  BudgetFiller filler_{source_, coder_};
  FileLooks looks_{source_, meshes_, coder_, filler_};
};

TEST_F(Looks, ATextureThatIsMuchTooSmallGrows) {
  Allocation images = good();
  images.last = worst(images);
  ImagePlan& plan = images.images[images.last].plan;
  plan.share /= 8;
  plan.quality = kHighestQuality;
  FoundFile best = looked_at(images);
  const double before = best.difference;
  looks_.try_other_files(curves_, best);
  EXPECT_LT(best.difference, before);
  EXPECT_GT(best.images.images[images.last].plan.share, plan.share);
  EXPECT_TRUE(filler_.fills(best.file));
  FoundFile again = looks_.file_of(best.key, best.images);
  looks_.look_at(again);
  EXPECT_EQ(again.file.glb, best.file.glb);
  EXPECT_EQ(again.difference, best.difference);
}

TEST_F(Looks, WhatIsPlannedAsTheSourcesCoefficientsMayBecomeSmaller) {
  Allocation images = good();
  const std::size_t image = worst(images);
  ASSERT_TRUE(coder_.stored_bytes(image));
  images.last = image;
  images.images[image].plan = {{FileImage::kJpeg, false, true}, 1, 40};
  FoundFile best = looked_at(images);
  best.difference = 1e9;  // anything is nearer
  looks_.try_other_files(curves_, best);
  EXPECT_FALSE(best.images.images[image].plan.coding.stored);
}

TEST_F(Looks, FewOfTheSourcesCoefficientsLoseToASmallerTexture) {
  Allocation images = good();
  const std::size_t image = worst(images);
  images.last = image == 0 ? 1 : 0;  // the texture itself stays poor
  images.images[image].plan = {{FileImage::kJpeg, false, true}, 1, kLowestQuality};
  FoundFile best = looked_at(images);
  const double before = best.difference;
  looks_.try_smaller_than_stored(best);
  EXPECT_LT(best.difference, before);
  EXPECT_FALSE(best.images.images[image].plan.coding.stored);
}

TEST_F(Looks, ATextureThatTakesTooMuchGivesBytesToTheOneThatLosesMost) {
  Allocation images = good();
  ASSERT_GT(images.images.size(), 1u);
  const std::size_t most = worst(images), other = most == 0 ? 1 : 0;
  while (const CodedImage* more = curves_.neighbour(other, images.images[other], 1)) {
    const double loss = images.images[other].loss;
    images.images[other] = *more;
    if (!(more->loss < loss)) break;
  }
  const double bytes = images.images[other].bytes;
  images.last = most;
  FoundFile best = looked_at(images);
  const double before = best.difference;
  looks_.try_other_files(curves_, best);
  EXPECT_LT(best.difference, before);
  EXPECT_LT(best.images.images[other].bytes, bytes);
}

}  // namespace
}  // namespace texmesh
