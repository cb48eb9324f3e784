#pragma once
// Inside the room only: from where the picture is taken.

#include "stages/render/visibility.h"

namespace texmesh {

/// A camera that looks along -z of this frame at the positions. Its picture is the smallest square, with a
/// margin of 4 % of its side, that holds all of them but the share `left_out` (0..1) on each of its sides.
/// Positions that are not finite do not count; where none is left the camera looks at the origin.
RenderCamera fitted_camera(const std::vector<Vec3d>& positions, Vec3d x, Vec3d y, Vec3d z, double left_out);

/// The camera that viewers begin with, at `direction` from the positions (kFirstLookFovDegrees says how).
RenderCamera first_look(const std::vector<Vec3d>& positions, Vec3d direction);

/// The camera of the direction that shows most, see make_poster(). `coarse` is the same object with
/// few triangles, by which directions are compared.
RenderCamera poster_camera(const RenderScene& scene, const RenderScene& coarse, const RunContext& context);

}  // namespace texmesh
