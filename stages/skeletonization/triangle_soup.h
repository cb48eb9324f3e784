#pragma once
#include <vector>

#include "format/model/model.h"

namespace texmesh {

/// Points and triangles over them; nothing else is promised.
struct TriangleSoup {
  std::vector<Vec3d> points;
  std::vector<Triangle> triangles;
};

}  // namespace texmesh
