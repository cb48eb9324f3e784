#include "stages/render/edge_planes.h"

#include <cmath>

namespace texmesh::render {

EdgePlanes edge_planes(const std::array<Vec3d, 3>& corner) {
  EdgePlanes out;
  const Vec3d normal[3] = {cross(corner[1], corner[2]), cross(corner[2], corner[0]),
                           cross(corner[0], corner[1])};
  // Of differences: small triangles keep their digits.
  const Vec3d face = cross(corner[1] - corner[0], corner[2] - corner[0]);
  const double volume = dot(corner[0], face);
  const double inverse = 1 / volume;
  if (!std::isfinite(volume) || !std::isfinite(inverse)) return out;
  out.visible = true;
  out.front = volume < 0;  // corners counter-clockwise, y down
  const double sign = volume < 0 ? -1 : 1;
  for (std::size_t k = 0; k < 3; ++k)
    out.edge[k] = {normal[k].x * sign, normal[k].y * sign, normal[k].z * sign};
  out.nearness = {face.x * inverse, face.y * inverse, face.z * inverse};
  return out;
}

}  // namespace texmesh::render
