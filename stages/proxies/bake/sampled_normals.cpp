#include <map>

#include "stages/base/parallel.h"
#include "stages/geometry/mesh_topology.h"
#include "stages/proxies/bake/bake.h"

namespace texmesh {
namespace {

using Weights = std::array<double, 3>;

/// Places of a triangle, evenly spread: the middles of a subdivision's upright triangles. Small triangles
/// need fewer.
std::vector<Weights> places_of_triangles(std::size_t triangles) {
  constexpr std::size_t kManyTriangles = 3000;
  const int n = triangles < kManyTriangles ? 4 : 2;
  std::vector<Weights> out;
  for (int i = 0; i < n; ++i)
    for (int j = 0; i + j < n; ++j)
      out.push_back({(i + 1.0 / 3) / n, (j + 1.0 / 3) / n, (n - 1 - i - j + 1.0 / 3) / n});
  return out;
}

using CornerSums = std::array<Vec3d, 3>;

Vec3d face_vector(const AtlasMesh& mesh, const Triangle& t) {
  const auto at = [&](std::size_t k) { return to_double(mesh.positions[t[k]]); };
  return cross(at(1) - at(0), at(2) - at(0));
}

CornerSums sums_of(const AtlasMesh& mesh, std::size_t triangle, const std::vector<Vec3d>& smooth,
                   const std::vector<Weights>& places, const BakeSource& source) {
  const Triangle& t = mesh.triangles[triangle];
  const Vec3d face = face_vector(mesh, t);
  const double area = length(face);
  CornerSums out{};
  if (!(area > 0)) return out;
  std::optional<SurfacePlace> guess;
  for (const Weights& w : places) {
    Vec3d p, normal;
    for (std::size_t k = 0; k < 3; ++k) {
      p = p + to_double(mesh.positions[t[k]]) * w[k];
      normal = normal + smooth[t[k]] * w[k];
    }
    normal = normalized(normal);
    if (!(dot(normal, normal) > 0.5)) normal = normalized(face);
    const auto place = source.find(mesh.group_of[triangle], p, normal, guess);
    if (!place) continue;
    guess = place;
    const double footprint = std::sqrt(area / (2 * static_cast<double>(places.size())));
    const Vec3d n = to_double(source.sample(*place, footprint, {false, false, true}).normal);
    if (dot(n, face) > 0)
      for (std::size_t k = 0; k < 3; ++k) out[k] = out[k] + n * (w[k] * w[k] * area);
  }
  return out;
}

/// Vertices of equal position and group have one number.
std::vector<std::uint32_t> shared_normals(const AtlasMesh& mesh) {
  std::vector<std::uint32_t> group(mesh.positions.size(), 0);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const std::uint32_t v : mesh.triangles[t]) group[v] = mesh.group_of[t];
  std::map<std::array<std::uint32_t, 2>, std::uint32_t> index;
  std::vector<std::uint32_t> out;
  for (std::size_t v = 0; v < group.size(); ++v)
    out.push_back(index.try_emplace({mesh.position_of[v], group[v]}, static_cast<std::uint32_t>(index.size()))
                      .first->second);
  return out;
}

/// Whether S_0 turns at an edge of two triangles. On round shapes normals turn within triangles as well: near
/// the edge they differ by .55 to .6 of what the triangles do, at a hard edge by all of it.
class Creases {
 public:
  Creases(const AtlasMesh& mesh, const std::vector<CornerSums>& sums, CreaseUse use)
      : mesh_(mesh), sums_(sums), use_(use) {
    for (const Triangle& t : mesh.triangles) mean_size_ += length(face_vector(mesh, t));
    mean_size_ /= static_cast<double>(std::max<std::size_t>(mesh.triangles.size(), 1));
  }
  bool between(std::uint32_t half_edge, std::uint32_t opposite) const {
    constexpr double kLeastTurn = 0.35, kLargeTurn = 0.85;  // chords of 20 and 50 degrees
    constexpr double kLeastShare = 0.7;
    // Of both triangles together, in means of all: a crease between small ones is hardly seen, and its
    // vertices take bytes.
    constexpr double kLeastSizes = 1.3;
    const Vec3d one = normalized(near(half_edge)), other = normalized(near(opposite));
    if (!(dot(one, one) > 0.5 && dot(other, other) > 0.5)) return false;
    const double turn = length(one - other);
    if (use_ == CreaseUse::kWhereChartsEnd)
      return turn > kLargeTurn && mesh_.chart_of[half_edge / 3] != mesh_.chart_of[opposite / 3];
    if (size(half_edge) + size(opposite) < kLeastSizes * mean_size_) return false;
    const double faces_turn = length(unit_face(half_edge) - unit_face(opposite));
    return std::min(turn, faces_turn) >= kLeastTurn && turn >= kLeastShare * faces_turn;
  }

 private:
  Vec3d unit_face(std::uint32_t corner) const {
    return normalized(face_vector(mesh_, mesh_.triangles[corner / 3]));
  }
  double size(std::uint32_t corner) const { return length(face_vector(mesh_, mesh_.triangles[corner / 3])); }
  Vec3d near(std::uint32_t half_edge) const {
    const CornerSums& sums = sums_[half_edge / 3];
    return sums[half_edge % 3] + sums[next_corner(half_edge) % 3];
  }
  const AtlasMesh& mesh_;
  const std::vector<CornerSums>& sums_;
  CreaseUse use_;
  double mean_size_ = 0;
};

/// Per corner 3 t + k: the set of corners that have its normal. They lie around one position, and no crease
/// is between them.
DisjointSets smooth_corners(const AtlasMesh& mesh, const std::vector<std::uint32_t>& shared,
                            std::size_t shared_count, const std::vector<CornerSums>& sums, CreaseUse use) {
  constexpr std::size_t kMostSheets = 64;  // at one edge: their pairs take time that grows with the square
  std::vector<std::uint32_t> corners;
  for (const Triangle& t : mesh.triangles)
    for (const std::uint32_t v : t) corners.push_back(shared[v]);
  DisjointSets sets(corners.size());
  const Creases creases(mesh, sums, use);
  const EdgeTable edges = group_edges(corners, shared_count);
  for (std::size_t e = 0; e < edges.edge_count(); ++e) {
    const std::span<const std::uint32_t> sheets = edges.edge(e);
    if (sheets.size() > kMostSheets) continue;
    for (std::size_t i = 0; i < sheets.size(); ++i)
      for (std::size_t j = i + 1; j < sheets.size(); ++j) {
        const std::uint32_t a = sheets[i], b = sheets[j];
        if (corners[a] == corners[b] || creases.between(a, b)) continue;  // not the same way round
        sets.join(a, next_corner(b));
        sets.join(next_corner(a), b);
      }
  }
  return sets;
}

}  // namespace

std::uint32_t SmoothMesh::add_copy(std::uint32_t vertex) {
  const auto copy = [vertex](auto& list) {
    const auto value = list[vertex];
    list.push_back(value);
  };
  copy(mesh.positions);
  copy(mesh.uvs);
  copy(mesh.position_of);
  copy(normals);
  return static_cast<std::uint32_t>(normals.size() - 1);
}

SmoothMesh sampled_normals(const AtlasMesh& mesh, const BakeSource& source, CreaseUse use,
                           const RunContext& context) {
  const std::vector<std::uint32_t> shared = shared_normals(mesh);
  std::vector<Vec3d> face_sum(shared.size());
  for (const Triangle& t : mesh.triangles)
    for (const std::uint32_t v : t) face_sum[shared[v]] = face_sum[shared[v]] + face_vector(mesh, t);
  std::vector<Vec3d> smooth(shared.size());
  for (std::size_t v = 0; v < shared.size(); ++v) smooth[v] = normalized(face_sum[shared[v]]);

  const std::vector<Weights> places = places_of_triangles(mesh.triangles.size());
  std::vector<CornerSums> sums(mesh.triangles.size());
  parallel_for(context, sums.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) sums[t] = sums_of(mesh, t, smooth, places, source);
  });
  DisjointSets sets = smooth_corners(mesh, shared, shared.size(), sums, use);
  std::vector<Vec3d> total(3 * sums.size());  // per set, at its name
  for (std::uint32_t c = 0; c < total.size(); ++c) {
    Vec3d& sum = total[sets.find(c)];
    sum = sum + sums[c / 3][c % 3];
  }
  SmoothMesh out{mesh, std::vector<Vec3f>(mesh.positions.size(), {0, 1, 0})};
  std::vector<std::vector<std::array<std::uint32_t, 2>>> sides(
      mesh.positions.size());  // of a vertex: set, vertex
  for (std::uint32_t c = 0; c < total.size(); ++c) {
    std::uint32_t& v = out.mesh.triangles[c / 3][c % 3];
    const std::uint32_t set = sets.find(c);
    std::vector<std::array<std::uint32_t, 2>>& known = sides[v];
    const auto side = std::ranges::find(known, set, [](const auto& s) { return s[0]; });
    const std::uint32_t first = v;
    if (side != known.end()) {
      v = (*side)[1];
      continue;
    }
    if (!known.empty()) v = out.add_copy(first);
    known.push_back({set, v});
    const Vec3d n = normalized(total[set]);
    if (dot(n, n) > 0.5)
      out.normals[v] = to_float(n);
    else if (dot(smooth[first], smooth[first]) > 0.5)
      out.normals[v] = to_float(smooth[first]);
  }
  return out;
}

}  // namespace texmesh
