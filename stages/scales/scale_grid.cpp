#include "stages/scales/scale_grid.h"

#include "format/base/box.h"

namespace texmesh {
namespace {

// With fewer a surface is off its own bounds by more than readers may take for damage.
constexpr int kLeastAskedBits = 6;

/// Least bits whose step is at most `step`.
int bits_for(double range, double step) {
  int bits = 1;
  while (bits < 31 && range / static_cast<double>((std::uint64_t{1} << bits) - 1) > step) ++bits;
  return bits;
}

std::vector<float> edge_lengths(const Mesh& mesh) {
  std::vector<float> lengths;
  lengths.reserve(3 * mesh.triangles.size());
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k)
      lengths.push_back(length(mesh.positions[mesh.wedge_position[t[k]]] -
                               mesh.positions[mesh.wedge_position[t[(k + 1) % 3]]]));
  return lengths;
}

/// The least mean edge of a part that can be seen beside the whole (1/4096 of its size, a pixel of a large
/// screen), or 0: a small part under a node of its own scale needs finer steps than the average says.
double finest_part_edge(const Mesh& mesh, double whole) {
  struct Part {
    double edges = 0;
    std::size_t count = 0;
    Box3f box;
  };
  std::vector<Part> parts(mesh.part_names.size());
  for (std::size_t t = 0; t < mesh.triangles.size() && !parts.empty(); ++t) {
    Part& part = parts.at(mesh.triangle_part[t]);
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3f p = mesh.positions[mesh.wedge_position[mesh.triangles[t][k]]];
      const Vec3f q = mesh.positions[mesh.wedge_position[mesh.triangles[t][(k + 1) % 3]]];
      part.box.extend(p);
      part.edges += length(q - p);
      ++part.count;
    }
  }
  double finest = 0;
  for (const Part& part : parts) {
    if (part.count == 0 || part.box.diagonal() * 4096 < whole) continue;
    const double mean = part.edges / static_cast<double>(part.count);
    if (finest == 0 || mean < finest) finest = mean;
  }
  return finest;
}

std::size_t collapsed_triangles(const Mesh& mesh, const QuantisationGrid& grid) {
  std::size_t count = 0;
  for (const Triangle& t : mesh.triangles) {
    const Vec3f a = grid.place(mesh.positions[mesh.wedge_position[t[0]]]);
    const Vec3f b = grid.place(mesh.positions[mesh.wedge_position[t[1]]]);
    const Vec3f c = grid.place(mesh.positions[mesh.wedge_position[t[2]]]);
    const Vec3d p = to_double(mesh.positions[mesh.wedge_position[t[0]]]);
    const Vec3d area = cross(to_double(mesh.positions[mesh.wedge_position[t[1]]]) - p,
                             to_double(mesh.positions[mesh.wedge_position[t[2]]]) - p);
    if (area != Vec3d{} && cross(to_double(b) - to_double(a), to_double(c) - to_double(a)) == Vec3d{})
      ++count;
  }
  return count;
}

}  // namespace

std::uint32_t QuantisationGrid::index(float x, int axis) const {
  const float scale = static_cast<float>((std::uint32_t{1} << bits) - 1) / range;
  return static_cast<std::uint32_t>(std::max(std::floor((x - origin[axis]) * scale + 0.5f), 0.0f));
}

Vec3f QuantisationGrid::rounded(Vec3f p) const {
  return {value(index(p.x, 0), 0), value(index(p.y, 1), 1), value(index(p.z, 2), 2)};
}

Vec3f QuantisationGrid::place(Vec3f p) const {
  return {static_cast<float>(index(p.x, 0)), static_cast<float>(index(p.y, 1)),
          static_cast<float>(index(p.z, 2))};
}

QuantisationGrid position_grid(const Mesh& mesh, const ScalesOptions& options, int max_bits) {
  QuantisationGrid grid;
  if (mesh.positions.empty()) throw StageError("scales", "mesh", "positions", "none");
  const Box3f box = bounding_box(mesh.positions);
  grid.origin = box.min;
  grid.range = box.longest_side();
  if (!(grid.range > 0)) grid.range = 1;
  if (options.position_bits > 0) {
    grid.bits = std::clamp(options.position_bits, kLeastAskedBits, max_bits);
    return grid;
  }
  std::vector<float> edges = edge_lengths(mesh);
  double sum = 0;
  for (float e : edges) sum += e;
  const std::size_t rank = edges.size() / 20;
  std::nth_element(edges.begin(), edges.begin() + static_cast<std::ptrdiff_t>(rank), edges.end());
  const double error =
      std::min(sum / static_cast<double>(edges.size()) / 16, static_cast<double>(edges[rank]) / 4);
  // The farthest that a point moves is half the diagonal of a cell.
  grid.bits = bits_for(grid.range, error > 0 ? error * 2 / std::sqrt(3.0) : grid.range);
  if (const double part = finest_part_edge(mesh, box.diagonal()); part > 0 && grid.bits <= max_bits)
    grid.bits = std::max(grid.bits, std::min(max_bits, bits_for(grid.range, part / 8 * 2 / std::sqrt(3.0))));
  if (grid.bits <= max_bits) grid.bits = std::max(grid.bits, std::min(max_bits, options.least_position_bits));
  while (grid.bits < max_bits && collapsed_triangles(mesh, grid) * 1000 > mesh.triangles.size()) ++grid.bits;
  if (grid.bits > max_bits) grid.bits = 0;
  return grid;
}

QuantisationGrid uv_grid(const std::vector<Vec2f>& uv, double largest_texture_px,
                         const ScalesOptions& options, int max_bits) {
  QuantisationGrid grid;
  if (uv.empty()) return grid;
  Vec2f lo = uv[0], hi = uv[0];
  for (Vec2f p : uv) {
    lo = {std::min(lo.x, p.x), std::min(lo.y, p.y)};
    hi = {std::max(hi.x, p.x), std::max(hi.y, p.y)};
  }
  grid.origin = {lo.x, lo.y, 0};
  grid.range = std::max(hi.x - lo.x, hi.y - lo.y);
  if (!(grid.range > 0)) grid.range = 1;
  if (options.uv_bits > 0) {
    grid.bits = std::min(options.uv_bits, max_bits);
    return grid;
  }
  const double texels = std::max(largest_texture_px, 1.0);
  if (bits_for(grid.range, 0.5 / texels) > max_bits) return grid;
  grid.bits = std::min(max_bits, std::max(options.least_uv_bits, bits_for(grid.range, 0.25 / texels)));
  return grid;
}

double largest_rounding(const Mesh& mesh, const QuantisationGrid& grid) {
  double largest = 0;
  if (grid.bits == 0) return largest;
  for (Vec3f p : mesh.positions) {
    const Vec3f q = grid.rounded(p);
    for (int k = 0; k < 3; ++k) largest = std::max(largest, std::fabs(static_cast<double>(q[k]) - p[k]));
  }
  return largest;
}

}  // namespace texmesh
