#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "stages/base/parallel.h"
#include "stages/proxies/bake/bake.h"

namespace texmesh::proxies {
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
    const Vec3d n = to_double(source.sample(*place, footprint).normal);
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

/// Gives vertices of one number the sum over those whose own sums turn little from each other. The others lie
/// on the two sides of a crease at which charts end.
void join_sides(const std::vector<std::uint32_t>& shared, std::vector<Vec3d>& sums) {
  constexpr double kCrease = 0.64;  // cosine, of 50 degrees: coarse triangles of round shapes turn by 30
  struct Side {
    Vec3d sum;
    std::vector<std::size_t> vertices;
  };
  std::vector<std::vector<Side>> sides(shared.size());
  for (std::size_t v = 0; v < shared.size(); ++v) {
    std::vector<Side>& known = sides[shared[v]];
    const Vec3d n = normalized(sums[v]);
    auto side = std::find_if(known.begin(), known.end(), [&](const Side& s) {
      return !(dot(n, n) > 0.5) || dot(normalized(s.sum), n) >= kCrease;
    });
    if (side == known.end()) side = known.insert(known.end(), Side{});
    side->sum = side->sum + sums[v];
    side->vertices.push_back(v);
  }
  for (const std::vector<Side>& known : sides)
    for (const Side& side : known)
      for (const std::size_t v : side.vertices) sums[v] = side.sum;
}

}  // namespace

std::vector<Vec3f> sampled_normals(const AtlasMesh& mesh, const BakeSource& source,
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
  std::vector<Vec3d> total(shared.size());
  for (std::size_t t = 0; t < sums.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      Vec3d& sum = total[mesh.triangles[t][k]];
      sum = sum + sums[t][k];
    }
  join_sides(shared, total);
  std::vector<Vec3f> out;
  for (std::size_t v = 0; v < shared.size(); ++v) {
    const Vec3d n = normalized(total[v]);
    out.push_back(to_float(dot(n, n) > 0.5                   ? n
                           : dot(smooth[v], smooth[v]) > 0.5 ? smooth[v]
                                                             : Vec3d{0, 1, 0}));
  }
  return out;
}

}  // namespace texmesh::proxies
