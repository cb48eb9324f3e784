#pragma once
// Inside the room only.
#include <algorithm>

#include "format/base/box.h"

namespace texmesh {

/// Square of the distance to the box; 0 inside.
inline double box_distance2(const Box3d& box, Vec3d p) {
  double sum = 0;
  for (int k = 0; k < 3; ++k) {
    const double d = std::max({box.min[k] - p[k], p[k] - box.max[k], 0.0});
    sum += d * d;
  }
  return sum;
}

}  // namespace texmesh
