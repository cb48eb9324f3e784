#include "format/rules/size_curve.h"

#include <gtest/gtest.h>

#include <cmath>

namespace texmesh::size_model_test {

/// The thesis's texture (x): A = 825.45, B = .34.
const SizeModel kTextureX{825.45f, 0.34f, 0.98f};

TEST(SizeModelRule, GivesTheThesissBytes) {
  EXPECT_NEAR(modelled_bytes(kTextureX, 0.5, 0), 825.45, 1e-3);
  // (100 * .5)^.34 = e^(.34 * 3.912023) = e^1.330088 = 3.78138
  EXPECT_NEAR(modelled_bytes(kTextureX, 0.5, 1) / 825.45, 3.78138, 1e-4);
  EXPECT_NEAR(modelled_bytes(kTextureX, 0.5, 0.3), 825.45 * std::pow(50, 0.34 * 0.3), 1e-2);
}

TEST(SizeModelRule, QualityIsTheInverse) {
  for (const double p : {0.02, 0.3, 1.0})
    for (const double quality : {-0.1, 0.0, 0.3, 1.0, 1.2})
      EXPECT_NEAR(modelled_quality(kTextureX, p, modelled_bytes(kTextureX, p, quality)), quality, 1e-9);
}

TEST(SizeModelRule, WithoutAModelThereIsNothing) {
  EXPECT_EQ(modelled_bytes({}, 0.5, 0.5), 0);
  EXPECT_EQ(modelled_quality({}, 0.5, 1000), 0);
  EXPECT_EQ(modelled_quality(kTextureX, 0.5, 0), 0);
  EXPECT_EQ(modelled_quality({100, 0, 0}, 0.5, 1000), 0);  // bytes that do not grow tell no quality
}

}  // namespace texmesh::size_model_test
