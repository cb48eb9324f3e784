#include "stages/charts/texture_frame.h"

#include "stages/geometry/mesh_topology.h"

namespace texmesh {

TextureFrame texture_frame(const std::array<Vec3d, 3>& corner, const std::array<Vec2d, 3>& uv, Vec3d normal) {
  const Vec3d edge1 = corner[1] - corner[0], edge2 = corner[2] - corner[0];
  const Vec2d along1 = uv[1] - uv[0], along2 = uv[2] - uv[0];
  const Vec3d u = cross(normal, edge1 * along2.x - edge2 * along1.x);
  const Vec3d v = cross(normal, edge2 * along1.y - edge1 * along2.y);
  const double square = std::max(dot(u, u), dot(v, v));
  const double scale = square > 0 && std::isfinite(square) ? 1 / std::sqrt(square) : 0;
  return {u * scale, v * scale};
}

std::optional<TextureFrame> vertex_frame(const Mesh& mesh, std::uint32_t triangle,
                                         const std::array<double, 3>& weights) {
  if (mesh.tangents.empty()) return std::nullopt;
  const Triangle& corner = mesh.triangles[triangle];
  const auto [a, b, c] = corner_points(mesh, corner);
  const Vec3f face = to_float(normalized(cross(b - a, c - a)));
  Vec3f along_u, along_v;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec4f tangent = mesh.tangents[corner[k]];
    const Vec3f direction = normalized(Vec3f{tangent.x, tangent.y, tangent.z});
    if (!(dot(direction, direction) > 0.5f)) return std::nullopt;
    const Vec3f normal = mesh.normals.empty() ? face : mesh.normals[corner[k]];
    const auto weight = static_cast<float>(weights[k]);
    along_u = along_u + direction * weight;
    along_v = along_v + normalized(cross(normal, direction) * tangent.w) * weight;
  }
  return TextureFrame{to_double(normalized(along_u)), to_double(normalized(along_v))};
}

}  // namespace texmesh
