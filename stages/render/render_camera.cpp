#include "stages/render/render_camera.h"

#include <cmath>

#include "format/base/portable_math.h"

namespace texmesh {
namespace {

constexpr double kFill = 0.96;  // of the picture's side
constexpr double kNearOfDistance = 1e-3;

double tan_of_half(double degrees) {
  const double half = degrees * portable::kPi / 360;
  return portable::sin(half) / portable::cos(half);
}

}  // namespace

ViewCamera camera_of(int index, int count, Vec3d centre, double radius) {
  // A Fibonacci lattice on the sphere, starting a little to the side of the front.
  const double golden = portable::kPi * (3 - std::sqrt(5.0));
  const double height = count == 1 ? 0.2 : 1 - 2 * (index + 0.5) / count,
               ring = std::sqrt(1 - height * height);
  const double angle = 0.4 + golden * index;
  ViewCamera camera;
  camera.z = {ring * portable::sin(angle), height, ring * portable::cos(angle)};
  camera.x = normalized(cross(Vec3d{0, 1, 0}, camera.z));
  camera.y = cross(camera.z, camera.x);
  camera.centre = centre;
  camera.radius = radius;
  return camera;
}

RenderCamera perspective_camera(const ViewCamera& view, double fov_degrees) {
  const double radius = std::isfinite(view.radius) && view.radius > 0 ? view.radius : 1;
  RenderCamera camera;
  camera.x = view.x, camera.y = view.y, camera.z = view.z;
  camera.tan_half_fov = tan_of_half(fov_degrees);
  // The rays that touch the sphere have the tangent radius / sqrt(distance^2 - radius^2).
  const double tangent = kFill * camera.tan_half_fov;
  const double distance = radius * std::sqrt(1 + 1 / (tangent * tangent));
  camera.eye = view.centre + view.z * distance;
  camera.near = distance * kNearOfDistance;
  return camera;
}

RenderCamera look_at_camera(Vec3d eye, Vec3d target, Vec3d up, double fov_degrees, double near) {
  RenderCamera camera;
  camera.eye = eye;
  camera.z = normalized(eye - target);
  if (!(length(camera.z) > 0)) camera.z = {0, 0, 1};
  for (const Vec3d direction : {normalized(up), Vec3d{0, 1, 0}, Vec3d{0, 0, -1}}) {
    camera.x = cross(direction, camera.z);
    if (length(camera.x) > 1e-9) break;
  }
  camera.x = normalized(camera.x);
  camera.y = cross(camera.z, camera.x);
  camera.tan_half_fov = tan_of_half(fov_degrees);
  camera.near = near;
  return camera;
}

}  // namespace texmesh
