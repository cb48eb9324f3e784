#include "stages/proxies/making/smooth_surface.h"

namespace texmesh::proxies {

bool is_smooth(const Mesh& mesh) {
  constexpr float kTurned2 =
      1e-6f;  // of normals' difference, squared: what rounding to 16 bits makes is less
  if (mesh.normals.empty()) return false;
  double all = 0, turning = 0;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle& corner = mesh.triangles[t];
    const Vec3d a = to_double(mesh.positions[mesh.position_of(t, 0)]),
                b = to_double(mesh.positions[mesh.position_of(t, 1)]),
                c = to_double(mesh.positions[mesh.position_of(t, 2)]);
    const double area = length(cross(b - a, c - a));
    const Vec3f first = mesh.normals[corner[0]], turn1 = mesh.normals[corner[1]] - first,
                turn2 = mesh.normals[corner[2]] - first;
    all += area;
    if (dot(turn1, turn1) > kTurned2 || dot(turn2, turn2) > kTurned2) turning += area;
  }
  return all > 0 && turning >= all / 2;
}

}  // namespace texmesh::proxies
