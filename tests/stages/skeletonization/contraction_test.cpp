#include "stages/skeletonization/curve_skeleton.h"

#include <gtest/gtest.h>

#include "stages/skeletonization/contraction_parts.h"
#include "stages/skeletonization/wrap.h"
#include "tests/support/even_sphere.h"

namespace texmesh::contraction_test {

TriangleSoup ball() {
  const Mesh mesh = testing::even_sphere(4, 0);
  TriangleSoup soup;
  // Floats' rounding would move the poles: corners of thin tetrahedra amplify it.
  for (const Vec3f& p : mesh.positions) soup.points.push_back(normalized(to_double(p)));
  soup.triangles = mesh.triangles;
  return soup;
}

TEST(ContractToSkeleton, RefusesAnOpenSurfaceAsGeometry) {
  EXPECT_THROW(contract_to_skeleton({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}}), GeometryFailure);
}

TEST(VoronoiPoles, OfABallLieAtItsCentre) {
  const std::vector<Vec3d> points = ball().points;  // outward normals of a unit ball at its centre
  for (const Vec3d& pole : voronoi_poles(points, points)) EXPECT_LT(length(pole), 1e-6);
}

TEST(VoronoiPoles, OfPointsThatShareAPlaceAreTheSame) {
  std::vector<Vec3d> points = ball().points;
  const Vec3d moved{0.1, 0, 0};
  for (Vec3d& p : points) p = p + moved;
  std::vector<Vec3d> normals = ball().points;
  points.push_back(points[7]);
  normals.push_back(normals[7]);
  const std::vector<Vec3d> poles = voronoi_poles(points, normals);
  EXPECT_EQ(poles[7], poles.back());
  EXPECT_LT(length(poles[7] - moved), 1e-6);
}

TEST(InsideTest, TellsTheInsideOfABall) {
  const TriangleSoup soup = ball();
  std::vector<InsideTest::Corners> corners;
  for (const Triangle& t : soup.triangles)
    corners.push_back({soup.points[t[0]], soup.points[t[1]], soup.points[t[2]]});
  InsideTest::forget_rays();
  const InsideTest inside(corners);
  EXPECT_TRUE(inside.is_inside({0.1, 0.2, 0.3}));
  EXPECT_TRUE(inside.is_inside({0, 0, -0.9}));
  EXPECT_FALSE(inside.is_inside({0.8, 0.8, 0}));
  EXPECT_FALSE(inside.is_inside({0, 3, 0}));
  EXPECT_FALSE(inside.is_inside(soup.points[5]));
}

}  // namespace texmesh::contraction_test
