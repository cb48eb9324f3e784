#include "stages/skeletonization/wrap.h"

#include <gtest/gtest.h>

#include <array>
#include <map>

#include "tests/support/even_sphere.h"

namespace texmesh::wrap_test {

/// Balls of radius 1 with their centres at these places.
TriangleSoup balls(const std::vector<Vec3d>& centres) {
  const Mesh mesh = testing::even_sphere(3, 0);
  TriangleSoup soup;
  for (const Vec3d& centre : centres) {
    const auto first = static_cast<std::uint32_t>(soup.points.size());
    for (const Vec3f& p : mesh.positions) soup.points.push_back(to_double(p) + centre);
    for (const Triangle& t : mesh.triangles)
      soup.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  }
  return soup;
}

/// Every edge is used once in each direction.
bool is_closed(const TriangleSoup& soup) {
  std::map<std::array<std::uint32_t, 2>, int> uses;
  for (const Triangle& t : soup.triangles)
    for (std::size_t k = 0; k < 3; ++k) ++uses[{t[k], t[(k + 1) % 3]}];
  for (const auto& [edge, count] : uses) {
    const auto back = uses.find({edge[1], edge[0]});
    if (count != 1 || back == uses.end() || back->second != 1) return false;
  }
  return true;
}

TEST(WrapSurface, PartsApartAreClosedSurfacesOfTheirOwn) {
  const auto parts = wrap_surface(balls({{0, 0, 0}, {5, 0, 0}}), 0.3, 0.05, 500, 1'000'000, RunContext());
  ASSERT_EQ(parts.size(), 2u);
  for (const TriangleSoup& part : parts) {
    EXPECT_TRUE(is_closed(part));
    EXPECT_LE(part.triangles.size(), 500u);
    const double left = part.points[0].x < 2.5 ? 0 : 5;
    for (const Vec3d& p : part.points) EXPECT_NEAR(length(p - Vec3d{left, 0, 0}), 1.05, 0.1);
  }
}

TEST(WrapSurface, GivesUpAfterItsSteps) {
  EXPECT_THROW(wrap_surface(balls({{0, 0, 0}}), 0.1, 0.01, 500, 50, RunContext()), GeometryFailure);
}

TEST(IsClosedSurface, OfOneConnectedSolidWithNoLongEdges) {
  const TriangleSoup ball = balls({{0, 0, 0}});
  EXPECT_TRUE(is_closed_surface(ball, 0.5));
  EXPECT_FALSE(is_closed_surface(ball, 0.01));
  EXPECT_FALSE(is_closed_surface(balls({{0, 0, 0}, {5, 0, 0}}), 0.5));
  TriangleSoup open = ball, inside_out = ball, turned = ball, twice = ball;
  open.triangles.pop_back();
  for (Triangle& t : inside_out.triangles) std::swap(t[0], t[1]);
  std::swap(turned.triangles[0][0], turned.triangles[0][1]);
  twice.triangles.insert(twice.triangles.end(), ball.triangles.begin(), ball.triangles.end());
  for (const TriangleSoup& other : {open, inside_out, turned, twice})
    EXPECT_FALSE(is_closed_surface(other, 0.5));
}

TEST(Decimate, StaysClosedWithFewerFaces) {
  const TriangleSoup ball = balls({{0, 0, 0}});
  EXPECT_EQ(decimate(ball, ball.triangles.size()).triangles, ball.triangles);
  for (const auto thin_out : {decimate, decimate_evenly}) {
    const TriangleSoup fewer = thin_out(ball, 100);
    EXPECT_TRUE(is_closed(fewer));
    EXPECT_LE(fewer.triangles.size(), 100u);
    EXPECT_GE(fewer.triangles.size(), 90u);
  }
}

}  // namespace texmesh::wrap_test
