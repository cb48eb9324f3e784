#include "stages/render/visibility.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace texmesh::render_camera_test {

void expect_frame(const RenderCamera& c) {
  for (const Vec3d& v : {c.x, c.y, c.z}) EXPECT_NEAR(length(v), 1, 1e-12);
  EXPECT_NEAR(dot(c.x, c.y), 0, 1e-12);
  EXPECT_NEAR(dot(cross(c.x, c.y), c.z), 1, 1e-12) << "right-handed";
}

TEST(RenderCamera, TheSphereFillsTheSameShareForEveryViewAndFieldOfView) {
  for (const double fov : {10., 30., 60., 90.})
    for (int i = 0; i < 12; ++i) {
      const RenderCamera camera = perspective_camera(camera_of(i, 12, {1, 2, 3}, 2.5), fov);
      expect_frame(camera);
      const double distance = length(camera.eye - Vec3d{1, 2, 3});
      // The rays that touch the sphere
      const double tangent = 2.5 / std::sqrt(distance * distance - 2.5 * 2.5);
      EXPECT_NEAR(tangent / camera.tan_half_fov, 0.96, 1e-9);
      EXPECT_NEAR(camera.tan_half_fov, std::tan(fov / 2 * 3.14159265358979 / 180), 1e-9);
      EXPECT_GT(distance - 2.5, camera.near);
    }
}

TEST(RenderCamera, ASphereWithoutASizeGivesACamera) {
  for (const double radius : {0., -1., std::numeric_limits<double>::infinity(), std::nan("")}) {
    const RenderCamera camera = perspective_camera(camera_of(0, 1, {}, radius));
    EXPECT_TRUE(std::isfinite(length(camera.eye)));
    EXPECT_GT(camera.near, 0);
  }
}

TEST(RenderCamera, LooksAtItsTargetWithUpUpwards) {
  const RenderCamera camera = look_at_camera({3, 4, 5}, {1, 1, 1}, {0, 2, 0}, 40, 0.1);
  expect_frame(camera);
  EXPECT_NEAR(length(cross(camera.z, Vec3d{2, 3, 4})), 0, 1e-9);
  EXPECT_GT(camera.y.y, 0);
  EXPECT_NEAR(camera.x.y, 0, 1e-12);
}

TEST(RenderCamera, AnUpThatDoesNotServeIsReplaced) {
  expect_frame(look_at_camera({0, 5, 0}, {0, 0, 0}, {0, 1, 0}, 40, 0.1));
  expect_frame(look_at_camera({0, 0, 5}, {0, 0, 0}, {0, 0, 0}, 40, 0.1));
  expect_frame(look_at_camera({1, 1, 1}, {1, 1, 1}, {0, 1, 0}, 40, 0.1));
}

}  // namespace texmesh::render_camera_test
