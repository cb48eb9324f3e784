#include "stages/proxies/make_proxy.h"

#include <gtest/gtest.h>

#include "tests/support/meshes.h"

namespace texmesh::make_proxy_smooth_test {

/// Wedges of their own for all triangles, with the triangles' normals.
Mesh faceted(const Mesh& m) {
  Mesh out = m;
  out.wedge_position.clear();
  out.uv0.clear();
  out.normals.clear();
  for (std::uint32_t t = 0; t < m.triangles.size(); ++t) {
    const auto at = [&](std::uint32_t k) { return m.positions[m.position_of(t, k)]; };
    for (std::uint32_t k = 0; k < 3; ++k) {
      out.triangles[t][k] = static_cast<std::uint32_t>(out.wedge_position.size());
      out.wedge_position.push_back(m.position_of(t, k));
      out.normals.push_back(normalized(cross(at(1) - at(0), at(2) - at(0))));
    }
  }
  return out;
}

TEST(IsSmooth, NormalsThatTurnWithinTrianglesMakeASurfaceSmooth) {
  const Mesh sphere = testing::sphere(10, 20);
  EXPECT_TRUE(is_smooth(sphere));
  EXPECT_FALSE(is_smooth(faceted(sphere)));
  Mesh bare = sphere;
  bare.normals.clear();
  EXPECT_FALSE(is_smooth(bare));
  EXPECT_FALSE(is_smooth(Mesh{}));
}

TEST(IsSmooth, TheLargerPartOfTheAreaDecides) {
  Mesh mesh = faceted(testing::sphere(10, 20));
  const Mesh small = testing::sphere(4, 8);
  const auto add = [&](float size) {
    Mesh out = mesh;
    const auto positions = static_cast<std::uint32_t>(out.positions.size()),
               wedges = static_cast<std::uint32_t>(out.wedge_position.size());
    for (const Vec3f p : small.positions) out.positions.push_back(p * size);
    for (std::size_t w = 0; w < small.wedge_count(); ++w) {
      out.wedge_position.push_back(small.wedge_position[w] + positions);
      out.normals.push_back(small.normals[w]);
    }
    for (const Triangle& t : small.triangles)
      out.triangles.push_back({t[0] + wedges, t[1] + wedges, t[2] + wedges});
    return out;
  };
  EXPECT_FALSE(is_smooth(add(0.5f)));
  EXPECT_TRUE(is_smooth(add(2.0f)));
}

}  // namespace texmesh::make_proxy_smooth_test
