#pragma once
#include "format/base/vec.h"

namespace texmesh {

/// A direction of view: a camera looks along -z at the sphere of radius `radius` around `centre`.
struct ViewCamera {
  Vec3d x, y, z;  // unit vectors: x to the right, y up, z towards the viewer
  Vec3d centre;
  double radius = 1;
};
/// The camera of view `index`, 0 <= index < count. The `count` directions are spread evenly over the sphere.
/// The directions are the same for every model.
ViewCamera camera_of(int index, int count, Vec3d centre, double radius);

/// A perspective camera with a square picture.
struct RenderCamera {
  Vec3d eye;                  // in the mesh's local frame
  Vec3d x, y, z;              // unit and orthogonal: x right, y up, z backwards; the camera looks along -z
  double tan_half_fov = 0.3;  // half the picture's height at distance 1
  double near = 0;            // what lies nearer along -z is not seen; > 0, object units
};

inline constexpr double kRenderFovDegrees = 30;  // of the whole picture's height

/// The same direction as `view`, at the distance at which the sphere fills 0.96 of the picture's side. A
/// radius of 0, or one that is not finite, counts as 1.
RenderCamera perspective_camera(const ViewCamera& view, double fov_degrees = kRenderFovDegrees);

/// A camera at `eye` that looks at `target`. `up` need not be orthogonal; where it is parallel to the view or
/// zero another direction serves. `near` as RenderCamera. 0 < fov_degrees < 180.
RenderCamera look_at_camera(Vec3d eye, Vec3d target, Vec3d up, double fov_degrees, double near);

}  // namespace texmesh
