#pragma once
#include <vector>

#include "format/model/model.h"

namespace texmesh {

/// Beyond this a coordinate is no measure of anything, and squares of differences would overflow a float.
inline constexpr double kLargestCoordinate = 1e18;
/// What a package's own meshes may have: half a step of a grid of one bit reaches twice as far, what is
/// wrapped around a mesh a little farther, and squares of differences are floats still.
inline constexpr double kLargestPackedCoordinate = 4 * kLargestCoordinate;

/// Positions in double precision -> mesh.origin and float positions in a local frame. The origin is 0 unless
/// the bounding box lies so far from it that float would lose more than 1e-7 of the diagonal; then it is the
/// box's centre, rounded to a float-exact value. What is no number, or beyond `largest`, becomes NaN.
void set_positions(Mesh& mesh, const std::vector<Vec3d>& positions, double largest = kLargestCoordinate);

}  // namespace texmesh
