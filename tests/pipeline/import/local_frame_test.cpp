#include "pipeline/import/mesh_builder.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace texmesh::local_frame_test {

TEST(SetPositions, NearModelsKeepTheirCoordinatesAndFarOnesGetAnOrigin) {
  Mesh mesh;
  set_positions(mesh, {{-1, 2, 3}, {1, 2.5, 3}});
  EXPECT_EQ(mesh.origin, Vec3d{});
  EXPECT_EQ(mesh.positions[1], (Vec3f{1, 2.5f, 3}));
  set_positions(mesh, {{5e6 + 0.001, 0, 0}, {5e6 + 1.003, 1, 1}});
  EXPECT_EQ(mesh.origin.x, static_cast<double>(static_cast<float>(mesh.origin.x))) << "exact as a float";
  EXPECT_NEAR(to_double(mesh.positions[1]).x + mesh.origin.x, 5e6 + 1.003, 1e-7);
  set_positions(mesh, {{std::nan(""), 0, 0}, {1e300, 0, 0}, {7e6, 1, 1}, {7e6 + 1, 1, 1}});
  EXPECT_TRUE(std::isnan(mesh.positions[0].x) && std::isnan(mesh.positions[1].x));
  EXPECT_NEAR(mesh.origin.x, 7e6, 1);
  set_positions(mesh, {{2e18, 0, 0}, {1e18, 0, 0}, {9e18, 0, 0}}, kLargestPackedCoordinate);
  EXPECT_TRUE(std::isfinite(mesh.positions[0].x) && std::isnan(mesh.positions[2].x));
  set_positions(mesh, {});
  EXPECT_TRUE(mesh.positions.empty());
}

}  // namespace texmesh::local_frame_test
