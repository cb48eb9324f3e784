#include "format/rules/output_transform.h"

#include <gtest/gtest.h>

namespace texmesh::output_transform_test {

About about_of(const std::string& unit, double metres, const std::string& up) {
  About about;
  about.unit = unit;
  about.metres_per_unit = metres;
  about.up_axis = up;
  return about;
}

TEST(OutputTransform, UpBecomesYByARotationThatKeepsLengthsAndHands) {
  const std::array<Vec3d, 3> axes{Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}};
  for (const auto& [up, axis] : {std::pair{"x", 0}, {"y", 1}, {"z", 2}, {"", 1}}) {
    const OutputTransform t = output_transform(about_of("", 0, up), {}, false);
    EXPECT_EQ(t(axes[static_cast<std::size_t>(axis)]), (Vec3d{0, 1, 0})) << up;
    const Vec3d x = t(axes[0]), y = t(axes[1]), z = t(axes[2]);
    EXPECT_EQ(cross(x, y), z) << up;
    EXPECT_EQ(t.changes_nothing(), axis == 1) << up;
  }
}

TEST(OutputTransform, IsWhatItsMatrixSays) {
  const Vec3d origin{5e6, -1.0 / 3, 17}, p{0.1, 20, -3};
  for (const char* up : {"x", "y", "z"})
    for (const double metres : {0.0, 1.0, 0.001, 0.3048}) {
      const OutputTransform t = output_transform(about_of("u", metres, up), origin, false);
      const std::array<double, 16> m = t.matrix();
      const Vec3d to = t(p);
      for (std::size_t k = 0; k < 3; ++k) {
        const double by_matrix = m[k] * p.x + m[4 + k] * p.y + m[8 + k] * p.z + m[12 + k];
        EXPECT_NEAR(by_matrix, to[static_cast<int>(k)], 1e-8) << up << metres;
      }
      EXPECT_EQ(t.scale, metres == 0 ? 1 : metres);
    }
}

TEST(OutputTransform, ABoxHoldsWhatItHeld) {
  const OutputTransform t = output_transform(about_of("mm", 0.001, "z"), {1, 2, 3}, false);
  const Box3d box{{-1, -2, -3}, {4, 5, 6}};
  const Box3d to = t(box);
  EXPECT_NEAR(to.min.x, 0, 1e-15);
  EXPECT_NEAR(to.size().x, 0.005, 1e-15);
  EXPECT_NEAR(to.size().y, 0.009, 1e-15);
  EXPECT_NEAR(to.size().z, 0.007, 1e-15);
  EXPECT_TRUE(t(Box3d{}).empty());
}

TEST(OutputTransform, WhatIsKnownGoesWithIt) {
  const About source = about_of("mm", 0.001, "z");
  const About metres = transformed_about(source, output_transform(source, {}, false));
  EXPECT_EQ(metres.metres_per_unit, 1);
  EXPECT_EQ(metres.unit, "m");
  EXPECT_EQ(metres.up_axis, "y");
  EXPECT_TRUE(output_transform(metres, {}, false).changes_nothing()) << "once is enough";
  const About kept = transformed_about(source, output_transform(source, {}, true));
  EXPECT_EQ(kept.unit, "mm");
  EXPECT_EQ(kept.up_axis, "y") << "the unit is kept, not the axes";
}

TEST(OutputTransform, SaysWhatAUserMustKnow) {
  const auto note = [](const About& about, bool keep) {
    return units_note(about, output_transform(about, {}, keep));
  };
  EXPECT_EQ(note(about_of("metre", 1, "y"), false), "");
  EXPECT_NE(note(about_of("", 0, ""), false).find("not known"), std::string::npos);
  EXPECT_NE(note(about_of("mm", 0.001, ""), false).find("--keep-units"), std::string::npos);
  EXPECT_NE(note(about_of("mm", 0.001, ""), true).find("in mm"), std::string::npos);
}

}  // namespace texmesh::output_transform_test
